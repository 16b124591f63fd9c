// The page of a comparison: runs against their references, or against each other. All of it is made from the JSON block "run".
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { cell, drawAll, element, lazily, number, row, table } from "./elements.js";
import { draw, inkOf, pretty } from "./plots.js";

const { title, facts, is_name: isName, reference_name: referenceName, cases } = JSON.parse(document.getElementById("run").textContent);
let theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
const figuresDrawn = [];

const ended = (c) => c.rows.every((r) => r.kind !== "run" || r.verdict === "pass");
const worstOf = (c) => c.rows.filter((r) => typeof r.share === "number").reduce((worst, r) => (!worst || r.share > worst.share ? r : worst), null);
const verdict = (pass) => element("td.verdict" + (pass ? ".pass" : ".fail"), pass ? "pass" : "fail");

function bar(r) {
  if (r.share === undefined) return "";
  const ok = r.verdict === "pass", bar = element("span.bar" + (ok ? "" : ".fail"), element("i"));
  bar.firstChild.style.width = `${100 * Math.min(1, r.share === null ? 1 : r.share)}%`;
  bar.title = r.share === null ? "nothing of it is permitted" : `${number(100 * r.share, 3)} %`;
  return bar;
}

function drawOne(figure) {
  if (figure.plot) figure.plot.destroy();
  figure.plot = draw(figure.holder, { ...figure, theme, inDegrees: false, width: figure.holder.clientWidth, happened: null });
}

/// Both over each other, and below it their difference between the limits.
function overlay(r) {
  const { t, is, reference } = r.series;
  const figure = (caption, text, components, values, path) => {
    const one = { holder: element("div.plot"), t, unit: r.unit, indices: components.map((_, k) => k), channel: { path, unit: r.unit, components, values } };
    figuresDrawn.push(one);
    lazily(one.holder, () => drawOne(one));
    return element("figure", element("figcaption", element("b", caption), element("span", text)), one.holder);
  };
  const off = is.map((x, i) => (x === null || reference[i] === null ? null : x - reference[i]));
  const limits = r.limit > 0 ? [["limit", t.map(() => r.limit)], ["-limit", t.map(() => -r.limit)]] : [];
  const thin = r.series.thinned ? `${t.length} of ${r.series.thinned} rows` : "";
  return [figure(r.name, `${isName} over ${referenceName}${thin ? ", " + thin : ""}`, [isName, referenceName], [is, reference], "overlay"),
          figure("difference", r.text, ["difference", ...limits.map(([name]) => name)], [off, ...limits.map(([, values]) => values)], "difference")];
}

function section(c, i) {
  const failed = c.verdict !== "pass";
  const rows = c.rows.map((r) => row([r.name, element("small", [r.kind, r.class].filter(Boolean).join(", "))], element("td.text", r.text), element("td.margin", bar(r)), r.why || "",
                                     verdict(r.verdict === "pass")));
  const drawn = c.rows.filter((r) => r.series && r.verdict !== "pass"), others = c.rows.filter((r) => r.series && r.verdict === "pass");
  const more = element("details", element("summary", `What passes, drawn (${others.length})`));
  let filled = false;
  more.addEventListener("toggle", () => {
    if (!filled) more.append(element("div.grid", others.flatMap(overlay)));
    filled = true;
  });
  const body = [c.truth ? element("p.note", "Truth: " + c.truth) : null, c.text ? element("pre", c.text) : null,
                table(["what", "found", "share of limit", "why this limit", "verdict"], rows, ".checks"),
                drawn.length ? element("div.grid", drawn.flatMap(overlay)) : null, others.length ? more : null];
  const details = element("details", element("summary", c.name, " ", element("span.badge" + (failed ? ".fail" : ".pass"), failed ? (ended(c) ? "differs" : "did not end") : "pass")), ...body.filter(Boolean));
  details.open = failed || cases.length === 1;
  details.id = "case-" + i;
  return details;
}

const failed = cases.filter((c) => c.verdict !== "pass").length;
const light = element("button", "light / dark");
light.onclick = () => {
  theme = theme === "dark" ? "light" : "dark";
  document.documentElement.dataset.theme = theme;
  figuresDrawn.filter(({ plot }) => plot).forEach(drawOne);
};
const badge = failed ? element("span.badge.fail", cases.length === 1 ? "differs" : `${failed} of ${cases.length} fail`)
                     : element("span.badge.pass", cases.length === 1 ? "pass" : `all ${cases.length} pass`);
const list = cases.map((c, i) => {
  const link = element("a", c.name), worst = worstOf(c);
  link.href = "#case-" + i;
  link.onclick = () => { document.getElementById("case-" + i).open = true; };
  const broken = c.rows.find((r) => r.verdict !== "pass");
  return row(element("td", link), typeof c.wall_s === "number" ? cell(number(c.wall_s, 3), element("span.unit", " s")) : "",
             broken ? `${broken.name}: ${broken.text || c.text}` : worst ? `${number(100 * worst.share, 2)} % of the limit, ${worst.name}` : "", verdict(c.verdict === "pass"));
});
document.getElementById("page").append(
  element("header", element("div.title", element("h1", title), badge), element("div.facts", element("span", facts.join("  ·  ")), element("span.buttons", light))),
  ...(cases.length > 1 ? [element("h2", "Scenarios"), table(["scenario", "time", "worst", "verdict"], list)] : []),
  element("h2", cases.length > 1 ? "One by one" : "What was compared"), ...cases.map(section));
document.documentElement.dataset.theme = theme;
if (["#dark", "#light"].includes(location.hash)) document.documentElement.dataset.theme = theme = location.hash.slice(1);
addEventListener("beforeprint", drawAll);

// "#selftest" tells in the document what was drawn.
if (location.hash === "#selftest") {
  drawAll();
  setTimeout(() => {
    document.body.dataset.plots = figuresDrawn.length;
    document.body.dataset.drawn = figuresDrawn.filter(({ plot }) => inkOf(plot).every((n) => n !== 0)).length;
  });
}
