// The page of `cardan precision`: work against precision, and the setting for a wanted error. All of it is made from the JSON block "run".
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { cell, element, number, row, table } from "./elements.js";
import { around, cheapest, costOf, decadeMarks, errorOf, floorOf, front } from "./choose.mjs";

const data = JSON.parse(document.getElementById("run").textContent);
const { kinds, rows } = data;
const kPalette = {  // distinct in both themes and for colour-blind eyes
  light: ["#2f6db3", "#c8553d", "#2a8c6e", "#8a5bb0", "#b8860b", "#4aa3c7", "#b0457b", "#6b7a2f", "#5c6470", "#8c5a3c"],
  dark: ["#6aa9e9", "#ee8a72", "#5fc8a3", "#bd95e0", "#e3b64a", "#7fd0ef", "#e587b4", "#b3c266", "#a5aeba", "#cb9a7c"],
};
const kShapes = ["circle", "square", "diamond", "up", "down"];
const kCosts = { cpu_s: "processor time [s]", rhs_calls: "calls of the right-hand side", steps: "steps" };
const kMeasures = { final: "at the end", l2: "root mean square over the recorded instants", largest: "largest of the recorded instants" };
const names = [...new Set(rows.map((r) => r.name))];
const hidden = new Set();
let theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
if (["#dark", "#light"].includes(location.hash)) theme = location.hash.slice(1);
const shown = { kind: kinds[0]?.name, measure: data.measure, cost: "cpu_s", wanted: data.wanted };
const kindOf = () => kinds.find((k) => k.name === shown.kind);
const unitOf = (kind) => (kind.unit === "1" ? "" : " " + kind.unit);
const colour = (name) => kPalette[theme][names.indexOf(name) % 10];

// --- the plot

const kWidth = 860, kHeight = 470, kLeft = 76, kRight = 18, kTop = 14, kBottom = 52;
const svg = (tag, attributes, ...children) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
};
function marker(shape, x, y, size, attributes) {
  const d = { square: `M${x - size} ${y - size}h${2 * size}v${2 * size}h${-2 * size}z`, diamond: `M${x} ${y - 1.3 * size}L${x + 1.3 * size} ${y}L${x} ${y + 1.3 * size}L${x - 1.3 * size} ${y}z`,
              up: `M${x} ${y - 1.2 * size}L${x + 1.2 * size} ${y + size}H${x - 1.2 * size}z`, down: `M${x} ${y + 1.2 * size}L${x + 1.2 * size} ${y - size}H${x - 1.2 * size}z` }[shape];
  return d ? svg("path", { d, ...attributes }) : svg("circle", { cx: x, cy: y, r: size, ...attributes });
}
const rung = (r) => (r.adaptive ? `tolerance ${r.rung}` : `step ${r.rung}`);
const told = (r, kind) => [`${r.name}, ${rung(r)}${r.own ? " (as the scenario has it)" : ""}`, `${shown.measure} error ${number(errorOf(r, kind.name, shown.measure), 3)}${unitOf(kind)} in ${r.errors[kind.name].channel}`,
  `${number(r.cpu_s, 3)} s, ${number(r.rhs_calls)} calls, ${number(r.steps)} steps, ${number(r.rejected)} rejected`].join("\n");

