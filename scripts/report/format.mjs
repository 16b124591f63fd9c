// Numbers as the page shows them. Nothing here knows of a document: a test runs this file by itself.

/// The power of ten of the last digit that multiples of `step` have: -2 for 0.25, 0 for 25, 5 for 2e5.
function lastDigit(step) {
  let power = Math.floor(Math.log10(step) + 1e-9);
  const whole = (p) => Math.abs(step / 10 ** p - Math.round(step / 10 ** p)) < 1e-6;
  for (let more = 0; more < 15 && !whole(power); ++more) --power;
  return power;
}

/// Texts for the marks of an axis, in one notation: every mark is told in full.
export function tickTexts(marks, step) {
  const sizes = marks.filter((v) => v !== null && v !== 0).map(Math.abs);
  const largest = Math.max(...sizes, 0), last = lastDigit(step);
  const powers = largest >= 1e5 || (largest > 0 && largest < 1e-3);
  return marks.map((v) => {
    if (v === null || v === undefined) return "";
    if (Math.abs(v) < step * 1e-6) return "0";
    if (!powers) return v.toFixed(Math.max(0, -last));
    const decimals = Math.max(0, Math.floor(Math.log10(Math.abs(v)) + 1e-9) - last);
    return v.toExponential(Math.min(decimals, 15)).replace(/\.0+e/, "e").replace(/(\.\d*?)0+e/, "$1e").replace("e+", "e");
  });
}

/// How much of what a check permits was used: 0 none, 1 all, more than 1 failed; null where there is no scale, as for "below 0".
/// Permitted is least <= value <= most, either of them absent. Of a range the middle is 0. Of a bound that zero keeps the value is
/// a part; a bound that zero breaks (above 3, below -5) is a part of the value.
export function shareOfLimit({ value, least, most, limit, detail }) {
  const has = (x) => typeof x === "number" && Number.isFinite(x);
  if (!has(least) && !has(most)) {  // results of an earlier version tell the nearer bound alone
    const kind = String(detail || "").split(" ")[0];
    if (!has(limit) || !["below", "above"].includes(kind)) return null;
    return shareOfLimit(kind === "below" ? { value, most: limit } : { value, least: limit });
  }
  if (!has(value)) return null;
  if (has(least) && has(most)) {
    const half = (most - least) / 2, off = Math.abs(value - (most + least) / 2);
    return half > 0 ? off / half : off === 0 ? 0 : Infinity;
  }
  const [bound, x] = has(most) ? [most, value] : [-least, -value];  // x <= bound
  if (bound > 0) return Math.max(0, x) / bound;
  if (bound < 0) return x < 0 ? bound / x : Infinity;
  return null;
}
