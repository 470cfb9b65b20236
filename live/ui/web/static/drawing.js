// Drawing on the picture during set-up: region, gauges and scale, with mouse, touch or keyboard. The keyboard moves a
// cross; Space presses and releases there what the mouse would. A stroke that is short on the screen changes nothing,
// nor does one to which a second pointer comes.
import { $, change, el, put } from "./base.js";
import { ask } from "./press.js";
import { drawGauges, make, moved, position, showCross, zoomable } from "./draw.js";
import { numberField, onEscape } from "./fields.js";
import { fixed } from "./numbers.js";
import { t, told } from "./words.js";

const svg = $("drawing"), LEAST_PX = 12, REACH_PX = 22, pointers = new Set();
let state = {}, tool = "move", points = [], drag = null, pending = null, kinds = {}, cross = null;

const HINTS = {
  rectangle: "Drag a rectangle over the specimen; with Shift it is added.",
  polygon: "Click the corners; Enter or a double click closes it, Escape discards it.",
  brush: "Paint what is measured.",
  eraser: "Paint what is not measured.",
  move: "Drag the handles; with the keyboard Tab and the arrows.",
  scale: "Click two points whose distance is known.",
  short: "Too short a stroke: nothing has changed.",
  board: "Hold the board where the specimen will be. Of a checkerboard count the inner corners, of a ChArUco board the squares.",
  keys: "Arrows move the cross, with Shift by 10 px; Space sets a point or begins and ends a stroke; + and - zoom.",
};
const isDragged = () => tool === "rectangle" || ["line", "box"].includes(kinds[tool]?.gesture);
const isClicked = () => kinds[tool]?.gesture === "click";
zoomable(svg.parentElement, () => cross, () => tool === "move" && !drag);

function choose(name) {
  tool = name;
  points = [];
  drag = null;
  for (const button of document.querySelectorAll("[data-tool]")) button.setAttribute("aria-pressed", String(button.dataset.tool === name));
  hint(words());
  svg.style.cursor = name === "move" ? "default" : "crosshair";
  sketch();
}
for (const button of document.querySelectorAll("[data-tool]")) button.addEventListener("click", () => choose(button.dataset.tool));

const words = () => HINTS[tool] ?? kinds[tool].hint;

function hint(words) {
  $("hint").dataset.t = words;
  put($("hint"), t(words));
}

// Another picture is shown: what was begun on the last one is discarded.
export function forgetDrawing() {
  points = [];
  drag = pending = cross = scaled = null;
  asking = false;
  sketch();
}

function cancel() {
  if (drag && !drag.isClick) points = [];
  drag = pending = null;
  sketch();
}

// A button for each kind of gauge; the first ones have the keys 5 to 8.
export function beginDrawing(stage) {
  choose("move");
  kinds = Object.fromEntries(stage.kinds.map((one) => [one.kind, one]));
  $("kinds").replaceChildren(...stage.kinds.map((one, i) => {
    const button = el("button", { type: "button" }, el("span", { t: one.label }));
    button.dataset.tool = one.kind;
    if (i < 4) {
      button.dataset.key = String(i + 5);
      button.append(el("kbd", { text: button.dataset.key, "aria-hidden": "true" }));
    }
    button.addEventListener("click", () => choose(one.kind));
    return button;
  }));
}

// Gauges of the same names are replaced: only when confirmed.
$("place").addEventListener("click", async () => {
  const names = Object.keys(state.gauges ?? {});
  if (names.length && !(await ask("Place the gauges anew?", "Gauges with the names extension, width and area are replaced. Undo brings them back.", "Place gauges"))) return;
  change({ do: "place" });
});

// -- the mouse ---------------------------------------------------------------------------------

svg.addEventListener("pointerdown", (event) => {
  pointers.add(event.pointerId);
  if (pointers.size > 1) { cancel(); return; }
  if (event.button !== 0 || !state.camera) return;
  const at = position(svg, event), handle = tool === "move" ? nearest(at) : tool in kinds && event.target.dataset?.handle?.split(" ");
  cross = null;
  if (handle) {
    const [name, index] = handle;
    drag = { name, index: Number(index), path: [at] };
    pending = state.gauges[name];
  } else {
    press(at);
  }
  if (drag) svg.setPointerCapture(event.pointerId);
  sketch();
});
for (const kind of ["pointerup", "pointercancel"]) addEventListener(kind, (event) => { pointers.delete(event.pointerId); });
svg.addEventListener("pointercancel", cancel);

// The handle for a finger, which has 44 px of the screen around it; undefined where there is none.
function nearest(at) {
  const all = Object.entries(state.gauges ?? {}).flatMap(([name, one]) => one.handles.map((p, index) => [name, index, Math.hypot(p[0] - at[0], p[1] - at[1]) * perPx()]));
  return all.filter((one) => one[2] <= REACH_PX).toSorted((a, b) => a[2] - b[2])[0];
}

function press(at) {
  if (tool === "move") return;
  hint(words());
  const isClick = tool === "polygon" || isClicked() || tool === "scale";
  drag = { path: [at], isClick };
  if (!isClick) points = [at];
}