function plot(holder) {
  const kind = kindOf(), floor = floorOf(kind, shown.measure), at = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const visible = rows.filter((r) => !hidden.has(r.name) && errorOf(r, kind.name, shown.measure) !== null);
  const errors = visible.map((r) => errorOf(r, kind.name, shown.measure));
  const [x0, x1] = around([...errors, floor, shown.wanted].filter((e) => typeof e === "number" && Number.isFinite(e) && e > 0)), [y0, y1] = around(visible.map((r) => costOf(r, shown.cost)));
  const least = Math.max(x0, x1 * 1e-20);
  const x = (e) => kLeft + (kWidth - kLeft - kRight) * Math.log(Math.max(e, least) / least) / Math.log(x1 / least);
  const y = (c) => kHeight - kBottom - (kHeight - kTop - kBottom) * Math.log(Math.max(c, y0) / y0) / Math.log(y1 / y0);
  const right = kWidth - kRight, bottom = kHeight - kBottom;
  const parts = [];
  const text = (px, py, content, anchor, more = {}) => parts.push(svg("text", { x: px, y: py, "text-anchor": anchor, fill: at("--muted"), "font-size": 12, ...more }, content));
  if (floor > least && Number.isFinite(floor)) {
    parts.push(svg("rect", { x: kLeft, y: kTop, width: Math.max(0, x(floor) - kLeft), height: bottom - kTop, fill: at("--band") }));
    text(x(floor) - 5, kTop + 13, x(floor) - kLeft > 170 ? "below the error of the reference" : "", "end", { "font-size": 11 });
  }
  for (const { value, text: label } of decadeMarks(least, x1, 9)) {
    parts.push(svg("path", { d: `M${x(value)} ${kTop}V${bottom}`, stroke: at("--grid") }));
    text(x(value), bottom + 17, label, "middle");
  }
  for (const { value, text: label } of decadeMarks(y0, y1, 9)) {
    parts.push(svg("path", { d: `M${kLeft} ${y(value)}H${right}`, stroke: at("--grid") }));
    text(kLeft - 7, y(value) + 4, label, "end");
  }
  parts.push(svg("path", { d: `M${kLeft} ${kTop}V${bottom}H${right}`, fill: "none", stroke: at("--line") }));
  text((kLeft + right) / 2, kHeight - 10, `${kind.name}: ${shown.measure} error${kind.unit === "1" ? "" : ` [${kind.unit}]`}`, "middle", { fill: at("--ink") });
  text(0, 0, kCosts[shown.cost], "middle", { fill: at("--ink"), transform: `translate(15 ${(kTop + bottom) / 2}) rotate(-90)` });
  if (shown.wanted > least && shown.wanted < x1) parts.push(svg("path", { d: `M${x(shown.wanted)} ${kTop}V${bottom}`, stroke: at("--accent"), "stroke-dasharray": "5 4" }));

  const best = front(visible, kind.name, shown.measure, shown.cost, floor).map((i) => visible[i]);
  const point = (r) => [x(errorOf(r, kind.name, shown.measure)), y(costOf(r, shown.cost))];
  parts.push(svg("path", { d: best.map((r, i) => (i ? "L" : "M") + point(r).map((v) => v.toFixed(1)).join(" ")).join(""), fill: "none", stroke: at("--ink"), "stroke-width": 9, "stroke-linejoin": "round", "stroke-linecap": "round", opacity: 0.13, class: "front" }));
  const { chosen } = answer();
  for (const name of names) {
    if (hidden.has(name)) continue;
    const mine = rows.filter((r) => r.name === name && errorOf(r, kind.name, shown.measure) !== null)
      .sort((a, b) => (a.adaptive ? b.relative - a.relative : b.step_s - a.step_s));
    parts.push(svg("path", { d: mine.map((r, i) => (i ? "L" : "M") + point(r).map((v) => v.toFixed(1)).join(" ")).join(""), fill: "none", stroke: colour(name), "stroke-width": 1.6 }));
    for (const r of mine) {
      const [px, py] = point(r), shape = kShapes[names.indexOf(name) % kShapes.length];
      const dot = svg("g", { tabindex: 0 }, marker(shape, px, py, 4.2, { fill: best.includes(r) ? colour(name) : at("--card"), stroke: colour(name), "stroke-width": 1.7 }), svg("title", {}, told(r, kind)));
      if (r.own) dot.append(svg("circle", { cx: px, cy: py, r: 9, fill: "none", stroke: at("--ink"), "stroke-width": 1.2 }));
      if (chosen === r) dot.append(svg("circle", { cx: px, cy: py, r: 12.5, fill: "none", stroke: at("--accent"), "stroke-width": 2.2 }));
      parts.push(dot);
    }
  }
  holder.replaceChildren(svg("svg", { viewBox: `0 0 ${kWidth} ${kHeight}`, role: "img", "aria-label": `work against precision: ${kind.name}`, style: "display:block;width:100%;min-width:36rem;height:auto", "font-family": at("--font") }, ...parts));
}

// --- the answer

function answer() {
  const kind = kindOf(), floor = floorOf(kind, shown.measure), wanted = shown.wanted;
  if (!(wanted > 0)) return { lines: ["Type an error to be told the setting for it."] };
  const offered = rows.filter((r) => !hidden.has(r.name));
  const choice = cheapest(offered, kind.name, shown.measure, shown.cost, floor, wanted), r = offered[choice.row ?? choice.nearest];
  if (choice.row !== null)
    return { chosen: r, code: r.settings.map((s) => `--set ${s}`).join(" \\\n  "), lines: [`${r.name}, ${rung(r)}: ${number(r.cpu_s, 3)} s, ${number(r.rhs_calls)} calls, error ${number(Math.max(errorOf(r, kind.name, shown.measure), floor), 3)}${unitOf(kind)}. The tighter rungs of ${r.name} keep it too.`] };
  const why = floor > wanted ? ` The reference itself may be off by ${number(floor, 3)}${unitOf(kind)}: what lies below cannot be told.` : "";
  return { lines: [(r && errorOf(r, kind.name, shown.measure) !== null ? `None of these settings. Nearest: ${r.name}, ${rung(r)}, error ${number(errorOf(r, kind.name, shown.measure), 3)}${unitOf(kind)}.` : "None of these settings.") + why] };
}

