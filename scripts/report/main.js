// The report page. All of it is made from the JSON block "run" (written by report.cpp).
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { cell, drawAll, element, lazily, number, row, table, withUnit } from "./elements.js";
import { shareOfLimit } from "./format.mjs";
import { axisOf, bands, ending, groupsOf, instants, story, warningsOf } from "./happenings.mjs";
import { byUnit, draw, inkOf, marksOf, pretty } from "./plots.js";
import { drawShape } from "./shapes.js";

const data = JSON.parse(document.getElementById("run").textContent);
const { run, summary, series, notes } = data;
const page = document.getElementById("page");

const kGroups = { pointing: "Pointing", bodies: "Bodies", wheels: "Wheels", hinges: "Hinges", modes: "Modes", devices: "Devices",
                  ledger: "Ledgers", ledgers: "Ledgers", control: "Control",
                  loops: "Loops", reactions: "Reactions", nodes: "Nodes" };
const groupTitle = (key) => kGroups[key] || (key === "other" ? "Other" : key);  // names of the scenario stay as they are

// --- top: verdict and numbers

function verdict() {
  if (!summary) return element("span.badge.open", run.finished ? "no summary" : "not finished");
  if (summary.verdict === "interrupted" || summary.verdict === "aborted") return element("span.badge.fail", summary.verdict);
  const checks = summary.checks || [];
  const failed = checks.filter((c) => c.verdict !== "pass").length;
  if (!checks.length) return element("span.badge.open", "no checks");
  return failed ? element("span.badge.fail", `${failed} of ${checks.length} checks failed`)
                : element("span.badge.pass", checks.length === 1 ? "check passed" : `all ${checks.length} checks passed`);
}

/// What a glance must not miss beside the verdict.
function cautions() {
  const n = warningsOf(summary, notes).length + ((summary || {}).warnings_left_out || 0);
  return [((summary || {}).ledger || {}).verdict === "fail" ? element("span.badge.fail", "balances do not close") : null,
          n ? element("span.badge.open", n === 1 ? "1 warning" : `${n} warnings`) : null];
}

function header() {
  const facts = [run.scenario, run.started && run.started.replace("T", " ").replace("Z", " UTC"), "cardan " + (run.program_version || "")];
  const degrees = element("button", "rad → deg");
  degrees.setAttribute("aria-pressed", "false");
  degrees.title = "show angles in degrees, wheel speeds in rpm";
  degrees.onclick = () => {
    inDegrees = !inDegrees;
    degrees.setAttribute("aria-pressed", String(inDegrees));
    redraw();
  };
  const shown = element("button", "marks");
  shown.setAttribute("aria-pressed", "true");
  shown.title = "phases, events and warnings on the plots";
  shown.onclick = () => {
    withMarks = !withMarks;
    shown.setAttribute("aria-pressed", String(withMarks));
    redraw();
  };
  const light = element("button", "light / dark");
  light.onclick = () => setTheme(theme === "dark" ? "light" : "dark");
  return element("header",
    element("div.title", element("h1", run.title || run.scenario || "Run"), verdict(), ...cautions().filter(Boolean)),
    element("p.ending", ending({ run, summary, last: series.t[series.t.length - 1] })),
    element("div.facts", element("span", facts.filter(Boolean).join("  ·  ")), element("span.buttons", happened ? shown : null, degrees, light)));
}

function figures() {
  if (!summary) return null;
  const m = summary.model || {};
  const rate = summary.wall_s > 0 ? ` (${number(summary.simulated_s / summary.wall_s, 3)} × real time)` : "";
  const items = [
    ["simulated", withUnit(summary.simulated_s, "s")],
    ["wall time", [number(summary.wall_s, 3), element("span.unit", " s" + rate)]],
    ["steps", number(summary.steps)],
    ["right-hand sides", number(summary.rhs_calls)],
    ["bodies / hinges", `${number(m.bodies)} / ${number(m.hinges)}`],
    ["velocities / modes", `${number(m.n_v)} / ${number(m.n_modes)}`],
  ];
  return element("dl.figures", items.map(([name, value]) => element("div", element("dt", name), element("dd", value))));
}

const place = (file, line) => (file ? file + (line ? ":" + line : "") : "");

function failure() {
  const f = summary && summary.failure;
  if (!f) return null;
  const rows = [["at", f.t !== undefined ? `t = ${number(f.t, 6)} s` : ""], ["body", f.body], ["hinge", f.hinge], ["what", f.what], ["hint", f.hint],
                ["last accepted state", f.last_good]].filter(([, value]) => value);
  return element("section", element("h2", `${f.code}: ${f.title}`), table(["", ""], rows.map(([key, value]) => row(key, element("td.text", value))), ".plain.headless"));
}

