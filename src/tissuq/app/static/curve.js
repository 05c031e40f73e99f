// The measured curve: all rows, those that are used, and what happened; drag over it to choose the range to use.
const SPACE = "http://www.w3.org/2000/svg";
const REGIONS = { slack: "#E69F00", rupture: "#D55E00", hold: "#CC79A7", saturation: "#009E73", slip: "#D55E00", outlier: "#CC79A7", drift: "#009E73" };
const WIDTH = 760, HEIGHT = 380, LEFT = 84, BOTTOM = 54, TOP = 12, RIGHT = 14;

const draw = (parent, name, attributes, words) => {
  const made = document.createElementNS(SPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (words != null) made.textContent = words;
  parent.append(made);
  return made;
};

const ticks = (low, high) => {
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(n => n * power).find(size => size >= raw);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + step * 1e-9; value += step) found.push(Number(value.toPrecision(10)));
  return found;
};

const extent = (values, pad) => {
  let low = Infinity, high = -Infinity;
  for (const value of values) { low = Math.min(low, value); high = Math.max(high, value); }
  const margin = (high - low || Math.abs(high) || 1) * pad;
  return [low - margin, high + margin];
};

const mark = (color, isLine) => {
  const icon = document.createElementNS(SPACE, "svg");
  icon.setAttribute("width", 22); icon.setAttribute("height", 12); icon.setAttribute("aria-hidden", "true");
  if (isLine) draw(icon, "line", { x1: 1, x2: 21, y1: 6, y2: 6, stroke: color, "stroke-width": 2 });
  else draw(icon, "circle", { cx: 11, cy: 6, r: 4, fill: color });
  return icon;
};

// chosen(low, high) is called with a range of stretches that was dragged over.
export const curveOf = (curve, name, chosen) => {
  const holder = document.createElement("div");
  const svg = draw(holder, "svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "plot", role: "img",
    "aria-label": `${name}: ${curve.y} against ${curve.x}, ${curve.used.x.length} points used` });
  const [x0, x1] = extent(curve.recorded.x.concat(curve.used.x), 0.03), [y0, y1] = extent(curve.recorded.y.concat(curve.used.y, [0]), 0.05);
  const right = x => LEFT + (x - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT);
  const down = y => HEIGHT - BOTTOM - (y - y0) / (y1 - y0) * (HEIGHT - BOTTOM - TOP);
  for (const value of ticks(x0, x1)) {
    draw(svg, "line", { x1: right(value), x2: right(value), y1: TOP, y2: HEIGHT - BOTTOM, stroke: "#e8ecf0" });
    draw(svg, "text", { x: right(value), y: HEIGHT - BOTTOM + 20, "text-anchor": "middle" }, value);
  }
  for (const value of ticks(y0, y1)) {
    draw(svg, "line", { x1: LEFT, x2: WIDTH - RIGHT, y1: down(value), y2: down(value), stroke: value ? "#e8ecf0" : "#8a8a8a" });
    draw(svg, "text", { x: LEFT - 8, y: down(value) + 5, "text-anchor": "end" }, value);
  }
  draw(svg, "text", { x: (LEFT + WIDTH - RIGHT) / 2, y: HEIGHT - 8, "text-anchor": "middle" }, curve.x);
  draw(svg, "text", { x: 0, y: 0, transform: `translate(16 ${(HEIGHT - BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle" }, curve.y);
  const path = points => points.x.map((x, i) => `${i ? "L" : "M"}${right(x).toFixed(1)} ${down(points.y[i]).toFixed(1)}`).join("");
  draw(svg, "path", { d: path(curve.recorded), fill: "none", stroke: "#8a8a8a", "stroke-width": 1.2 });
  for (const region of curve.regions) region.x.forEach((x, i) => draw(svg, "circle", {
    cx: right(x).toFixed(1), cy: down(region.y[i]).toFixed(1), r: 6, fill: REGIONS[region.kind] ?? "#E69F00", "fill-opacity": 0.45 }));
  curve.used.x.forEach((x, i) => draw(svg, "circle", { cx: right(x).toFixed(1), cy: down(curve.used.y[i]).toFixed(1), r: 2.6, fill: "#0064a3" }));

  const band = draw(svg, "rect", { y: TOP, height: HEIGHT - BOTTOM - TOP, fill: "#e69f00", "fill-opacity": 0.25, visibility: "hidden" });
  let start = null;
  const at = event => {
    const box = svg.getBoundingClientRect();
    return Math.min(x1, Math.max(x0, x0 + ((event.clientX - box.left) / box.width * WIDTH - LEFT) / (WIDTH - LEFT - RIGHT) * (x1 - x0)));
  };
  const show = (low, high) => { band.setAttribute("x", right(low)); band.setAttribute("width", right(high) - right(low)); band.setAttribute("visibility", "visible"); };
  svg.addEventListener("pointerdown", event => { start = at(event); svg.setPointerCapture(event.pointerId); });
  svg.addEventListener("pointermove", event => { if (start != null) show(Math.min(start, at(event)), Math.max(start, at(event))); });
  svg.addEventListener("pointercancel", () => { start = null; band.setAttribute("visibility", "hidden"); });
  svg.addEventListener("pointerup", event => {
    if (start == null) return;
    const [low, high] = [Math.min(start, at(event)), Math.max(start, at(event))];
    start = null;
    band.setAttribute("visibility", "hidden");
    if (high - low > 0.02 * (x1 - x0)) chosen(low, high);
  });

  const legend = document.createElement("ul");
  legend.className = "legend";
  const entries = [["all rows", "#8a8a8a", true], ["rows used", "#0064a3", false], ...curve.regions.map(region => [region.kind, REGIONS[region.kind] ?? "#E69F00", false])];
  const seen = new Set();
  for (const [words, color, isLine] of entries) {
    if (seen.has(words)) continue;
    seen.add(words);
    const item = document.createElement("li");
    item.append(mark(color, isLine), words);
    legend.append(item);
  }
  holder.append(legend);
  return holder;
};
