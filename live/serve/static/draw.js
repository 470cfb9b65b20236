// Drawing over the picture with the mouse. Coordinates are px of the picture; the centre of the first pixel is 0, 0.
const SVG = "http://www.w3.org/2000/svg";

export function make(name, attributes, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

export const places = {
  line: (g) => [g.start, g.end],
  zoi: (g) => [g.at],
  area: (g) => (g.corners ? g.corners : corners(g.box)),
  transverse: (g) => corners(g.box),
};
const corners = ([x, y, w, h]) => [[x, y], [x + w, y + h]];

// The gauge with its handles at other places; px are rounded where the configuration has whole numbers.
export function placed(gauge, points) {
  const near = (p) => p.map((v) => Math.round(v * 10) / 10);
  if (gauge.kind === "line") return { ...gauge, start: near(points[0]), end: near(points[1]) };
  if (gauge.kind === "zoi") return { ...gauge, at: near(points[0]) };
  if (gauge.corners) return { ...gauge, corners: points.map(near) };
  const [x0, y0] = [0, 1].map((k) => Math.max(Math.round(Math.min(points[0][k], points[1][k])), 0));
  const [x1, y1] = [0, 1].map((k) => Math.round(Math.max(points[0][k], points[1][k])));
  return { ...gauge, box: [x0, y0, Math.max(x1 - x0, 1), Math.max(y1 - y0, 1)] };
}

export function shape(gauge) {
  const p = places[gauge.kind](gauge);
  if (gauge.kind === "line") return make("line", { class: "gauge", x1: p[0][0], y1: p[0][1], x2: p[1][0], y2: p[1][1] });
  if (gauge.kind === "zoi") return make("circle", { class: "gauge", cx: p[0][0], cy: p[0][1], r: 6 });
  if (gauge.corners) return make("polygon", { class: "gauge", points: gauge.corners.join(" ") });
  const [x, y, w, h] = gauge.box;
  return make("rect", { class: "gauge", x, y, width: w, height: h });
}

export function drawGauges(svg, gauges, width, height, handles) {
  const mark = JSON.stringify([gauges, width, height, Boolean(handles)]);
  if (svg.dataset.mark === mark) return;
  svg.dataset.mark = mark;
  svg.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
  const size = Math.max(width, height) / 40, focused = document.activeElement?.dataset?.handle;
  const parts = [];
  for (const [name, gauge] of Object.entries(gauges)) {
    const points = places[gauge.kind](gauge), text = make("text", { class: "gaugename", x: points[0][0] + size / 2, y: points[0][1] - size / 3, "font-size": size });
    text.textContent = name;
    parts.push(shape(gauge), text);
    if (handles) points.forEach((p, i) => parts.push(make("circle", { class: "handle", cx: p[0], cy: p[1], r: size / 3, tabindex: 0, "data-handle": `${name} ${i}`, "aria-label": `${name} ${i + 1}` })));
  }
  svg.replaceChildren(...parts);
  if (focused) svg.querySelector(`[data-handle="${CSS.escape(focused)}"]`)?.focus();
}

// Where the mouse is, in px of the picture.
export function place(svg, event) {
  const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  return [p.x, p.y];
}
