// The curves: stress or force against the axial strain, and all gauges against time. Dragging zooms, a double click
// shows everything again, and the point next to the pointer is read out. With the keyboard arrows go from point to
// point, + zooms about it and - shows everything.
import { $, el, fill, put } from "./base.js";
import { colourOf, fixed, short, strainUnit } from "./numbers.js";
import { t } from "./words.js";

const REQUEST_MS = 200;

// One plot: columns of numbers, of which the first goes across.
class Plot {
  constructor(place, labels) {
    this.place = place;
    this.labels = labels;  // function: texts of both axes
    this.drawn = null;
    this.straight = [];    // lines and marks over the curve, in shown units
    place.addEventListener("dblclick", () => this.showAll());
    place.addEventListener("keydown", (event) => { if (this.drawn && this.key(event)) event.preventDefault(); });
  }

  showAll() { this.zoomed = false; this.show(this.data, this.colours); }

  // Whether a key was used.
  key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], last = this.data[0].length - 1;
    if (step) this.at = Math.min(Math.max((this.at ?? last) + step * (event.shiftKey ? 10 : 1), 0), last);
    else if (event.key === "+" || event.key === "=") this.zoom();
    else if (event.key === "-") this.showAll();
    else return false;
    const [x, y] = this.point();
    this.drawn.setCursor({ left: this.drawn.valToPos(x, "x"), top: this.drawn.valToPos(y, "y") });
    return true;
  }

  // The point that the keyboard has reached.
  point() {
    const at = Math.min(this.at ?? Infinity, this.data[0].length - 1);
    return [this.data[0][at], this.data[1][at]];
  }

  zoom() {
    this.zoomed = true;
    for (const [k, axis] of ["x", "y"].entries()) {
      const { min, max } = this.drawn.scales[axis], middle = this.point()[k], half = (max - min) / 4;
      this.drawn.setScale(axis, { min: middle - half, max: middle + half });
    }
  }

  destroy() { this.drawn?.destroy(); this.drawn = null; this.zoomed = false; }

  show(data, colours) {
    this.data = data;
    this.colours = colours;
    if (!this.place.clientWidth || !data[0].length) return;
    if (this.drawn && this.drawn.series.length !== data.length) this.destroy();
    this.drawn ??= this.made(data);
    this.drawn.setData(data, !this.zoomed);
    if (this.zoomed) this.drawn.redraw();
  }

  made(data) {
    const style = getComputedStyle(document.documentElement), ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
    const [across, up] = this.labels(), font = "13px system-ui, sans-serif";
    const axis = (label, size) => ({ label, stroke: ink, font, labelFont: font, labelSize: 18, size, grid: { stroke: line, width: 1 }, ticks: { stroke: line }, values: (_, ticks) => ticks.map(short) });
    // Strain is not monotonic: a range wider than the data keeps all of them drawn.
    const range = (_, low, high) => { if (this.zoomed) return [low, high]; const pad = Math.max((high - low) * 0.04, 1e-6); return [low - pad, high + pad]; };
    return new uPlot({
      width: this.place.clientWidth, height: this.place.clientHeight, legend: { show: false },
      cursor: { points: { show: false }, drag: { x: true, y: true, uni: 20 } },
      scales: { x: { time: false, range } },
      axes: [axis(across, 34), axis(up, 62)],
      series: [{ sorted: 0 }, ...data.slice(1).map((_, k) => ({ stroke: this.colours(k), width: 2, points: { show: false } }))],
      hooks: {
        setCursor: [(u) => this.read(u)], setSelect: [(u) => { if (u.select.width > 0 || u.select.height > 0) this.zoomed = true; }],
        draw: [(u) => over(u, this.straight, ink)],
      },
    }, data, this.place);
  }

  // The point next to the pointer, of all curves.
  read(u) {
    const out = this.place.parentElement.querySelector(".at"), { left, top } = u.cursor;
    if (left < 0) { put(out, ""); return; }
    let best = Infinity, at = null;
    for (let i = 0; i < this.data[0].length; i++) {
      const x = u.valToPos(this.data[0][i], "x");
      for (let k = 1; k < this.data.length; k++) {
        const far = Math.hypot(x - left, u.valToPos(this.data[k][i], "y") - top);
        if (far < best) { best = far; at = [this.data[0][i], this.data[k][i], k - 1]; }
      }
    }
    const [across, up] = this.labels();
    put(out, at ? `${this.names?.[at[2]] ?? ""} ${across}: ${short(at[0])} · ${up}: ${short(at[1])}`.trim() : "");
  }
}

