// The curves: stress or force against the axial strain, and all gauges against time. Dragging zooms, a double click
// shows everything again, and the point next to the pointer is read out. With the keyboard arrows go from point to
// point, + zooms about it and - shows everything.
import { $, el, fill, put } from "./base.js";
import { key } from "./icons.js";
import { fixed, short, strainUnit, time } from "./numbers.js";
import { nameOfStrain, t } from "./words.js";

const REQUEST_MS = 200, DASHES = [[], [9, 4], [3, 3], [11, 3, 3, 3], [15, 4], [2, 5]];
const FONT = '"Liberation Sans", Arial, "Helvetica Neue", "Noto Sans", "DejaVu Sans", sans-serif';
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const dashed = (k) => DASHES[(k + Math.floor(k / 6)) % 6];

// Axes end at round numbers; noise about zero does not take a step of its own.
const NOISE = 0.08;
function roundRange(low, high) {
  const size = Math.max(high - low, 1e-9, 1e-6 * Math.abs(high)), power = 10 ** Math.floor(Math.log10(size / 4));
  const step = [1, 2, 2.5, 5, 10].find((one) => one * power >= size / 5) * power;
  return [Math.floor(low / step + NOISE) * step, Math.ceil(high / step - 1e-6) * step];
}

// One plot: columns of numbers, of which the first goes across.
class Plot {
  constructor(place, labels) {
    this.place = place;
    this.labels = labels;  // function: title, text across, unit up
    this.drawn = null;
    this.straight = [];    // lines and marks over the curve, in shown units
    this.limits = [];      // { at, axis: "x" or "y", isBeyond }
    this.ghost = null;     // [x, y] of the specimen before
    this.age = "";         // where the newest point is old: since when
    this.within = null;    // ends of both axes, or those of the data
    this.colours = [];     // indices that are stored with the curves, or null: by their place
    place.addEventListener("dblclick", () => this.showAll());
    place.addEventListener("keydown", (event) => { if (this.drawn && this.key(event)) event.preventDefault(); });
  }

