// Shapes over the picture. Coordinates are px of the picture; the centre of the first pixel is 0, 0.
import { colourOf, inkOf } from "./numbers.js";

const SVG = "http://www.w3.org/2000/svg";

export function make(name, attributes, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

// The lines of a gauge as the server gives them, on a dark rim.
function outline(gauge, colour) {
  const lines = gauge.outline.map((line) => line.join(" "));
  return [...lines.map((points) => make("polyline", { class: "rim", points })), ...lines.map((points) => make("polyline", { class: "gauge", points, stroke: colour }))];
}

// Places for names: beside the first handle, moved down while they would lie on another name.
function namePlaces(gauges, size, width, height) {
  const taken = [];
  return gauges.map(([name, gauge]) => {
    const long = name.length * size * 0.62, [hx, hy] = gauge.handles[0];
    const x = Math.max(0, Math.min(hx + size / 2, width - long));
    let y = Math.max(size, hy - size / 3);
    const lies = (other) => Math.abs(other.y - y) < size && x < other.x + other.long && other.x < x + long;
    for (let tries = 0; taken.some(lies) && tries < 100; tries++) y = y + size < height ? y + size * 0.25 : size;
    taken.push({ x, y, long });
    return [x, y];
  });
}

export function drawGauges(svg, gauges, width, height, handles) {
  const mark = JSON.stringify([gauges, width, height, Boolean(handles)]);
  if (svg.dataset.mark === mark) return;
  svg.dataset.mark = mark;
  svg.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
  const size = Math.max(width, height) / 38, focused = document.activeElement?.dataset?.handle;
  const all = Object.entries(gauges), places = namePlaces(all, size, width, height), parts = [], names = [], dots = [];
  all.forEach(([name, gauge], k) => {
    const index = gauge.colour ?? k, colour = colourOf(index), [x, y] = places[k];
    const text = make("text", { class: "gaugename", x, y, "font-size": size, fill: inkOf(index) });
    text.textContent = name;
    parts.push(...outline(gauge, colour));
    names.push(text);
    if (handles && gauge.kind !== "plate") gauge.handles.forEach((p, i) => dots.push(make("circle", { class: "handle", cx: p[0], cy: p[1], r: size / 3, fill: colour, tabindex: 0, role: "button", "data-handle": `${name} ${i}`, "aria-label": `${name} ${i + 1}` })));
  });
  svg.replaceChildren(...parts, ...names, ...dots);
  if (focused) svg.querySelector(`[data-handle="${CSS.escape(focused)}"]`)?.focus();
}

// Position of the mouse, in px of the picture.
export function position(svg, event) {
  const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  return [p.x, p.y];
}

// A place after an arrow key, 1 px or with Shift 10 px on, within the picture; null for another key.
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
export function moved(event, at, width = Infinity, height = Infinity) {
  const arrow = ARROWS[event.key], step = event.shiftKey ? 10 : 1, low = width === Infinity ? -Infinity : 0;
  if (!arrow) return null;
  return [width, height].map((size, k) => Math.min(Math.max(at[k] + step * arrow[k], low), size - 1));
}

// The cross that the keyboard moves, over everything else; null removes it.
export function showCross(svg, at) {
  svg.querySelector(".cross")?.remove();
  if (!at) return;
  const [x, y] = at, r = svg.viewBox.baseVal.width / 30;
  svg.append(make("path", { class: "cross", d: `M${x - r} ${y}h${2 * r}M${x} ${y - r}v${2 * r}` }));
}

// The wheel zooms a picture about the pointer, a trackpad by as much as it is moved, + and - about the place that the
// keyboard has; a double click shows all of it again.
const NOTCH_PX = 100, PINCH_PX = 10, LINE_PX = 33;
function wheelFactor({ deltaY, deltaMode, ctrlKey }) {
  const moved = (deltaY * (deltaMode ? LINE_PX : 1)) / (ctrlKey ? PINCH_PX : NOTCH_PX);
  return 0.8 ** Math.min(Math.max(moved, -1), 1);
}

export function zoomable(content, place) {
  const frame = content.parentElement, svg = content.querySelector("svg");
  let scale = 1, x = 0, y = 0;
  const show = () => { content.style.transform = scale === 1 ? "" : `translate(${x}px, ${y}px) scale(${scale})`; };
  const reset = () => { scale = 1; x = y = 0; show(); };
  const zoom = (factor, clientX, clientY) => {
    const box = frame.getBoundingClientRect(), px = clientX - box.left, py = clientY - box.top;
    const next = Math.min(Math.max(scale * factor, 1), 16), of = next / scale;
    x = Math.min(0, Math.max(px - (px - x) * of, box.width * (1 - next)));
    y = Math.min(0, Math.max(py - (py - y) * of, box.height * (1 - next)));
    scale = next;
    show();
  };
  svg.addEventListener("fit", reset);
  frame.addEventListener("wheel", (event) => {
    if (Math.abs(event.deltaY) <= Math.abs(event.deltaX)) return;
    event.preventDefault();
    zoom(wheelFactor(event), event.clientX, event.clientY);
  }, { passive: false });
  svg.addEventListener("keydown", (event) => {
    const factor = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
    if (!factor) return;
    const { width, height } = svg.viewBox.baseVal, at = place() ?? [width / 2, height / 2];
    const { x: clientX, y: clientY } = new DOMPoint(...at).matrixTransform(svg.getScreenCTM());
    zoom(factor, clientX, clientY);
  });
  return reset;
}