function warnings() {
  const all = warningsOf(summary, notes);
  if (!all.length) return null;
  const rows = all.map((w) => row(
    element("td.warning", w.code), [w.about, element("small", [w.path, w.place || place(w.file, w.line)].filter(Boolean).join(", "))], w.hint || "",
    cell(number(w.count)), cell(typeof w.t === "number" ? withUnit(w.t, "s") : "before the run")));
  const more = summary ? summary.warnings_left_out : notes.left_out.warnings;
  return element("section", element("h2", "Warnings"), table(["code", "what", "what to do", "times", "first at"], rows),
    more ? element("p.note", `${number(more)} more kinds are not listed.`) : "");
}

function checks() {
  if (!summary || !(summary.checks || []).length) return null;
  const rows = summary.checks.map((c) => {
    const ok = c.verdict === "pass", share = shareOfLimit(c);
    const bar = share === null ? "–" : element("span.bar" + (ok ? "" : ".fail"), element("i"));
    if (share !== null) {
      bar.firstChild.style.width = `${100 * Math.min(1, share)}%`;
      bar.title = Number.isFinite(share) ? `${number(100 * share, 3)} %` : "no part of it is permitted";
      bar.dataset.share = share.toPrecision(6);
    }
    return row([c.name, c.detail ? element("small", c.detail) : ""], cell(withUnit(c.value, c.unit)), cell(withUnit(c.limit, c.unit)),
      element("td.margin", bar), element("td.verdict" + (ok ? ".pass" : ".fail"), c.verdict));
  });
  return element("section", element("h2", "Acceptance checks"), table(["check", "value", "limit", "share of limit", "verdict"], rows, ".checks"));
}

function balances() {
  if (!summary) return null;
  const names = { linear_momentum: "linear momentum", angular_momentum: "angular momentum", energy: "energy" };
  const sums = summary.ledger || {}, limits = sums.limits;
  const ledger = Object.entries(names).filter(([key]) => typeof sums[key] === "number").map(([key, name]) => {
    const ok = !limits || sums[key] <= limits[key], judged = !(sums.undecided || []).includes(name);
    const verdict = !ok ? element("td.verdict.fail", "fail") : judged ? element("td.verdict.pass", "pass") : element("td.verdict", "none: the limit is too large");
    return row(name, cell(number(sums[key], 3)), ...(limits ? [cell(number(limits[key], 3)), verdict] : []));
  });
  const head = ["ledger", "residual / largest sum", ...(limits ? ["explained by the steps", "verdict"] : [])];
  const figures = (summary.figures || summary.pointing || []).map((f) => row(f.name, cell(withUnit(f.value, f.unit))));
  return element("div.pair",
    figures.length ? element("section", element("h2", "Figures"), table(["figure", "value"], figures)) : null,
    ledger.length ? element("section", element("h2", "Balances"), table(head, ledger)) : null);
}

/// Phases, events, warnings and printed lines in order of time.
function happenings() {
  const all = story(notes), more = Object.entries(notes.left_out).map(([list, n]) => `${number(n)} more ${list}`);
  if (!all.length) return null;
  const rows = all.map(({ t, kind, text, more }) => row(cell(t === null ? "before the run" : withUnit(t, "s")), element("td.kind." + kind, kind),
                                                        kind === "printed" ? element("code", text) : text, element("td.more", more)));
  const section = element("section.story", element("h2", "What happened"), table(["t", "", "", ""], rows, ".headless"),
    more.length ? element("p.note", more.join(", ") + " are not listed.") : "");
  section.id = "group-story";
  return section;
}

// --- mode shapes

function modeShapes() {
  const { pictures, left_out: without, modes_left_out: more } = data.mode_shapes;
  if (!pictures.length && !without.length) return null;
  const parts = pictures.map((picture) => [
    element("h3", picture.bodies.join(", "), element("span.unit", `  ${picture.source ? picture.source + ", " : ""}${number(picture.size)} m`)),
    element("div.grid.shapes", picture.shapes.map((none, j) => {
      const holder = element("div.shape");
      lazily(holder, () => drawShape(holder, picture, j));
      const axis = axisOf(picture.shapes[j]);
      return element("figure", element("figcaption", element("b", `mode ${j + 1}`), element("span", withUnit(picture.frequency[j], "Hz"), axis ? `, along ${axis}` : "")), holder);
    }))]);
  const note = [`Undeformed and deformed; the size of the deformation and its sign mean nothing.`,
                more ? `${number(more)} modes are not shown.` : "", without.length ? `No room was left for the modes of ${without.join(", ")}.` : ""];
  const section = element("section", element("h2", "Mode shapes"), element("p.note", note.filter(Boolean).join(" ")), ...parts.flat());
  section.id = "group-shapes";
  return section;
}