svg.addEventListener("pointermove", (event) => {
  if (!drag || pointers.size > 1) return;
  const moves = event.getCoalescedEvents?.() ?? [];
  for (const one of moves.length ? moves : [event]) dragTo(position(svg, one));
  sketch();
});

function dragTo(at) {
  drag.path.push(at);
  if (drag.isClick) return;
  if (drag.name) {
    pending = { ...pending, handles: pending.handles.map((p, i) => (i === drag.index ? at : p)) };
  } else if (isDragged()) {
    points = [points[0], at];
  } else {
    points.push(at);
  }
}

svg.addEventListener("pointerup", (event) => { if (drag) release(position(svg, event), event.shiftKey); });

function release(at, add) {
  dragTo(at);
  const was = drag, path = isDragged() && !was.name ? [was.path[0], at] : was.path;
  drag = null;
  if (was.isClick) {
    if (!isLong(path)) points.push(was.path[0]);
    if (points.length && (isClicked() || (tool === "scale" && points.length === 2))) finish(false);
  } else if (!isLong(path) || (tool === "rectangle" && !was.name && isThin(path))) {
    points = [];
    pending = null;
    hint(HINTS.short);
  } else if (was.name) {
    change({ do: "gauge", name: was.name, points: pending.handles });
    state.gauges[was.name] = pending;
    pending = null;
  } else {
    finish(add);
  }
  sketch();
}

// On the screen, wherever the picture is zoomed to.
const perPx = () => svg.getScreenCTM().a;
const isLong = (path) => path.some((p) => Math.hypot(p[0] - path[0][0], p[1] - path[0][1]) * perPx() >= LEAST_PX);
const isThin = ([a, b]) => Math.min(Math.abs(b[0] - a[0]), Math.abs(b[1] - a[1])) * perPx() < LEAST_PX;
svg.addEventListener("dblclick", () => { if (tool === "polygon") { points.pop(); finish(false); } });

function finish(add) {
  const drawn = points;
  points = [];
  if (tool in kinds) newGauge(drawn);
  else if (tool === "scale") askLength(drawn);
  else if (tool !== "polygon" || (drawn.length > 2 && isLong(drawn))) change({ do: "draw", strokes: strokes(drawn, add) });
  sketch();
}

// A long path is sent in connected pieces.
function strokes(drawn, add) {
  const radius = Number($("radius").value), found = [];
  for (let i = 0; i < drawn.length; i += 4000) found.push({ tool, points: drawn.slice(Math.max(i - 1, 0), i + 4000), radius, add });
  return found;
}

const newGauge = (drawn) => change({ do: "gauge", kind: tool, points: drawn });

// Keys of other programs for Undo and Redo.
document.addEventListener("keydown", (event) => {
  const isTyped = event.target.closest?.("input:not([type=range]), select, textarea");
  if (!(event.ctrlKey || event.metaKey) || event.altKey || isTyped || document.body.dataset.stage !== "setup") return;
  const what = { z: event.shiftKey ? "redo" : "undo", y: "redo" }[event.key.toLowerCase()];
  if (!what) return;
  event.preventDefault();
  if (!event.repeat) change({ do: what });
});

// -- the scale ---------------------------------------------------------------------------------

let scaled = null, asking = false;
function askLength(drawn) {
  if (!isLong(drawn)) { hint(HINTS.short); return; }
  scaled = drawn;
  asking = false;
  const input = el("input", { "aria-label": t("Length in mm") }), label = el("label", {}, el("span", { t: "Length, mm" }), input);
  const length = numberField(input, { unit: "mm", isRequired: true });
  showForm([label], async () => {
    const mm = length.read();
    if (mm != null && !(await change({ do: "scale", points: scaled, mm })).refused) closeForm();
  });
}

// A form with Apply and Cancel; Escape cancels it.
function showForm(fields, apply) {
  const no = el("button", { type: "button", class: "button", t: "Cancel" });
  const form = el("form", {}, ...fields, el("button", { class: "button", t: "Apply" }), no);
  form.addEventListener("submit", (event) => { event.preventDefault(); apply(); });
  no.addEventListener("click", closeForm);
  onEscape(form, closeForm);
  $("scale").replaceChildren(form);
  form.querySelector("input").focus();
}

function closeForm() {
  scaled = null;
  asking = false;
  if ($("scale").contains(document.activeElement)) svg.focus({ preventScroll: true });
  showScale();
  sketch();
}

