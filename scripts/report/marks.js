// Phases as bands, events and warnings as lines on every plot; the cursor tells what they are.
import { told } from "./happenings.mjs";

const kReach = 6;      // CSS pixels within which the cursor finds a line
const kFew = 15;       // lines in sight; more of them are paler and without labels
const kApart = 3;      // CSS pixels between two lines that are drawn
const kLabelRoom = 14; // CSS pixels that a label beside a line takes

const shortened = (ctx, text, room) => {
  if (ctx.measureText(text).width <= room) return text;
  let end = text.length;
  while (end > 0 && ctx.measureText(text.slice(0, end) + "…").width > room) --end;
  return end > 2 ? text.slice(0, end) + "…" : "";
};

/// A plugin of uPlot. bands: [{from, to, name}], instants: [{t, kind, label, text}], both in order of time.
export function marks({ bands, instants }) {
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const tip = document.createElement("div");
  tip.className = "tip";

  const within = (u, work) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    work(ctx, bbox, (t) => Math.round(u.valToPos(t, "x", true)));
    ctx.restore();
  };
  const font = () => `${10 * devicePixelRatio}px ${style("--font")}`;

  const paintBands = (u) => within(u, (ctx, { left, top, width, height }, x) => {
    bands.forEach(({ from, to }, i) => {
      if (i % 2) return;
      ctx.fillStyle = style("--band");
      const a = Math.max(left, x(from)), b = Math.min(left + width, x(to));
      if (b > a) ctx.fillRect(a, top, b - a, height);
    });
  });

  const paintLines = (u) => within(u, (ctx, { left, top, width, height }, x) => {
    const px = devicePixelRatio;
    ctx.font = font();
    ctx.textBaseline = "top";
    ctx.textAlign = "left";
    ctx.fillStyle = style("--muted");
    for (const { from, to, name } of bands) {
      const a = Math.max(left, x(from)), b = Math.min(left + width, x(to));
      const text = b > a ? shortened(ctx, name, b - a - 6 * px) : "";
      if (text) ctx.fillText(text, a + 3 * px, top + 2 * px);
    }
    const many = instants.filter(({ t }) => x(t) >= left && x(t) <= left + width).length > kFew;
    let drawn = -Infinity, labelled = many ? Infinity : -Infinity;
    for (const { t, kind, label } of instants) {
      const at = x(t);
      if (at < left || at > left + width || at - drawn < kApart * px) continue;
      drawn = at;
      ctx.strokeStyle = ctx.fillStyle = style(kind === "warning" ? "--open" : "--muted");
      ctx.setLineDash(kind === "warning" ? [px, 3 * px] : [5 * px, 3 * px]);
      ctx.globalAlpha = many ? 0.4 : 1;
      ctx.lineWidth = px;
      ctx.beginPath();
      ctx.moveTo(at + 0.5, top);
      ctx.lineTo(at + 0.5, top + height);
      ctx.stroke();
      if (at - labelled < kLabelRoom * px) continue;
      labelled = at;
      ctx.save();
      ctx.translate(at + 3 * px, top + height - 4 * px);
      ctx.rotate(-Math.PI / 2);
      ctx.fillText(shortened(ctx, label, 0.7 * height), 0, 0);
      ctx.restore();
    }
  });

  const tell = (u) => {
    const { left, top } = u.cursor;
    const here = left >= 0 && u.over.matches(":hover");
    const reach = Math.abs(u.posToVal(left + kReach, "x") - u.posToVal(left, "x"));
    const lines = here ? told({ bands, instants }, u.posToVal(left, "x"), reach) : [];
    tip.textContent = lines.join("\n");
    tip.style.display = lines.length ? "" : "none";
    if (!lines.length) return;
    const right = left > u.over.clientWidth / 2;
    tip.style.left = right ? "" : `${left + 12}px`;
    tip.style.right = right ? `${u.over.clientWidth - left + 12}px` : "";
    tip.style.top = `${Math.max(0, Math.min(top, u.over.clientHeight - tip.offsetHeight))}px`;
  };

  return { hooks: { init: (u) => { tip.style.display = "none"; u.over.append(tip); }, drawClear: paintBands, draw: paintLines, setCursor: tell } };
}
