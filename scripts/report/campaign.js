// The page of `cardan campaign`: what chance makes of checks and figures. All of it is made from the JSON block "run".
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { cell, element, number, row, table, withUnit } from "./elements.js";
import { pretty } from "./plots.js";

const data = JSON.parse(document.getElementById("run").textContent);
const { quantities, runs } = data;
let theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
if (["#dark", "#light"].includes(location.hash)) theme = location.hash.slice(1);

const svg = (tag, attributes, ...children) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
};
const unitOf = (q) => (q.unit === "1" ? "" : " " + pretty(q.unit));
const percent = (share) => `${number(100 * share, 4)} %`;
const kWidth = 520, kHeight = 190, kLeft = 62, kRight = 12, kTop = 10, kBottom = 34;
const style = (name) => `var(${name})`;

/// Runs per bin; the quantiles as lines.
function histogram(q) {
  const { least, most, histogram: bins } = q, tall = Math.max(...bins), right = kWidth - kRight, bottom = kHeight - kBottom;
  const span = most.value - least.value, x = (v) => (span > 0 ? kLeft + ((v - least.value) / span) * (right - kLeft) : (kLeft + right) / 2);
  const y = (n) => bottom - (n / tall) * (bottom - kTop), wide = (right - kLeft) / bins.length;
  const text = (px, py, content, anchor) => svg("text", { x: px, y: py, "text-anchor": anchor, fill: style("--muted"), "font-size": 11 }, content);
  const bars = bins.map((n, i) => svg("rect", { x: span > 0 ? kLeft + i * wide + 0.5 : x(0) - wide / 2, y: y(n), width: wide - 1, height: bottom - y(n), fill: style("--accent"), opacity: 0.75, class: n ? "bin" : "none" }, svg("title", {}, `${n} runs`)));
  const lines = span > 0 ? [["5 %", q.p05], ["median", q.median], ["95 %", q.p95]].map(([label, v]) => svg("path", { d: `M${x(v)} ${kTop}V${bottom}`, stroke: style("--ink"), "stroke-dasharray": label === "median" ? "none" : "4 3", opacity: 0.6 }, svg("title", {}, `${label}: ${number(v)}`))) : [];
  const limits = (q.bounds ?? []).filter((v) => typeof v === "number" && v > least.value && v < most.value)
    .map((v) => svg("path", { d: `M${x(v)} ${kTop}V${bottom}`, stroke: style("--fail"), "stroke-width": 1.6, class: "limit" }, svg("title", {}, `limit: ${number(v)}`)));
  return svg("svg", { viewBox: `0 0 ${kWidth} ${kHeight}`, role: "img", "aria-label": `runs by ${q.name}`, style: "display:block;width:100%;height:auto;max-height:15rem" }, ...bars, ...lines, ...limits,
             svg("path", { d: `M${kLeft} ${kTop}V${bottom}H${right}`, fill: "none", stroke: style("--line") }),
             text(kLeft - 5, kTop + 9, String(tall), "end"), text(kLeft, bottom + 15, number(least.value), "start"), text(right, bottom + 15, number(most.value), "end"),
             text((kLeft + right) / 2, bottom + 28, q.name + (q.unit === "1" ? "" : ` [${pretty(q.unit)}]`), "middle"));
}