// A calibration board is found in the picture: only its dimensions are needed.
const BOARD = { columns: "Columns", rows: "Rows", square: "Square, mm", marker: "Marker, mm (none: checkerboard)" };
$("board").addEventListener("click", () => {
  asking = true;
  scaled = null;
  hint(HINTS.board);
  const numbers = {}, fields = Object.entries(BOARD).map(([name, words]) => {
    const isWhole = name === "columns" || name === "rows", input = el("input", { name }), label = labelled(input, words);
    numbers[name] = numberField(input, { unit: isWhole ? "" : "mm", isWhole, isRequired: name !== "marker" });
    return label;
  });
  const last = el("input", { name: "dictionary", type: "text", value: "4X4_50", maxLength: 39 });
  showForm([...fields, labelled(last, "Dictionary of the markers")], async () => {
    const read = Object.entries(numbers).map(([name, one]) => [name, one.read()]);
    if (read.some(([name, value]) => value == null && (name !== "marker" || fields[3].matches(".wrong")))) return;
    const request = { do: "board", dictionary: last.value, ...Object.fromEntries(read.map(([name, value]) => [name, value ?? 0])) };
    if (!(await change(request)).refused) closeForm();
  });
});

const labelled = (input, words) => el("label", {}, el("span", { t: words }), input);

function showScale() {
  if (scaled || asking) return;
  const s = state.scale;
  put($("scale"), s?.px_per_mm ? `${fixed(s.px_per_mm, 2)} px/mm${s.sigma ? ` ± ${fixed(100 * s.sigma * s.px_per_mm, 2)} %` : ""}${state.remarks.map((one) => ` · ${told(one)}`).join("")}` : "");
}

// -- display -----------------------------------------------------------------------------------

function sketch() {
  for (const old of svg.querySelectorAll(".sketch")) old.remove();
  const group = make("g", { class: "sketch" }), last = points.at(-1);
  if (pending) group.append(preview(kinds[pending.kind]?.gesture, pending.handles));
  if (scaled ?? (tool === "scale" && points.length > 1)) {
    const [a, b] = scaled ?? points;
    group.append(make("line", { class: "drawn", x1: a[0], y1: a[1], x2: b[0], y2: b[1] }));
  } else if (points.length && (tool === "brush" || tool === "eraser")) {
    group.append(make("polyline", { class: "stroke", points: points.join(" "), "stroke-width": 2 * $("radius").value }));
  } else if (points.length && (tool === "polygon" || tool === "scale")) {
    group.append(make("polygon", { class: "drawn", points: points.join(" ") }));
    for (const p of points) group.append(make("circle", { class: "drawn", cx: p[0], cy: p[1], r: 2 }));
  } else if (points.length > 1) {
    group.append(preview(kinds[tool]?.gesture ?? "box", [points[0], last]));
  }
  if (group.children.length) svg.append(group);
  showCross(svg, cross);
}

// The dragged shape, until the server sends its outline.
function preview(gesture, at) {
  if (gesture !== "box" || at.length !== 2) return make(at.length > 2 ? "polygon" : "polyline", { class: "drawn", points: at.join(" ") });
  const [[x0, y0], [x1, y1]] = at;
  return make("rect", { class: "drawn", x: Math.min(x0, x1), y: Math.min(y0, y1), width: Math.abs(x1 - x0), height: Math.abs(y1 - y0) });
}

// Handles the keys of the set-up; true where one was used.
export function setupKeys(event) {
  if (document.activeElement?.dataset?.handle ? moveHandle(event) : event.target === svg && moveCross(event)) {
    event.preventDefault();
    return true;
  }
  if (event.key === "Enter" && tool === "polygon" && points.length > 2) { finish(false); return true; }
  if (event.key === "Escape") { points = []; drag = pending = null; closeForm(); return true; }
  return false;
}

function moveHandle(event) {
  const [name, index] = document.activeElement.dataset.handle.split(" "), gauge = state.gauges[name];
  const at = moved(event, gauge.handles[index]);
  if (!at) return false;
  const handles = gauge.handles.map((p, i) => (i === Number(index) ? at : p));
  state.gauges[name] = { ...gauge, handles };
  change({ do: "gauge", name, points: handles });
  showGauges();
  return true;
}

function moveCross(event) {
  if (!state.camera) return false;
  const { width, height } = state.camera, at = cross ?? [width >> 1, height >> 1];
  const next = event.key === " " ? at : moved(event, at, width, height);
  if (!next) return false;
  cross = next;
  if (event.key !== " ") { if (drag) dragTo(cross); }
  else if (drag) release(cross, event.shiftKey);
  else if (tool !== "move") press(cross);
  sketch();
  return true;
}
svg.addEventListener("focus", () => { if (svg.matches(":focus-visible")) hint(HINTS.keys); });
svg.addEventListener("blur", () => { cross = null; hint(words()); sketch(); });

export function showDrawing(value) {
  const dragged = drag?.name ? state.gauges[drag.name] : null;
  state = value;
  for (const what of ["undo", "redo"]) for (const button of document.querySelectorAll(`[data-do=${what}]`)) button.disabled = !value.can?.includes(what);
  if (dragged) state.gauges[drag.name] = dragged;
  showGauges();
  showScale();
}

function showGauges() {
  if (state.camera && !pending) {
    const before = svg.dataset.mark;
    drawGauges(svg, { ...state.gauges, ...state.plates }, state.camera.width, state.camera.height, true);
    if (svg.dataset.mark !== before) sketch();
  }
}

choose("move");