// --- the page

const holder = element("div.scroll"), told_ = element("div.answer"), caption = element("p.note"), keys = element("p.keys");
const choiceOf = (name, list) => {
  const select = element("select", list.map(([value, label]) => { const o = element("option", label); o.value = value; return o; }));
  select.value = shown[name];
  select.onchange = () => { shown[name] = select.value; draw(); };
  return select;
};
const wanted = element("input");
wanted.type = "text"; wanted.size = 9; wanted.value = shown.wanted ?? ""; wanted.placeholder = "1e-8";
wanted.oninput = () => { const x = Number(wanted.value); shown.wanted = wanted.value.trim() && x > 0 && Number.isFinite(x) ? x : null; draw(); };
const unitLabel = element("span.unit");

function draw() {
  document.documentElement.dataset.theme = theme;
  if (!kinds.length) return;
  const kind = kindOf(), floor = floorOf(kind, shown.measure);
  plot(holder);
  unitLabel.textContent = kind.unit === "1" ? "" : kind.unit;
  caption.textContent = `${kind.name}: ${kind.meaning}; ${kMeasures[shown.measure]}. ` + (kind.against_reference === false ? "Each run's own balance, without a reference. " : Number.isFinite(floor) ? `The reference may be off by ${number(floor, 3)}${unitOf(kind)}. ` : "") +
    "The pale band joins what nothing beats; filled marks lie on it. A thin ring: as the scenario has it; a thick one: the setting for the wanted error.";
  const { lines, code } = answer();
  told_.replaceChildren(...lines.map((line) => element("p", line)), ...(code ? [element("pre", code)] : []));
  keys.replaceChildren(...names.map((name) => {
    const shape = kShapes[names.indexOf(name) % kShapes.length];
    const button = element("button", svg("svg", { width: 16, height: 12, style: "margin-right:.3rem" }, marker(shape, 8, 6, 4, { fill: colour(name) })), name);
    button.setAttribute("aria-pressed", String(!hidden.has(name)));
    button.onclick = () => { hidden.has(name) ? hidden.delete(name) : hidden.add(name); draw(); };
    return button;
  }));
  body.replaceChildren(...tableRows());
}

const several = new Set(rows.map((r) => r.formulation)).size > 1;
const form = (r) => (several ? [element("td", r.formulation)] : []);
const solver = (r) => (several ? r.name.split("+")[0] : r.name);
const body = element("tbody");
function tableRows() {
  const fronts = Object.fromEntries(kinds.map((k) => [k.name, new Set(front(rows, k.name, shown.measure, shown.cost, floorOf(k, shown.measure)))]));
  return rows.map((r, i) => {
    const name = [solver(r), r.own ? element("small", "as the scenario has it") : null, r.failure === null && !r.checks_passed ? element("small", "a check failed") : null];
    if (r.failure !== null) {
      const reason = element("td.text", "failed: " + r.failure);
      reason.colSpan = 4 + kinds.length;
      return row(element("td", ...name), ...form(r), cell(r.rung), reason);
    }
    return row(element("td", ...name), ...form(r), cell(r.rung), cell(number(r.cpu_s, 3)), cell(number(r.rhs_calls)), cell(number(r.steps)), cell(number(r.rejected)), ...kinds.map((k) => {
      const e = errorOf(r, k.name, shown.measure), floor = floorOf(k, shown.measure);
      const td = cell(e === null ? (r.errors[k.name] ? "not there" : "–") : e < floor && Number.isFinite(floor) ? "< " + number(floor, 3) : number(e, 3));
      if (fronts[k.name].has(i)) td.style.fontWeight = "650";
      return td;
    }));
  });
}

