// What the pages are made of.
import { pretty } from "./plots.js";

/// element("td.number", "text" or child, ...)
export function element(selector, ...children) {
  const [tag, ...classes] = selector.split(".");
  const node = document.createElement(tag);
  if (classes.length) node.className = classes.join(" ");
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
}

export const number = (value, digits = 4) => {
  if (typeof value !== "number") return "–";
  if (Number.isInteger(value) && Math.abs(value) < 1e7) return value.toLocaleString("en").replace(/,/g, " ");
  const size = Math.abs(value);
  return size >= 1e5 || size < 1e-3 ? value.toExponential(digits - 2).replace("e+", "e") : String(Number(value.toPrecision(digits)));
};
export const withUnit = (value, unit) => [number(value), unit && !["-", "1"].includes(unit) ? element("span.unit", " " + pretty(unit)) : ""];

export function table(head, rows, kind = "") {
  return element("div.scroll", element("table" + kind, element("thead", element("tr", head.map((h) => element("th", h)))), element("tbody", rows)));
}
export const row = (...cells) => element("tr", cells.map((cell) => (cell instanceof Element && cell.tagName === "TD" ? cell : element("td", cell))));
export const cell = (...children) => element("td.number", ...children);

// --- what is drawn once it is seen, or printed

const waiting = new Map();  // holder -> function that draws
const seen = new IntersectionObserver((entries) => entries.filter((e) => e.isIntersecting).forEach((e) => drawNow(e.target)), { rootMargin: "600px" });
export function lazily(holder, work) {
  waiting.set(holder, work);
  seen.observe(holder);
}
function drawNow(holder) {
  seen.unobserve(holder);
  const work = waiting.get(holder);
  waiting.delete(holder);
  if (work) work();
}
export const drawAll = () => [...waiting.keys()].forEach(drawNow);
