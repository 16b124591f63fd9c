// Plots of a run: one per channel and unit, with linked cursors and zoom.
import uPlot from "uplot";
import { tickTexts } from "./format.mjs";
import { marks } from "./marks.js";

const kHeight = 240;
const kPalette = {  // distinct in both themes and for colour-blind eyes
  light: ["#2f6db3", "#c8553d", "#2a8c6e", "#8a5bb0", "#b8860b", "#4aa3c7", "#b0457b", "#6b7a2f", "#5c6470", "#8c5a3c"],
  dark: ["#6aa9e9", "#ee8a72", "#5fc8a3", "#bd95e0", "#e3b64a", "#7fd0ef", "#e587b4", "#b3c266", "#a5aeba", "#cb9a7c"],
};

/// Angles as engineers read them, if asked for.
const kDegrees = {
  rad: ["deg", 180 / Math.PI], "rad/s": ["deg/s", 180 / Math.PI], "rad/s^2": ["deg/s^2", 180 / Math.PI],
};
const kTurning = { "rad/s": ["rpm", 30 / Math.PI] };  // wheels

export function shownUnit(channel, unit, inDegrees) {
  const table = channel.path.split("/")[0].startsWith("wheel") && kTurning[unit] ? kTurning : kDegrees;
  return (inDegrees && table[unit]) || [unit, 1];
}

export function pretty(unit) {
  return unit.replace(/\^2/g, "²").replace(/\^3/g, "³").replace(/ /g, "\u00a0").replace(/\*/g, "\u00b7");
}

/// Components of a channel by unit: one unit for all, or one for each.
export function byUnit(channel) {
  const units = channel.unit.trim().split(/\s+/);
  const single = units.length !== channel.components.length;
  const groups = new Map();
  channel.components.forEach((name, k) => {
    const unit = single ? channel.unit.trim() : units[k];
    if (!groups.has(unit)) groups.set(unit, []);
    groups.get(unit).push(k);
  });
  return [...groups];
}

/// Residuals of balances are read in powers of ten.
export function isLogarithmic(channel) {
  return channel.log || /residual/.test(channel.path) || channel.components.every((name) => /residual/.test(name)) ||
    (/^ledger/.test(channel.path) && ["", "-", "1"].includes(channel.unit.trim()));
}

function axisSize(self, texts, axisIndex) {
  const axis = self.axes[axisIndex];
  if (!texts) return 50;
  self.ctx.font = axis.font[0];
  const widest = Math.max(...texts.map((text) => (text ? self.ctx.measureText(text).width : 0)));
  return Math.ceil(widest / devicePixelRatio) + axis.ticks.size + axis.gap + 4;
}

/// Powers of ten: whole decades below the largest value, at most kDecades of them, and marks at whole decades.
const kDecades = 10;
const decadeRange = (self, min, max) => (max === null ? [-1, 0] : [Math.max(Math.floor(min), Math.ceil(max) - kDecades), Math.ceil(max)]);
function decadeSplits(self, axisIndex, min, max) {
  const step = Math.ceil((max - min) / 6), splits = [];
  for (let n = Math.ceil(min); n <= max; n += step) splits.push(n);
  return splits;
}

/// uPlot finds no marks for an axis of values below some 1e-15 or above 1e32: such are drawn in their power of ten, and told in full.
function powerOf(columns) {
  let largest = 0;
  for (const column of columns) for (const v of column) largest = Math.max(largest, Math.abs(v));
  return largest === 0 || (largest > 1e-9 && largest < 1e15) ? 0 : Math.max(Math.floor(Math.log10(largest)), -300);
}

/// As uPlot has it; but of zeros alone, from -1 to 1.
function valueRange(self, min, max) {
  if (min === null) return [null, null];
  return min === 0 && max === 0 ? [-1, 1] : uPlot.rangeNum(min, max, 0.1, true);
}

/// Draws one plot into `parent`; `width` in CSS pixels.
export function draw(parent, { t, channel, unit, indices, theme, inDegrees, width, happened }) {
  const style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--muted").trim(), grid = style.getPropertyValue("--grid").trim();
  const font = "12px " + style.getPropertyValue("--font");
  const [label, factor] = shownUnit(channel, unit, inDegrees);
  const log = isLogarithmic(channel);
  const palette = kPalette[theme];
  const scale = log ? 1 : 10 ** powerOf(indices.map((k) => channel.values[k].map((v) => v * factor)));
  const convert = log ? (v) => (v ? Math.log10(Math.abs(v * factor)) : null) : (v) => (v === null ? null : (v * factor) / scale);
  const legendValue = (self, value) => (value == null ? "–" : String(Number((log ? 10 ** value : value * scale).toPrecision(6))));
  const data = [t, ...indices.map((k) => channel.values[k].map(convert))];
  const axis = { stroke: ink, font, labelFont: font, labelSize: 18, labelGap: 2, gap: 4,
                 grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, size: 4, width: 1 } };
  const options = {
    width, height: kHeight,
    plugins: happened ? [marks(happened)] : [],
    padding: [10, 14, 0, 4],
    cursor: { sync: { key: "run", scales: ["x", null] }, drag: { x: true, y: false }, points: { size: 6 } },
    scales: { x: { time: false }, y: { range: log ? decadeRange : valueRange } },
    axes: [
      { ...axis, label: "t [s]", size: 28, values: (self, splits, i, space, step) => tickTexts(splits, step) },
      { ...axis, label: (log ? "|value| [" : "[") + (pretty(label) || "-") + "]", size: axisSize,
        ...(log ? { splits: decadeSplits, values: (self, splits) => splits.map((n) => "1e" + n) }
                : { values: (self, splits, i, space, step) => tickTexts(splits.map((v) => v * scale), step * scale) }) },
    ],
    series: [
      { label: "t", value: (self, value) => (value == null ? "–" : value + " s") },
      ...indices.map((k, i) => ({
        label: channel.components[k], stroke: palette[i % palette.length], width: 1.4, pxAlign: 0,
        dash: i < palette.length ? [] : [6, 3], points: { show: t.length < 40, size: 4 }, value: legendValue,
      })),
    ],
    legend: { markers: { width: 2 } },
  };
  return new uPlot(options, data, parent);
}

/// For tests: texts along the axis of values.
export const marksOf = (plot) => (plot.axes[1]._values || []).filter(Boolean);

/// For tests: pixels drawn in the colour of each series of a plot.
export function inkOf(plot) {
  const { left, top, width, height } = plot.bbox;
  const pixels = plot.ctx.getImageData(left, top, width, height).data;
  return plot.series.slice(1).map((series, i) => {
    if (plot.data[i + 1].every((v) => v === null)) return -1;  // nothing to draw
    const rgb = [1, 3, 5].map((at) => parseInt(series._stroke.slice(at, at + 2), 16));
    let count = 0;
    for (let p = 0; p < pixels.length; p += 4)
      if (pixels[p + 3] > 100 && rgb.every((c, k) => Math.abs(c - pixels[p + k]) < 40)) ++count;
    return count;
  });
}