/// The quantity over the parameter that it goes with most.
function scatter(q, driver) {
  const p = quantities.find((other) => other.kind === "drawn" && other.name === driver.drawn), right = kWidth - kRight, bottom = kHeight - kBottom;
  const at = new Map(p.seeds.map((seed, i) => [seed, p.values[i]]));
  const along = (of, from, to) => (v) => (of.most.value > of.least.value ? from + ((v - of.least.value) / (of.most.value - of.least.value)) * (to - from) : (from + to) / 2);
  const x = along(p, kLeft + 6, right - 6), y = along(q, bottom - 6, kTop + 6);
  const text = (px, py, content, anchor) => svg("text", { x: px, y: py, "text-anchor": anchor, fill: style("--muted"), "font-size": 11 }, content);
  return svg("svg", { viewBox: `0 0 ${kWidth} ${kHeight}`, role: "img", "aria-label": `${q.name} over ${p.name}`, style: "display:block;width:100%;height:auto;max-height:15rem" },
             ...q.values.map((v, i) => svg("circle", { cx: x(at.get(q.seeds[i])), cy: y(v), r: 2.6, fill: style("--accent"), opacity: 0.6, class: "dot" }, svg("title", {}, `seed ${q.seeds[i]}: ${number(v)}${unitOf(q)} at ${number(at.get(q.seeds[i]))}${unitOf(p)}`))),
             svg("path", { d: `M${kLeft} ${kTop}V${bottom}H${right}`, fill: "none", stroke: style("--line") }),
             text(kLeft - 5, kTop + 9, number(q.most.value, 3), "end"), text(kLeft - 5, bottom, number(q.least.value, 3), "end"),
             text(kLeft, bottom + 15, number(p.least.value), "start"), text(right, bottom + 15, number(p.most.value), "end"),
             text((kLeft + right) / 2, bottom + 28, p.name + (p.unit === "1" ? "" : ` [${pretty(p.unit)}]`), "middle"));
}

/// A channel over time: from the least to the largest of the runs, from 5 % to 95 % of them, and the median.
function band(b) {
  const right = kWidth - kRight, bottom = kHeight - kBottom, low = b.lowest.value, high = b.highest.value, [begin, end] = [b.t_s[0], b.t_s.at(-1)];
  const x = (t) => kLeft + (end > begin ? (t - begin) / (end - begin) : 0.5) * (right - kLeft), y = (v) => bottom - (high > low ? (v - low) / (high - low) : 0.5) * (bottom - kTop);
  const points = (of) => b.t_s.map((t, i) => `${x(t).toFixed(1)} ${y(of[i]).toFixed(1)}`);
  const between = (lower, upper, opacity, title) => svg("path", { d: `M${points(lower).concat(points(upper).reverse()).join("L")}Z`, fill: style("--accent"), opacity, class: "band" }, svg("title", {}, title));
  const text = (px, py, content, anchor) => svg("text", { x: px, y: py, "text-anchor": anchor, fill: style("--muted"), "font-size": 11 }, content);
  return svg("svg", { viewBox: `0 0 ${kWidth} ${kHeight}`, role: "img", "aria-label": `${b.name} over time`, style: "display:block;width:100%;height:auto;max-height:15rem" },
             between(b.least, b.most, 0.2, "all runs"), between(b.p05, b.p95, 0.35, "9 of 10 runs"),
             svg("path", { d: `M${points(b.median).join("L")}`, fill: "none", stroke: style("--ink"), "stroke-width": 1.4 }, svg("title", {}, "median")),
             svg("path", { d: `M${kLeft} ${kTop}V${bottom}H${right}`, fill: "none", stroke: style("--line") }),
             text(kLeft - 5, kTop + 9, number(high, 3), "end"), text(kLeft - 5, bottom, number(low, 3), "end"),
             text(kLeft, bottom + 15, number(begin), "start"), text(right, bottom + 15, number(end), "end"), text((kLeft + right) / 2, bottom + 28, "time [s]", "middle"));
}
function bands() {
  if (!data.bands.length) return [];
  const most = (b) => Math.max(...b.runs), least = (b) => Math.min(...b.runs);
  const told = (b) => `${most(b)} runs` + (least(b) < most(b) ? `, ${b.runs.at(-1)} at the end` : "") + `; least ${number(b.lowest.value)} at ${number(b.lowest.t_s)} s (seed ${b.lowest.seed}), most ${number(b.highest.value)} at ${number(b.highest.t_s)} s (seed ${b.highest.seed})`;
  return [element("h2", "Over time"), element("p.note", "Dark: 9 of 10 runs at each time, from 5 % to 95 %; light: all; the line is the median."),
          element("div.grid", data.bands.map((b) => element("figure", element("figcaption", element("b", b.name + (b.unit === "1" ? "" : ` [${pretty(b.unit)}]`)), element("span", told(b))), band(b))))];
}