// --- how the method went

const kLimits = { by_stop: "cut at instants and events", by_error: "as long as the error allowed", given: "of a given length" };
const kRejected = { rejected_mechanical: "error of hinges and bodies", rejected_modal: "error of modes", rejected_devices: "error of devices",
                    rejected_not_evaluated: "not evaluated", rejected_not_converged: "not converged" };
const kRestarts = { restarts_start: "the start", restarts_tick: "ticks", restarts_event: "events", restarts_corner: "corners of given motions",
                    restarts_loops: "drift off closed loops", restarts_checkpoint: "checkpoints", restarts_vehicle: "another vehicle" };

function integration() {
  const told = summary && summary.integration, { t, shortest, longest, order } = data.steps;
  if (!told && !t.length) return null;
  const all = told && { ...told, given: summary.steps - told.by_stop - told.by_error };
  const counted = (title, names) => {
    const rows = Object.entries(names).filter(([key]) => all[key]).map(([key, name]) => row(name, cell(number(all[key]))));
    return rows.length ? element("div", element("h3", title), table(["", ""], rows, ".plain.headless")) : null;
  };
  const worst = all && (all.worst || []).length
    ? element("div", element("h3", "Steps whose error was mostly that of"), table(["", ""], all.worst.map((w) => row(w.component, cell(number(w.steps)))), ".plain.headless")) : null;
  const parts = all ? [counted("Lengths of steps", kLimits), counted("Trial steps that were rejected", kRejected), counted("New starts", kRestarts), worst] : [];
  const moves = (values) => values.some((x) => x !== null && x !== values[0]);
  const plots = [
    { path: "steps/length", name: "step", unit: "s", frame: "", meaning: "shortest and longest step of each interval", components: ["shortest", "longest"], values: [shortest, longest], log: true, t },
    { path: "steps/order", name: "order", unit: "1", frame: "", meaning: "of the method, mean of each interval", components: ["order"], values: [order], t },
  ].filter((channel) => t.length > 1 && channel.values.some(moves));
  const section = element("section", element("h2", "Integration"), element("div.grid", parts.filter(Boolean)), element("div.grid", plots.flatMap(plotsOf)));
  section.id = "group-integration";
  return section;
}

// --- plots

let theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
let inDegrees = false, withMarks = true;
const lastTime = series.t.length ? series.t[series.t.length - 1] : 0;
const marked = { bands: bands(notes.phases, Math.max(lastTime, (summary || {}).simulated_s || 0)), instants: instants(notes) };
const happened = marked.bands.length + marked.instants.length > 0;
const figuresDrawn = [];  // {holder, channel, unit, indices, plot}

function plotsOf(channel) {
  return byUnit(channel).map(([unit, indices]) => {
    const figure = { holder: element("div.plot"), channel, unit, indices };
    figuresDrawn.push(figure);
    lazily(figure.holder, () => drawOne(figure));
    const frame = channel.frame ? `, in ${channel.frame} axes` : "";
    return element("figure", element("figcaption", element("b", channel.name), element("span", channel.meaning + frame)), figure.holder);
  });
}

/// Channels that do not move, with their values.
function stillList(still, open) {
  if (!still.length) return null;
  const rows = still.map(({ path, unit, components, values }) => row(path, components.map((name, k) =>
    [components.length > 1 ? name + " " : "", number(values[k], 6), k + 1 < components.length ? ",  " : ""]).flat().join(""),
    unit === "-" || unit === "1" ? "" : pretty(unit)));
  const title = series.rows === 1 ? `Values of the one row (${still.length})` : series.rows === 0 ? `Channels without a row (${still.length})`
                                  : `Not drawn, as it does not move (${still.length})`;
  const list = details(title, table(["channel", "value", "unit"], rows, ".plain"));
  list.open = open;
  return list;
}

function plotSection({ key, parts }) {
  const drawn = parts.filter(({ channels }) => channels.length), still = parts.flatMap((part) => part.still);
  const blocks = drawn.map(({ name, channels }) => [name ? element("h3", name) : "", element("div.grid" + (name ? ".part" : ""), channels.flatMap(plotsOf))]);
  const left = (series.left_out || {})[key];
  const note = left ? element("p.note", `${number(left.shown)} of ${number(left.channels)} channels that move are shown; all are in the results file.`) : "";
  const section = element("section.group", element("h2", groupTitle(key)), note, ...blocks.flat(), ...[stillList(still, !drawn.length)].filter(Boolean));
  section.id = "group-" + key;
  return section;
}

