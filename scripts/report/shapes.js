// Mode shapes as drawings: the body undeformed and as the mode bends it, seen from an oblique direction.
const kWidth = 300, kHeight = 190, kMargin = 14;
const kBend = 0.16;  // of the size of the body: the largest displacement that is drawn

/// x to the lower right, y to the upper right, z up.
const project = (x, y, z) => [0.87 * x + 0.5 * y, 0.36 * x - 0.5 * y - 0.8 * z];

/// points of the page: [[x, y], ...] of one state of the body.
function place(picture, shape) {
  return Array.from({ length: picture.points.length / 3 }, (none, i) =>
    project(...[0, 1, 2].map((k) => picture.points[3 * i + k] + (shape ? kBend * shape[3 * i + k] : 0))));
}

/// Draws mode j of a picture (happenings.hpp) into `parent`.
export function drawShape(parent, picture, j) {
  const still = place(picture, null), bent = place(picture, picture.shapes[j]);
  const all = [...still, ...bent], range = (k) => [Math.min(...all.map((p) => p[k])), Math.max(...all.map((p) => p[k]))];
  const [left, right] = range(0), [top, bottom] = range(1);
  const scale = Math.min((kWidth - 2 * kMargin) / Math.max(right - left, 1), (kHeight - 2 * kMargin) / Math.max(bottom - top, 1));
  const at = ([x, y]) => `${(kWidth / 2 + scale * (x - (left + right) / 2)).toFixed(1)} ${(kHeight / 2 + scale * (y - (top + bottom) / 2)).toFixed(1)}`;
  const path = (points) => {
    let d = "";
    for (let i = 0; i + 1 < picture.lines.length; i += 2) d += `M${at(points[picture.lines[i]])}L${at(points[picture.lines[i + 1]])}`;
    return d;
  };
  const dots = (p, i) => {
    const [x, y] = at(p).split(" "), [u, v] = at(bent[i]).split(" ");
    return `<path d="M${x} ${y}L${u} ${v}" class="undeformed"/><circle cx="${x}" cy="${y}" r="1.5" class="undeformed"/>` +
      `<circle cx="${u}" cy="${v}" r="2" class="deformed point"/>`;
  };
  const drawing = picture.lines.length ? `<path d="${path(still)}" class="undeformed"/><path d="${path(bent)}" class="deformed"/>`
                                       : still.map(dots).join("");  // only points are known
  parent.innerHTML = `<svg viewBox="0 0 ${kWidth} ${kHeight}" role="img" stroke-width="${picture.lines.length > 200 ? 0.8 : 1.6}" aria-label="mode ${j + 1}">${drawing}</svg>`;  // numbers alone: nothing to escape
}