const seedOf = (end) => [number(end.value), element("small", `seed ${end.seed}`)];
function statistics(kind, title) {
  const mine = quantities.filter((q) => q.kind === kind);
  if (!mine.length) return [];
  const isCheck = kind === "check", isDrawn = kind === "drawn";
  const rows = mine.map((q) => row(element("td", q.name, isCheck ? element("small", q.limit) : null), q.unit === "1" ? "" : pretty(q.unit),
    ...(isCheck ? [element("td.verdict" + (q.failed ? ".fail" : ".pass"), q.failed ? `${q.failed} of ${q.n} failed` : `all ${q.n} pass`)] : []),
    cell(number(q.mean)), cell(number(q.deviation, 3)), cell(...seedOf(q.least)), cell(number(q.p05)), cell(number(q.median)), cell(number(q.p95)), cell(...seedOf(q.most)),
    ...(isDrawn ? [] : [element("td.text", q.drivers.map((d) => `${d.drawn} ${d.rank_correlation >= 0 ? "+" : "−"}${Math.abs(d.rank_correlation).toFixed(2)}`).join("\n") || "–")])));
  const figures = mine.flatMap((q) => {
    const caption = (text) => element("figcaption", element("b", q.name), element("span", text));
    const shown = [element("figure", caption(isDrawn ? "as it was drawn" : "runs"), histogram(q))];
    if (!isDrawn && q.drivers.length) shown.push(element("figure", caption(`over ${q.drivers[0].drawn}, which it goes with most`), scatter(q, q.drivers[0])));
    return shown;
  });
  const head = ["name", "unit", ...(isCheck ? ["verdict"] : []), "mean", "deviation", "least", "5 %", "median", "95 %", "most", ...(isDrawn ? [] : ["goes with (correlation of ranks)"])];
  return [element("h2", title), table(head, rows), element("p", ""), element("div.grid", figures)];
}

function draw() {
  document.documentElement.dataset.theme = theme;
}
const light = element("button", "light / dark");
light.onclick = () => { theme = theme === "dark" ? "light" : "dark"; draw(); };
const bad = runs.filter((r) => r.verdict !== "passed");
const badge = element("span.badge" + (bad.length ? ".fail" : ".pass"), bad.length ? `${bad.length} of ${runs.length} runs did not pass` : `all ${runs.length} runs pass`);
const card = (label, ...what) => element("div", element("dt", label), element("dd", ...what));
const last = data.first_seed + data.runs_planned - 1;
document.getElementById("page").append(
  element("header", element("div.title", element("h1", data.title), badge), element("div.facts", element("span", [data.scenario, data.program, `seeds ${data.first_seed} to ${last}`].join("  ·  ")), element("span.buttons", light))),
  element("dl.figures", card("passed", number(data.passed)), card("failed a check", number(data.failed)), card("did not come to their end", number(data.without_end)),
          card(`of all runs pass, with ${percent(data.confidence)} confidence`, `≥ ${percent(data.share_that_passes_at_least)}`),
          card(`of all runs${data.without_end ? " that come to their end" : ""} stay below the largest number, likewise`, `≥ ${percent(data.share_below_largest_at_least)}`),
          card("processor time", ...withUnit(runs.reduce((sum, r) => sum + r.cpu_s, 0), "s"))),
  ...statistics("check", "Checks"), ...statistics("figure", "Figures"), ...bands(), ...statistics("drawn", "What chance sets"),
  element("h2", "Runs that did not pass"),
  bad.length ? table(["seed", "verdict", "why", "simulated [s]", "results"], bad.slice(0, 1000).map((r) => row(cell(String(r.seed)), element("td.verdict.fail", r.verdict), element("td.text", r.why), cell(number(r.simulated_s)), element("td", r.results))))
             : element("p.note", "None."),
  element("p.note", `A run alone, with the same bits: cardan run ${data.arguments.map((w) => (/^[\w./=:+-]+$/.test(w) ? w : `'${w}'`)).join(" ")} --seed N. All numbers of all runs: campaign.csv.`));
draw();

// "#selftest" tells in the document what was drawn.
if (location.hash === "#selftest") {
  document.body.dataset.bins = document.querySelectorAll("rect.bin").length;
  document.body.dataset.bands = document.querySelectorAll("path.band").length;
  document.body.dataset.dots = document.querySelectorAll("circle.dot").length;
  document.body.dataset.rows = document.querySelectorAll("tbody tr").length;
}