function navigation(all) {
  const link = (key, title) => {
    const a = element("a", title);
    a.href = "#group-" + key;
    return a;
  };
  const legend = [marked.bands.length ? "bands: phases" : "", notes.events.length ? "dashed: events" : "", notes.warnings.some(([t]) => t !== null) ? "dotted: warnings" : ""];
  return element("nav", all.map(({ key }) => link(key, groupTitle(key))), data.mode_shapes.pictures.length ? link("shapes", "Mode shapes") : null,
    (summary && summary.integration) || data.steps.t.length ? link("integration", "Integration") : null,
    element("span.hint", [...legend, "drag to zoom", "double click to reset", "click a name to hide"].filter(Boolean).join(" · ")));
}

function drawOne(figure) {
  if (figure.plot) figure.plot.destroy();
  figure.plot = draw(figure.holder, { ...figure, t: figure.channel.t || series.t, theme, inDegrees, width: figure.holder.clientWidth, happened: withMarks && happened ? marked : null });
}
const redraw = () => figuresDrawn.filter(({ plot }) => plot).forEach(drawOne);

function setTheme(next) {
  theme = next;
  document.documentElement.dataset.theme = next;
  redraw();
}

// --- provenance

const short = (text) => (/^[0-9a-f]{64}$/.test(text) ? element("code.hash", text) : text);
const details = (title, ...content) => element("details", element("summary", title), ...content);

function provenance() {
  const versions = Object.entries((summary && summary.versions) || {});
  const facts = [["program", [run.program_version, run.commit].filter(Boolean).join(", commit ")], ["compiler", run.compiler],
                 ["flags", run.flags], ["integrator", run.integrator], ["seed", run.seed], ["started", run.started],
                 ["finished", run.finished || "no"], ...versions.filter(([name]) => !["cardan", "commit", "compiler", "flags"].includes(name))];
  const rows = (list) => list.filter(([, value]) => value).map(([key, value]) => row(key, short(value)));
  const thinned = series.stretch > 1
    ? `Plots show the smallest and largest value of every ${series.stretch} rows; all ${number(series.rows)} rows are in the results file.`
    : `Plots show all ${number(series.rows)} rows.`;
  const block = (title, list) => (list.length ? details(`${title} (${list.length})`, table(["name", "value"], rows(list), ".plain")) : null);
  return element("section.provenance", element("h2", "Where this comes from"),
    table(["", ""], rows(facts), ".plain.headless"),
    data.inputs.length ? [element("h3", "Inputs, SHA-256"), table(["", ""], rows(data.inputs), ".plain.headless")] : null,
    data.plugins.length ? [element("h3", "Plugins, SHA-256"), table(["", ""], rows(data.plugins), ".plain.headless")] : null,
    block("Effective parameters", data.parameters), block("Defaults used", data.defaults),
    data.sweeps ? details("Program of sweeps", element("pre", data.sweeps)) : null,
    data.spec ? details("Input files as read", element("pre", data.spec)) : null,
    element("p.note", thinned));
}

// --- the page

const all = groupsOf(series.channels, series.still, Object.keys(kGroups));
const more = series.still_left_out ? element("p.note", `${number(series.still_left_out)} more channels that do not move are not listed.`) : null;
page.append(...[header(), figures(), failure(), checks(), warnings(), balances(), happenings(), navigation(all), ...all.map(plotSection), more, modeShapes(),
                integration(), provenance()].filter(Boolean));
document.documentElement.dataset.theme = theme;

let pending = 0;
addEventListener("resize", () => {
  cancelAnimationFrame(pending);
  pending = requestAnimationFrame(() => figuresDrawn.forEach(({ plot, holder }) => plot && plot.setSize({ width: holder.clientWidth, height: plot.height })));
});
let before = theme;
addEventListener("beforeprint", () => { before = theme; drawAll(); setTheme("light"); });
addEventListener("afterprint", () => setTheme(before));

// "report.html#selftest" tells in the document what was drawn; "#dark" and "#light" choose the theme.
if (["#dark", "#light"].includes(location.hash)) setTheme(location.hash.slice(1));
if (location.hash === "#selftest") {
  drawAll();
  setTimeout(() => {  // after uPlot's own queue
    for (const { holder, plot } of figuresDrawn) {
      holder.dataset.ink = inkOf(plot).join(" ");
      holder.dataset.marks = marksOf(plot).join(" ");
    }
    document.body.dataset.plots = figuresDrawn.length;
    document.body.dataset.beyond = document.documentElement.scrollWidth - document.documentElement.clientWidth;
    document.body.dataset.shapes = document.querySelectorAll("svg path.deformed, svg .deformed.point").length;
    document.body.dataset.drawn = figuresDrawn.filter(({ holder }) => holder.dataset.ink.split(" ").every((n) => n !== "0")).length;
  });
}
