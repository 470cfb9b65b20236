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

// The wheel zooms a picture about the pointer, a trackpad by as much as it is moved, two fingers by their distance, + and
// - about the place that the keyboard has; one finger moves what is zoomed; a double click shows all of it again.
const NOTCH_PX = 100, PINCH_PX = 10, LINE_PX = 33;
function wheelFactor({ deltaY, deltaMode, ctrlKey }) {
  const moved = (deltaY * (deltaMode ? LINE_PX : 1)) / (ctrlKey ? PINCH_PX : NOTCH_PX);
  return 0.8 ** Math.min(Math.max(moved, -1), 1);
}

export function zoomable(content, place, isMoved = () => true) {
  const frame = content.parentElement, svg = content.querySelector("svg");
  let scale = 1, x = 0, y = 0;
  const fingers = new Map();
  const show = () => { content.style.transform = scale === 1 ? "" : `translate(${x}px, ${y}px) scale(${scale})`; };
  const reset = () => { scale = 1; x = y = 0; show(); };
  const zoom = (factor, clientX, clientY) => {
    const box = frame.getBoundingClientRect(), px = clientX - box.left, py = clientY - box.top;
    const next = Math.min(Math.max(scale * factor, 1), 16), of = next / scale;
    scale = next;
    move(px - (px - x) * of - x, py - (py - y) * of - y);
  };
  const move = (right, down) => {
    x = Math.min(0, Math.max(x + right, frame.clientWidth * (1 - scale)));
    y = Math.min(0, Math.max(y + down, frame.clientHeight * (1 - scale)));
    show();
  };
  frame.addEventListener("pointerdown", ({ pointerType, pointerId, clientX, clientY }) => { if (pointerType === "touch") fingers.set(pointerId, [clientX, clientY]); });
  frame.addEventListener("pointermove", ({ pointerId, clientX, clientY }) => {
    const was = fingers.get(pointerId), other = [...fingers].find(([id]) => id !== pointerId)?.[1];
    if (!was) return;
    fingers.set(pointerId, [clientX, clientY]);
    const share = other ? 0.5 : isMoved() ? 1 : 0;
    if (share) move(share * (clientX - was[0]), share * (clientY - was[1]));
    if (!other) return;
    const far = ([a, b]) => Math.max(Math.hypot(a - other[0], b - other[1]), 1);
    zoom(far([clientX, clientY]) / far(was), (clientX + other[0]) / 2, (clientY + other[1]) / 2);
  });
  for (const kind of ["pointerup", "pointercancel"]) addEventListener(kind, ({ pointerId }) => fingers.delete(pointerId));
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