  showAll() { this.isZoomed = false; this.show(this.data); }

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
    this.isZoomed = true;
    for (const [k, axis] of ["x", "y"].entries()) {
      const { min, max } = this.drawn.scales[axis], middle = this.point()[k], half = (max - min) / 4;
      this.drawn.setScale(axis, { min: middle - half, max: middle + half });
    }
  }

  destroy() { this.drawn?.destroy(); this.drawn = null; this.isZoomed = false; }

  show(data) {
    this.data = data;
    const [title, across, up] = this.labels(), [head, unit] = this.place.parentElement.querySelectorAll("figcaption > *");
    if (title) put(head, title);
    put(unit, up);
    put(this.place.parentElement.querySelector(".axis"), across);
    if (!this.place.clientWidth || !data?.[0].length) return;
    if (this.drawn && this.drawn.series.length !== data.length) this.destroy();
    this.drawn ??= this.made(data);
    this.drawn.setData(data, !this.isZoomed);
    if (this.isZoomed) this.drawn.redraw();
  }

  made(data) {
    const soft = colour("soft"), grid = colour("grid"), font = `13px ${FONT}`;
    const axis = (size) => ({ stroke: soft, font, size, gap: 4, grid: { stroke: grid, width: 1 }, ticks: { show: false }, values: (_, ticks) => ticks.map(short) });
    // Strain is not monotonic: a range of round ends keeps all of them drawn.
    const range = (which) => (_, low, high) => {
      if (this.isZoomed || low == null || high == null) return [low ?? 0, high ?? 1];
      const ends = this.within?.[which] ?? [Math.min(low, 0), Math.max(high, 0)], seen = this.limits.filter((one) => one.axis === which && Math.abs(one.at) < 3 * Math.max(Math.abs(low), Math.abs(high))).map((one) => one.at);
      return roundRange(Math.min(...ends, ...seen), Math.max(...ends, ...seen));
    };
    return new uPlot({
      width: this.place.clientWidth, height: this.place.clientHeight, legend: { show: false }, padding: [8, 22, 0, 0],
      cursor: { points: { show: false }, drag: { x: true, y: true, uni: 20 } },
      scales: { x: { time: false, range: range("x") }, y: { range: range("y") } },
      axes: [axis(26), axis(54)],
      series: [{ sorted: 0 }, ...data.slice(1).map((_, i) => this.colours[i] ?? i).map((k) => ({ stroke: colour(`c${(k % 6) + 1}`), dash: dashed(k), width: 2.25, points: { show: false } }))],
      hooks: {
        setCursor: [(u) => this.read(u)], setSelect: [(u) => { if (u.select.width > 0 || u.select.height > 0) this.isZoomed = true; }],
        drawAxes: [(u) => before(u, this)], draw: [(u) => over(u, this)],
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
    const [, across, up] = this.labels();
    put(out, at ? `${this.names?.[at[2]] ?? ""} ${across}: ${short(at[0])} · ${short(at[1])} ${up}`.trim() : "");
  }
}

function clipped(u, paint) {
  const { ctx, bbox } = u, ratio = devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.font = `600 ${13 * ratio}px ${FONT}`;
  ctx.textBaseline = "middle";
  paint(ctx, ratio, ([x, y]) => [u.valToPos(x, "x", true), u.valToPos(y, "y", true)], bbox);
  ctx.restore();
}

function path(ctx, points) {
  ctx.beginPath();
  for (const [k, p] of points.entries()) k ? ctx.lineTo(...p) : ctx.moveTo(...p);
  ctx.stroke();
}

// Behind the curves: the specimen before, as a broad grey band, and the limits.
function before(u, plot) {
  clipped(u, (ctx, ratio, at, box) => {
    if (plot.ghost) {
      Object.assign(ctx, { strokeStyle: colour("ghost"), lineWidth: 5.5 * ratio, lineJoin: "round" });
      path(ctx, plot.ghost[0].map((x, k) => at([x, plot.ghost[1][k]])));
    }
    for (const { at: value, axis, isBeyond, words } of plot.limits) {
      ctx.strokeStyle = ctx.fillStyle = colour(isBeyond ? "bad" : "look");
      ctx.lineWidth = 1.5 * ratio;
      ctx.setLineDash([10 * ratio, 4 * ratio]);
      const place = u.valToPos(value, axis, true), isAcross = axis === "x";
      path(ctx, isAcross ? [[place, box.top], [place, box.top + box.height]] : [[box.left, place], [box.left + box.width, place]]);
      ctx.textAlign = isAcross ? "right" : "left";
      ctx.fillText(words, isAcross ? place - 6 * ratio : box.left + 6 * ratio, isAcross ? box.top + box.height - 12 * ratio : place - 9 * ratio);
    }
  });
}

// Straight lines and marks with their words, over a curve; and the newest point, grey where it is old.
function over(u, plot) {
  const ink = colour("ink");
  clipped(u, (ctx, ratio, at, bbox) => {
    for (const { points, words } of plot.straight) {
      ctx.strokeStyle = ctx.fillStyle = ink;
      ctx.setLineDash([5 * ratio, 4 * ratio]);
      ctx.lineWidth = 1.25 * ratio;
      path(ctx, points.map(at));
      if (points.length > 1) continue;
      const [x, y] = at(points[0]), isRight = x + 14 * ratio + ctx.measureText(words).width > bbox.left + bbox.width;
      ctx.setLineDash([]);
      dot(ctx, x, y, 5 * ratio, ink, ratio);
      ctx.textAlign = isRight ? "right" : "left";
      ctx.fillText(words, x + (isRight ? -10 : 10) * ratio, isRight ? Math.max(y - 14 * ratio, bbox.top + 8 * ratio) : Math.min(y + 14 * ratio, bbox.top + bbox.height - 8 * ratio));
    }
    if (!plot.hasHead || plot.straight.length) return;
    const [x, y] = plot.data, last = x.findLastIndex((v, k) => v != null && Number.isFinite(v) && y[k] != null);
    if (last < 0) return;
    const head = at([x[last], y[last]]);
    dot(ctx, ...head, 6 * ratio, colour(plot.age ? "ghost" : "c1"), ratio);
    if (!plot.age) return;
    ctx.fillStyle = colour("soft");
    ctx.textAlign = head[0] > bbox.left + 0.5 * bbox.width ? "right" : "left";
    ctx.fillText(plot.age, head[0] + (ctx.textAlign === "right" ? -12 : 12) * ratio, Math.min(head[1] + 16 * ratio, bbox.top + bbox.height - 8 * ratio));
  });
}

function dot(ctx, x, y, r, fillStyle, ratio) {
  ctx.beginPath();
  ctx.arc(x, y, r, 0, 7);
  Object.assign(ctx, { fillStyle, strokeStyle: colour("panel"), lineWidth: 2 * ratio });
  ctx.fill();
  ctx.stroke();
  ctx.fillStyle = ctx.strokeStyle = fillStyle;
}

const data = { names: [], rows: [], edition: 0, requested: 0, busy: null, stage: {} };
const isStress = () => data.names[1] !== "force";
const loadUnit = () => (isStress() ? "MPa" : "N"), loadFactor = () => (isStress() ? 1e-6 : 1);
const column = (i) => data.rows.map((row) => row[i]);
const inUnit = (values, factor) => values.map((v) => (v == null ? null : v * factor));
const strains = (i) => inUnit(column(i), strainUnit().factor);

const tension = () => [t(isStress() ? "Stress against strain" : "Force against strain"), `${t("Strain along the load")}, ${strainUnit().name}`, loadUnit()];
const first = new Plot($("curve1"), tension), whole = new Plot($("curve3"), tension);
const second = new Plot($("curve2"), () => ["", `${t("Time")}, s`, strainUnit().name]);
const elastic = new Plot($("curve4"), () => ["", `${t("Strain along the load")}, ${strainUnit().name}`, loadUnit()]);
const plots = [first, second, whole, elastic];
first.hasHead = true;

export function clearCurves(stage) {
  Object.assign(data, { names: [], rows: [], edition: 0, requested: 0, busy: null, stage, lines: [], limits: {} });
  for (const plot of plots) { plot.destroy(); plot.straight = []; plot.age = ""; }
}

// After a test all that is lacking is requested, whatever was requested just before.
export async function updateCurves([edition, count], isLast = false) {
  const now = performance.now();
  if (isLast && data.busy) await data.busy;
  if (data.busy || (!isLast && now - data.requested < REQUEST_MS) || (edition === data.edition && count === data.rows.length)) return;
  data.requested = now;
  data.busy = request();
  try { await data.busy; } finally { data.busy = null; }
}

async function request() {
  try {
    const response = await fetch(`/points?edition=${data.edition}&count=${data.rows.length}`);
    if (!response.ok) return;
    const received = await response.json();
    data.rows = [...data.rows.slice(0, received.first), ...received.rows];
    data.edition = received.edition;
    data.names = received.names;
    second.colours = received.colours ?? [];
    draw();
  } catch { /* no link: the page says so */ }
}

// Limits are drawn where they are; a force that is old ends its curve with a grey point and its time.
export function showAges(figures, value) {
  const limits = Object.fromEntries(["force", "stress", "axial"].map((name) => [name, figures[name]?.limit ?? null]));
  const force = figures.force, isOld = force?.state === "old" && force.age_s != null;
  const age = isOld ? `${t("no force since")} ${time(value.elapsed_s - force.age_s)}` : "";
  if (JSON.stringify(limits) === JSON.stringify(data.limits) && age === first.age) return;
  data.limits = limits;
  first.age = age;
  draw();
}

function limitLines(name, axis, factor, unit) {
  const limit = data.limits?.[name];
  if (!limit || limit.range) return [];
  return [{ at: limit.value * factor, axis, isBeyond: limit.beyond, words: `${t("limit")} ${short(limit.value * factor)} ${unit}` }];
}

function draw() {
  if (!data.rows.length) return;
  const names = data.names.slice(3), unit = strainUnit(), curve = [strains(2).map((v) => v ?? NaN), inUnit(column(1), loadFactor())];
  second.names = names.map(nameOfStrain);
  if (document.body.dataset.stage === "after") return drawAfter(curve);
  const previous = data.stage.before, isSame = previous && previous.stress === isStress();
  first.ghost = isSame ? [inUnit(previous.strain, unit.factor), inUnit(previous.load, loadFactor())] : null;
  first.limits = [...limitLines("axial", "x", unit.factor, unit.name), ...limitLines(isStress() ? "stress" : "force", "y", loadFactor(), loadUnit())];
  second.limits = limitLines("axial", "y", unit.factor, unit.name);
  first.show(curve);
  second.show([column(0), ...names.map((_, i) => strains(i + 3))]);
  fill($("whose"), isSame ? [data.stage.what?.specimen ?? "", `${previous.specimen}, ${t("the one before")}`] : [], (text, k) => {
    const mark = key(0);
    if (k) mark.setAttribute("class", "key ghost");
    return el("li", {}, mark, text);
  });
}

// The finished curve with the lines of the evaluation: points in SI units; its elastic part by itself.
export function finishCurve(lines) {
  data.lines = lines;
  draw();
}

function drawAfter(curve) {
  const unit = strainUnit().factor, load = loadFactor();
  const lines = (data.lines ?? []).map(({ points, words }) => ({ points: points.map(([x, y]) => [x * unit, y * load]), words: words && `${words.name} ${words.bound ? "≥" : "="} ${fixed(words.value * load, 1)} ${loadUnit()}` }));
  const aids = lines.filter(({ points }) => points.length > 1), ends = aids.flatMap(({ points }) => points);
  whole.straight = lines.filter(({ points }) => points.length === 1);
  elastic.place.parentElement.hidden = !ends.length;
  whole.show(curve);
  if (!ends.length) return;
  const [x, y] = [0, 1].map((k) => ends.map((p) => p[k]));
  elastic.within = { x: [Math.min(0, ...x), 1.2 * Math.max(...x)], y: [Math.min(0, ...y), 1.1 * Math.max(...y)] };
  elastic.straight = lines.filter(({ points }) => points.every(([at]) => at <= elastic.within.x[1]));
  elastic.show(curve);
}

function again() {
  for (const plot of plots) plot.destroy();
  draw();
}
export const themeChanged = again;
for (const kind of ["resize", "language", "unit"]) addEventListener(kind, again);
