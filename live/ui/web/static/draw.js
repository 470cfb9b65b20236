// Drawing over the picture with the mouse. Coordinates are px of the picture; the centre of the first pixel is 0, 0.
const SVG = "http://www.w3.org/2000/svg";

export function make(name, attributes, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

// The lines of a gauge as the server gives them.
function shape(gauge) {
  return gauge.outline.map((line) => make("polyline", { class: "gauge", points: line.join(" ") }));
}

export function drawGauges(svg, gauges, width, height, handles) {
  const mark = JSON.stringify([gauges, width, height, Boolean(handles)]);
  if (svg.dataset.mark === mark) return;
  svg.dataset.mark = mark;
  svg.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
  const size = Math.max(width, height) / 40, focused = document.activeElement?.dataset?.handle;
  const parts = [];
  for (const [name, gauge] of Object.entries(gauges)) {
    const points = gauge.handles, text = make("text", { class: "gaugename", x: points[0][0] + size / 2, y: points[0][1] - size / 3, "font-size": size });
    text.textContent = name;
    parts.push(...shape(gauge), text);
    if (handles) points.forEach((p, i) => parts.push(make("circle", { class: "handle", cx: p[0], cy: p[1], r: size / 3, tabindex: 0, "data-handle": `${name} ${i}`, "aria-label": `${name} ${i + 1}` })));
  }
  svg.replaceChildren(...parts);
  if (focused) svg.querySelector(`[data-handle="${CSS.escape(focused)}"]`)?.focus();
}

// Position of the mouse, in px of the picture.
export function position(svg, event) {
  const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  return [p.x, p.y];
}
