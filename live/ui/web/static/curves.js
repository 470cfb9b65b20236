// Two curves: stress or force against the axial strain, and all gauges against time.
import { t } from "./words.js";

const COLOURS = ["#0b8f8f", "#c2571a", "#8e44ad", "#3d7a1f", "#b8336a", "#5a6acf"];
const REQUEST_MS = 200;

export class Curves {
  constructor(first, second) {
    this.places = [first, second];
    this.clear();
    addEventListener("resize", () => this.draw(true));
  }

  clear() {
    this.names = []; this.rows = []; this.edition = 0; this.requested = 0; this.busy = false;
    for (const plot of this.plots ?? []) plot.destroy();
    this.plots = null;
  }

  theme() { if (this.plots) this.draw(true); }

  async update([edition, count]) {
    const now = performance.now();
    if (this.busy || now - this.requested < REQUEST_MS || (edition === this.edition && count === this.rows.length)) return;
    this.busy = true;
    this.requested = now;
    try {
      const response = await fetch(`/points?edition=${this.edition}&count=${this.rows.length}`);
      if (!response.ok) return;
      const received = await response.json();
      this.rows = [...this.rows.slice(0, received.first), ...received.rows];
      this.edition = received.edition;
      const renamed = received.names.join() !== this.names.join();
      this.names = received.names;
      this.draw(renamed);
    } finally {
      this.busy = false;
    }
  }

  draw(rebuild) {
    if (!this.rows.length) return;
    const column = (i) => this.rows.map((row) => row[i]);
    const micro = (values) => values.map((v) => (v == null ? null : v * 1e6));
    const data = [
      [micro(column(2)).map((v) => v ?? NaN), column(1).map((v) => (v == null || this.names[1] === "force" ? v : v / 1e6))],
      [column(0), ...this.names.slice(3).map((_, i) => micro(column(i + 3)))],
    ];
    if (rebuild || !this.plots) {
      for (const plot of this.plots ?? []) plot.destroy();
      this.plots = [this.plot(0, ["µm/m", this.names[1] === "stress" ? `${t("Stress")}, MPa` : `${t("Force")}, N`], [""], data[0]), this.plot(1, ["s", "µm/m"], this.names.slice(3), data[1])];
    }
    this.plots.forEach((plot, i) => plot.setData(data[i]));
  }

  plot(index, [across, up], names, data) {
    const style = getComputedStyle(document.documentElement), ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
    const place = this.places[index], font = "13px system-ui, sans-serif";
    const axis = (label, size) => ({ label, stroke: ink, font, labelFont: font, labelSize: 18, size, grid: { stroke: line, width: 1 }, ticks: { stroke: line } });
    // Strain is not monotonic: a range wider than the data keeps all of them drawn.
    const range = (_, low, high) => { const pad = Math.max((high - low) * 0.04, 1e-6); return [low - pad, high + pad]; };
    return new uPlot({
      width: place.clientWidth, height: place.clientHeight, legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false, range } },
      axes: [axis(across, 34), axis(up, 62)],
      series: [{ sorted: 0 }, ...names.map((label, i) => ({ label, stroke: COLOURS[i % COLOURS.length], width: 2, points: { show: false } }))],
      hooks: { draw: [(u) => legend(u, names, ink)] },
    }, data, place);
  }
}

// The legend, inside the plot.
function legend(u, names, ink) {
  if (names.length < 2) return;
  const { ctx, bbox } = u, ratio = devicePixelRatio;
  ctx.save();
  Object.assign(ctx, { textAlign: "left", textBaseline: "middle" });
  ctx.font = `${13 * ratio}px system-ui, sans-serif`;
  names.forEach((name, i) => {
    const y = bbox.top + (12 + 17 * i) * ratio, x = bbox.left + 10 * ratio;
    ctx.fillStyle = COLOURS[i % COLOURS.length];
    ctx.fillRect(x, y - 2 * ratio, 18 * ratio, 4 * ratio);
    ctx.fillStyle = ink;
    ctx.fillText(name, x + 24 * ratio, y);
  });
  ctx.restore();
}