// Straight lines and marks with their words, over a curve.
function over(u, parts, ink) {
  const { ctx, bbox } = u, ratio = devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.font = `${13 * ratio}px system-ui, sans-serif`;
  ctx.textBaseline = "middle";
  const at = ([x, y]) => [u.valToPos(x, "x", true), u.valToPos(y, "y", true)];
  for (const { points, words } of parts) {
    ctx.strokeStyle = ctx.fillStyle = ink;
    ctx.setLineDash([6 * ratio, 4 * ratio]);
    ctx.lineWidth = 1.5 * ratio;
    ctx.beginPath();
    for (const [k, p] of points.map(at).entries()) k ? ctx.lineTo(...p) : ctx.moveTo(...p);
    ctx.stroke();
    if (points.length > 1) continue;
    const [x, y] = at(points[0]), right = x > bbox.left + 0.75 * bbox.width;
    ctx.beginPath();
    ctx.arc(x, y, 5 * ratio, 0, 7);
    ctx.fill();
    ctx.textAlign = right ? "right" : "left";
    ctx.fillText(words, x + (right ? -10 : 10) * ratio, right ? Math.max(y - 14 * ratio, bbox.top + 8 * ratio) : Math.min(y + 14 * ratio, bbox.top + bbox.height - 8 * ratio));
  }
  ctx.restore();
}

const data = { names: [], rows: [], edition: 0, requested: 0, busy: false };
const isStress = () => data.names[1] !== "force";
const loadLabel = () => (isStress() ? `${t("Stress")}, MPa` : `${t("Force")}, N`);
const column = (i) => data.rows.map((row) => row[i]);
const strains = (i) => column(i).map((v) => (v == null ? null : v * strainUnit().factor));
const loads = () => column(1).map((v) => (v == null || !isStress() ? v : v / 1e6));

const tension = () => [`${t("Strain")}, ${strainUnit().name}`, loadLabel()];
const first = new Plot($("curve1"), tension), result = new Plot($("curve3"), tension);
const second = new Plot($("curve2"), () => ["s", strainUnit().name]);
const plots = [first, second, result];

export function clearCurves() {
  Object.assign(data, { names: [], rows: [], edition: 0, requested: 0, busy: false });
  for (const plot of plots) plot.destroy();
  result.straight = [];
}

export async function updateCurves([edition, count]) {
  const now = performance.now();
  if (data.busy || now - data.requested < REQUEST_MS || (edition === data.edition && count === data.rows.length)) return;
  data.busy = true;
  data.requested = now;
  try {
    const response = await fetch(`/points?edition=${data.edition}&count=${data.rows.length}`);
    if (!response.ok) return;
    const received = await response.json();
    data.rows = [...data.rows.slice(0, received.first), ...received.rows];
    data.edition = received.edition;
    data.names = received.names;
    draw();
  } finally {
    data.busy = false;
  }
}

function draw() {
  if (!data.rows.length) return;
  const names = data.names.slice(3), curve = [strains(2).map((v) => v ?? NaN), loads()];
  second.names = names;
  if (document.body.dataset.stage === "after") { result.show(curve, colourOf); return; }
  first.show(curve, colourOf);
  second.show([column(0), ...names.map((_, i) => strains(i + 3))], colourOf);
  fill($("names"), names, (name, k) => {
    const key = el("i", { class: "key" });
    key.style.background = colourOf(k);
    return el("li", {}, key, name);
  });
}

// The finished curve with the lines of the evaluation: points in SI units.
export function finishCurve(lines) {
  const unit = strainUnit().factor, load = isStress() ? 1e-6 : 1;
  result.straight = lines.map(({ points, words }) => ({ points: points.map(([x, y]) => [x * unit, y * load]), words: words && `${words.name} = ${fixed(words.value * load, 1)} ${isStress() ? "MPa" : "N"}` }));
  draw();
}

function again() {
  for (const plot of plots) plot.destroy();
  draw();
}
export const themeChanged = again;
for (const kind of ["resize", "language", "unit"]) addEventListener(kind, again);
