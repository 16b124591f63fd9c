// What a digit costs: errors, costs, Pareto front and recommendation, as scripts/precision/choose.cpp has them. Nothing here knows of a
// document: a test runs this file by itself.

/// Of a row that ended; null: it did not, or has nothing of this kind.
export function errorOf(row, kind, measure) {
  const e = row.failure === null && row.errors[kind] ? row.errors[kind][measure] : null;
  return typeof e === "number" ? e : null;
}
export const costOf = (row, cost) => row[cost];
/// What the reference itself may be off by.
export const floorOf = (kind, measure) => (kind.against_reference === false ? 0 : kind.reference_off_by?.[measure] ?? Infinity);

/// Indices of rows that no other beats in cost and error, by ascending cost; errors below `floor` count as equal to it.
export function front(rows, kind, measure, cost, floor) {
  const error = (i) => Math.max(errorOf(rows[i], kind, measure), Number.isFinite(floor) ? floor : 0);
  let best = Infinity;
  return rows.map((_, i) => i).filter((i) => errorOf(rows[i], kind, measure) !== null)
    .sort((a, b) => costOf(rows[a], cost) - costOf(rows[b], cost) || error(a) - error(b))
    .filter((i) => error(i) < best && ((best = error(i)), true));
}

/// {row, nearest, ratio}: the cheapest row whose error is at most `most`, and that of every tighter rung of its method too; without one
/// the nearest. ratio: of its error to `most`.
export function cheapest(rows, kind, measure, cost, floor, most) {
  const ratio = (row) => { const e = errorOf(row, kind, measure); return e === null ? Infinity : Math.max(e, floor) / most; };
  const tighter = (a, b) => a.name === b.name && (a.adaptive ? a.relative < b.relative : a.step_s < b.step_s);
  let row = null, nearest = null, of = Infinity;
  rows.forEach((r, i) => {
    if (r.failure !== null) return;
    const curve = Math.max(ratio(r), ...rows.filter((other) => other.failure === null && tighter(other, r)).map(ratio));
    if (curve <= 1 && (row === null || costOf(r, cost) < costOf(rows[row], cost))) row = i, of = curve;
    if (nearest === null || ratio(r) < ratio(rows[nearest])) nearest = i;
  });
  if (row !== null) return { row, nearest: row, ratio: of };
  return { row, nearest, ratio: nearest === null ? Infinity : ratio(rows[nearest]) };
}

/// Marks of a logarithmic axis from `least` to `most`: whole decades, at most `room` of them with a text; where there are few, 2 and 5 too.
export function decadeMarks(least, most, room) {
  const from = Math.floor(Math.log10(least) + 1e-9), to = Math.ceil(Math.log10(most) - 1e-9);
  const step = Math.max(1, Math.ceil((to - from) / room)), few = to - from <= 2, marks = [];
  for (let n = from; n <= to; ++n)
    for (const m of few ? [1, 2, 5] : [1]) {
      const value = Number(`${m}e${n}`);
      if (value >= least * (1 - 1e-9) && value <= most * (1 + 1e-9)) marks.push({ value, text: (n - from) % step === 0 ? short(value) : "" });
    }
  return marks;
}
const short = (x) => (x >= 1e-2 && x < 1e4 ? String(x) : x.toExponential().replace("e+", "e"));

/// Ends of an axis around positive numbers, a little beyond them.
export function around(values, margin = 1.25) {
  const good = values.filter((v) => v > 0 && Number.isFinite(v));
  if (!good.length) return [0.1, 1];
  const least = Math.min(...good) / margin, most = Math.max(...good) * margin;
  return most / least < 4 ? [least / 2, most * 2] : [least, most];
}