// What a budget has no need of in the model.
function modelTable() {
  const { model, budgets, measure } = data;
  if (!model) return [];
  const [whole] = model.runs, told = (r) => r.without.map((i) => model.simplifications[i].what).join(", ") || "the whole model";
  const unit = (name) => { const k = kinds.find((one) => one.name === name); return k && k.unit !== "1" ? ` [${k.unit}]` : ""; };
  const lines = model.runs.map((r, i) => {
    const other = r.name !== whole.name || r.rung !== whole.rung;
    const name = element("td", told(r), i === model.chosen ? element("small", "chosen") : null, other ? element("small", `${r.name}, ${rung(r)}`) : null);
    if (r.failure !== null) {
      const reason = element("td.text", "failed: " + r.failure);
      reason.colSpan = 4 + 2 * budgets.length;
      return row(name, reason);
    }
    const of = (errors, kind) => { const e = errors[kind]?.[measure]; return cell(typeof e === "number" ? number(e, 3) : "–"); };
    const line = row(name, ...budgets.flatMap((b) => [i === 0 ? cell("–") : of(r.added, b.kind), of(r.errors, b.kind)]), cell(number(r.cpu_s, 3)), cell(number(r.rhs_calls)), cell(number(r.operations, 3)), cell(other ? "–" : `${Math.round(100 * (1 - r.operations / whole.operations))} %`));
    if (i === model.chosen) line.style.fontWeight = "650";
    return line;
  });
  const refused = model.simplifications.filter((s) => s.refusal !== null);
  return [element("h2", "What the model has no need of"),
    element("p.note", `Within ${budgets.map((b) => `${b.kind} ${number(b.most, 3)}${unit(b.kind).replace(/[[\]]/g, "")}`).join(", ")}, ${measure}: each simplification by itself, then together; operations are counted.`),
    element("div.scroll", element("table", element("thead", element("tr", ["left out", ...budgets.flatMap((b) => [`${b.kind} adds${unit(b.kind)}`, `${b.kind} error${unit(b.kind)}`]), "cpu [s]", "calls", "operations", "saves"].map((h) => element("th", h)))), element("tbody", lines))),
    ...(refused.length ? [element("p.note", "Not to be had: " + refused.map((s) => `${s.what} (${s.refusal})`).join("; "))] : [])];
}

const light = element("button", "light / dark");
light.onclick = () => { theme = theme === "dark" ? "light" : "dark"; draw(); };
const reference = data.reference.runs.map((r) => `${r.name} ${r.rung}`).join(" and ");
const bad = kinds.filter((k) => k.converged === false);
const badge = bad.length ? element("span.badge.fail", "the reference did not converge") : element("span.badge.pass", "the reference converged");
const facts = [data.scenario, ...data.about];
document.getElementById("page").append(
  element("header", element("div.title", element("h1", data.title), badge), element("div.facts", element("span", facts.join("  ·  ")), element("span.buttons", light))),
  element("p.note", data.reference.precision !== "double" ? `Reference: ${reference}, in ${data.reference.precision}. The first is the truth; what the second differs by, or the last bit of a double, is what it may be off by.`
    : `Reference: ${reference}, in double precision${data.reference.by_two_methods ? "" : ", by one method alone"}${data.reference.why_double ? ` (113 bits are not to be had: ${data.reference.why_double})` : ""}. The first is the truth; what the second differs by is what it may be off by.`),
  ...(bad.length ? [element("p.ending", `The two differ too much in ${bad.map((k) => `${k.name} (${number(k.reference_off_by.largest, 3)}${unitOf(k)})`).join(", ")}: below that nothing here can be trusted.`)] : []),
  ...(data.reference.attempts.length ? [element("p.note", "Not fit to be a reference: " + data.reference.attempts.join("; "))] : []),
  element("h2", "Work against precision"),
  element("p.controls", "error of ", choiceOf("kind", kinds.map((k) => [k.name, k.name])), " ", choiceOf("measure", Object.keys(kMeasures).map((m) => [m, m])), "  cost ", choiceOf("cost", Object.entries(kCosts)),
          "  wanted error ", wanted, " ", unitLabel),
  element("figure", holder, keys), caption, ...modelTable(), element("h2", "The setting for the wanted error"), told_, element("h2", "All runs"),
  element("div.scroll", element("table", element("thead", element("tr", ["method", ...(several ? ["formulation"] : []), "tolerance or step", "cpu [s]", "calls", "steps", "rejected", ...kinds.map((k) => `${k.name}${k.unit === "1" ? "" : ` [${k.unit}]`}`)].map((h) => element("th", h)))), body)),
  element("p.note", "Bold: nothing is cheaper and as good. Times are processor time of the integration, beginning and end of the program left out; of repeated runs the least."));
draw();

// "#selftest" tells in the document what was drawn.
if (location.hash === "#selftest") {
  document.body.dataset.dots = holder.querySelectorAll("g[tabindex]").length;
  document.body.dataset.front = (holder.querySelector(".front")?.getAttribute("d").match(/[ML]/g) ?? []).length;
  document.body.dataset.rows = body.rows.length;
}
