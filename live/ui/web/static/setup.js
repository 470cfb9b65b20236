// Set-up: light and focus, region and gauges with the mouse, scale, the check, the rig file.
import { $, change, put } from "./base.js";
import { drawGauges, make, position } from "./draw.js";
import { t } from "./words.js";

const svg = $("drawing");
let state = {}, tool = "rectangle", points = [], busy = false, shownPicture = -1, edition = -1, drag = null, pending = null;

const HINTS = {
  rectangle: "Drag a rectangle over the specimen; with Shift it is added.",
  polygon: "Click the corners; Enter or a double click closes it, Escape discards it.",
  brush: "Paint what is measured.",
  eraser: "Paint what is not measured.",
  move: "Drag the handles; with the keyboard Tab and the arrows.",
  scale: "Click two points whose distance is known.",
  board: "Hold the board where the specimen will be. Of a checkerboard count the inner corners, of a ChArUco board the squares.",
};
let kinds = {};  // of gauges, from the server
const isDragged = () => tool === "rectangle" || ["line", "box"].includes(kinds[tool]?.gesture);
const isClicked = () => kinds[tool]?.gesture === "click";

function choose(name) {
  tool = name;
  points = [];
  drag = null;
  for (const button of document.querySelectorAll("[data-tool]")) button.setAttribute("aria-pressed", String(button.dataset.tool === name));
  $("hint").dataset.t = HINTS[name] ?? kinds[name].hint;
  put($("hint"), t($("hint").dataset.t));
  svg.style.cursor = name === "move" ? "default" : "crosshair";
  sketch();
}
for (const button of document.querySelectorAll("[data-tool]")) button.addEventListener("click", () => choose(button.dataset.tool));

// A button for each kind of gauge; the first ones have the keys 5 to 8.
showSetup.begin = (stage) => {
  kinds = Object.fromEntries(stage.kinds.map((one) => [one.kind, one]));
  $("kinds").replaceChildren(...stage.kinds.map((one, i) => {
    const button = document.createElement("button"), name = document.createElement("span"), key = document.createElement("kbd");
    button.type = "button";
    button.dataset.tool = one.kind;
    name.dataset.t = one.label;
    name.textContent = t(one.label);
    button.append(name);
    if (i < 4) {
      button.dataset.key = key.textContent = String(i + 5);
      button.append(key);
    }
    button.addEventListener("click", () => choose(one.kind));
    return button;
  }));
};

// -- the mouse ---------------------------------------------------------------------------------

svg.addEventListener("pointerdown", (event) => {
  if (event.button !== 0 || !state.camera) return;
  const at = position(svg, event), handle = event.target.dataset?.handle;
  if (handle && (tool === "move" || tool in kinds)) {
    const [name, index] = handle.split(" ");
    drag = { name, index: Number(index) };
    pending = state.gauges[name];
  } else if (tool === "polygon" || isClicked() || tool === "scale") {
    points.push(at);
    if (isClicked() || (tool === "scale" && points.length === 2)) finish(false);
  } else if (tool !== "move") {
    points = [at];
    drag = { tool };
  }
  if (drag) svg.setPointerCapture(event.pointerId);
  sketch();
});

svg.addEventListener("pointermove", (event) => {
  if (!drag) return;
  const moves = event.getCoalescedEvents?.() ?? [];
  for (const one of moves.length ? moves : [event]) dragTo(position(svg, one));
  sketch();
});

function dragTo(at) {
  if (drag.name) {
    pending = { ...pending, handles: pending.handles.map((p, i) => (i === drag.index ? at : p)) };
  } else if (isDragged()) {
    points = [points[0], at];
  } else {
    points.push(at);
  }
}

svg.addEventListener("pointerup", (event) => {
  if (!drag) return;
  dragTo(position(svg, event));
  const was = drag;
  drag = null;
  if (was.name) {
    change({ do: "gauge", name: was.name, points: pending.handles });
    state.gauges[was.name] = pending;
    pending = null;
  } else {
    finish(event.shiftKey);
  }
  sketch();
});
svg.addEventListener("dblclick", () => { if (tool === "polygon") { points.pop(); finish(false); } });

function finish(add) {
  const drawn = points;
  points = [];
  if (tool in kinds) newGauge(drawn);
  else if (tool === "scale") askLength(drawn);
  else if (tool !== "polygon" || drawn.length > 2) change({ do: "draw", strokes: strokes(drawn, add) });
  sketch();
}

// A long path is sent in connected pieces.
function strokes(drawn, add) {
  const radius = Number($("radius").value), found = [];
  for (let i = 0; i < drawn.length; i += 4000) found.push({ tool, points: drawn.slice(Math.max(i - 1, 0), i + 4000), radius, add });
  return found;
}

function newGauge(drawn) {
  if (!isClicked() && (drawn.length < 2 || Math.hypot(drawn[1][0] - drawn[0][0], drawn[1][1] - drawn[0][1]) < 3)) return;
  change({ do: "gauge", kind: tool, points: drawn });
}

let scaled = null;
function askLength(drawn) {
  if (drawn.length < 2 || Math.hypot(drawn[1][0] - drawn[0][0], drawn[1][1] - drawn[0][1]) < 3) return;
  scaled = drawn;
  asking = false;
  const form = document.createElement("form"), input = document.createElement("input"), button = document.createElement("button");
  Object.assign(input, { type: "number", min: "0", step: "any", required: true, placeholder: "mm" });
  input.setAttribute("aria-label", t("Length in mm"));
  button.textContent = t("Apply");
  form.append(input, button);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    await change({ do: "scale", points: scaled, mm: Number(input.value) });
    scaled = null;
    sketch();
    showScale();
  });
  $("scale").replaceChildren(form);
  input.focus();
}

// A calibration board is found in the picture: only its dimensions are needed.
const BOARD = { columns: "Columns", rows: "Rows", square: "Square, mm", marker: "Marker, mm (none: checkerboard)" };
let asking = false;
$("board").addEventListener("click", () => {
  asking = true;
  scaled = null;
  $("hint").dataset.t = HINTS.board;
  put($("hint"), t(HINTS.board));
  const form = document.createElement("form"), button = document.createElement("button"), last = document.createElement("input");
  const inputs = Object.entries(BOARD).map(([key, words]) => {
    const input = document.createElement("input"), whole = key === "columns" || key === "rows";
    Object.assign(input, { name: key, type: "number", min: whole ? "3" : "0", step: whole ? "1" : "any", required: key !== "marker" });
    return labelled(input, t(words));
  });
  Object.assign(last, { name: "dictionary", type: "text", value: "4X4_50", maxLength: 39 });
  button.textContent = t("Apply");
  form.append(...inputs, labelled(last, t("Dictionary of the markers")), button);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const request = { do: "board", dictionary: last.value };
    for (const key of Object.keys(BOARD)) request[key] = form.elements[key].value === "" ? 0 : Number(form.elements[key].value);
    if (await change(request) !== "ok") return;
    asking = false;
    showScale();
  });
  $("scale").replaceChildren(form);
  inputs[0].querySelector("input").focus();
});

function labelled(input, words) {
  const label = document.createElement("label"), name = document.createElement("span");
  name.textContent = words;
  label.append(name, input);
  return label;
}

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
}

// The dragged shape, until the server sends its outline.
function preview(gesture, at) {
  if (gesture !== "box" || at.length !== 2) return make(at.length > 2 ? "polygon" : "polyline", { class: "drawn", points: at.join(" ") });
  const [[x0, y0], [x1, y1]] = at;
  return make("rect", { class: "drawn", x: Math.min(x0, x1), y: Math.min(y0, y1), width: Math.abs(x1 - x0), height: Math.abs(y1 - y0) });
}

// Handles the keys of the set-up; true where one was used.
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
export function setupKeys(event) {
  const handle = document.activeElement?.dataset?.handle, arrow = ARROWS[event.key];
  if (handle && arrow) {
    const [name, index] = handle.split(" "), step = event.shiftKey ? 10 : 1, gauge = state.gauges[name];
    const handles = gauge.handles.map((p, i) => (i === Number(index) ? p.map((v, k) => v + step * arrow[k]) : p));
    state.gauges[name] = { ...gauge, handles };
    change({ do: "gauge", name, points: handles });
    showGauges();
    event.preventDefault();
    return true;
  }
  if (event.key === "Enter" && tool === "polygon" && points.length > 2) { finish(false); return true; }
  if (event.key === "Escape") { points = []; drag = pending = scaled = null; asking = false; showScale(); sketch(); return true; }
  return false;
}

// -- display -----------------------------------------------------------------------------------

const percent = (value) => (value == null ? "–" : value > 0 && value < 1e-4 ? "<0.01 %" : `${(value * 100).toFixed(2)} %`);

export function showSetup(value) {
  const dragged = drag?.name ? state.gauges[drag.name] : null;
  state = value;
  if (dragged) state.gauges[drag.name] = dragged;
  put($("trouble"), value.trouble || value.doubt);
  put($("busy"), value.busy);
  put($("sharpness"), value.sharpness == null ? "–" : value.sharpness.toFixed(3));
  put($("saturated"), percent(value.saturated));
  put($("sigma"), value.sigma == null ? "–" : `${(value.sigma * 1e6).toFixed(0)} µm/m`);
  $("sharp").value = value.peak ? (value.sharpness ?? 0) / value.peak : 0;
  const c = value.camera;
  put($("camera"), c ? `${c.name}, ${c.width} × ${c.height} px, ${c.bits} bit${c.fps ? `, ${c.fps} fps` : ""}` : "");
  put($("region"), value.region ? `${value.region.words}${value.zois == null ? "" : ` · ${value.zois} ZOIs`}` : "");
  put($("file"), `${value.file}${value.unsaved.length ? ` · ${t("not saved")}` : ` · ${t("saved")}`}`);
  showPicture(value);
  showGauges();
  listGauges(value.gauges);
  showSliders(c?.sliders ?? []);
  showFields(value);
  for (const box of document.querySelectorAll("[data-overlay]")) if (box !== document.activeElement) box.checked = value.overlays[box.dataset.overlay];
  showCheck(value);
  showScale();
}

function showPicture(value) {
  if (value.picture && value.picture !== shownPicture && !busy) {
    busy = true;
    shownPicture = value.picture;
    const image = $("live");
    image.onload = image.onerror = () => { busy = false; };
    image.src = `/picture?setup=${value.picture}`;
  }
  if (value.region && value.region.edition !== edition) {
    edition = value.region.edition;
    $("mask").src = `/mask?edition=${edition}-${Date.now()}`;
  }
}

function showGauges() {
  if (state.camera && !pending) {
    const before = svg.dataset.mark;
    drawGauges(svg, state.gauges, state.camera.width, state.camera.height, true);
    if (svg.dataset.mark !== before) sketch();
  }
}

function listGauges(gauges) {
  const list = $("gauges"), names = Object.keys(gauges);
  if (list.contains(document.activeElement) || list.dataset.names === names.join()) return;
  list.dataset.names = names.join();
  list.replaceChildren(...names.map((name) => {
    const item = document.createElement("li"), input = document.createElement("input"), remove = document.createElement("button");
    input.value = name;
    input.maxLength = 32;
    input.setAttribute("aria-label", t("Name"));
    input.addEventListener("change", async () => {
      const answer = await change({ do: "gauge", name: input.value, was: name });
      if (!answer.startsWith("ok")) input.value = name;
      input.blur();
      list.dataset.names = "";
    });
    remove.type = "button";
    remove.textContent = "×";
    remove.setAttribute("aria-label", `${t("Remove")} ${name}`);
    remove.addEventListener("click", () => { remove.blur(); change({ do: "gauge", name, gauge: null }); });
    item.append(input, remove);
    return item;
  }));
}

const LABELS = { exposure_us: "Exposure, µs", gain: "Gain", brightness: "Brightness" };
function showSliders(settings) {
  const box = $("sliders");
  if (box.dataset.keys !== settings.map((one) => one.key).join()) {
    box.dataset.keys = settings.map((one) => one.key).join();
    box.replaceChildren(...settings.map((one) => {
      const label = document.createElement("label"), name = document.createElement("span"), input = document.createElement("input"), value = document.createElement("output");
      name.dataset.t = LABELS[one.key] ?? one.key;
      name.textContent = t(name.dataset.t);
      Object.assign(input, { type: "range", min: 0, max: 1000, step: 1 });
      input.dataset.key = one.key;
      input.addEventListener("change", () => change({ do: "camera", key: one.key, value: sliderValue(input, input.value) }));
      input.addEventListener("input", () => put(value, number(sliderValue(input, input.value))));
      label.append(name, input, value);
      return label;
    }));
  }
  settings.forEach((one, i) => {
    const [, input, value] = box.children[i].children;
    Object.assign(input.dataset, { low: one.low, high: one.high, log: one.log, step: one.step });
    if (input === document.activeElement && input.matches(":active")) return;
    const share = one.log ? Math.log(one.value / one.low) / Math.log(one.high / one.low) : (one.value - one.low) / (one.high - one.low);
    input.value = Math.round(1000 * share);
    put(value, number(one.value));
  });
}

function sliderValue(input, ticks) {
  const low = Number(input.dataset.low), high = Number(input.dataset.high), share = ticks / 1000;
  const value = input.dataset.log === "true" ? low * (high / low) ** share : low + share * (high - low), step = Number(input.dataset.step);
  return step ? low + Math.min(Math.round((value - low) / step), Math.floor((high - low) / step)) * step : Number(value.toPrecision(3));
}
const number = (value) => (value >= 100 ? value.toFixed(0) : value.toPrecision(3));

for (const input of document.querySelectorAll("[data-set]")) {
  const ranged = input.type === "range", numeric = ranged || input.type === "number";
  if (ranged) input.addEventListener("input", () => put(input.nextElementSibling, input.value));
  input.addEventListener("change", () => change({ do: "set", key: input.dataset.set, value: numeric && input.value !== "" ? Number(input.value) : input.value }));
}

function showFields(value) {
  for (const input of document.querySelectorAll("[data-set]")) {
    if (input === document.activeElement) continue;
    const [section, key] = input.dataset.set.split("."), now = value[section][key] ?? "";
    if (input.value !== String(now)) input.value = now;
    if (input.type === "range") put(input.nextElementSibling, String(now));
  }
}

for (const box of document.querySelectorAll("[data-overlay]")) {
  box.addEventListener("change", () => { change({ do: "overlay", name: box.dataset.overlay, on: box.checked }); box.blur(); });
}

let shownCheck = "";
function showCheck(value) {
  const verdict = $("verdict");
  put(verdict, value.checking ? t("checking …") : value.go == null ? "" : value.go ? "GO" : "NO-GO");
  verdict.className = value.go == null ? "" : value.go ? "go" : "nogo";
  const mark = JSON.stringify([value.lines, value.table, value.measure, value.scale, document.documentElement.lang]);
  if (mark === shownCheck) return;
  shownCheck = mark;
  const sorted = [...value.lines].sort((a, b) => a.good - b.good);
  $("lines").replaceChildren(...sorted.map((one) => {
    const item = document.createElement("li"), what = document.createElement("b"), words = document.createElement("span"), advice = document.createElement("em");
    what.textContent = one.what;
    words.textContent = ` ${one.value}`;
    advice.textContent = one.good ? "" : one.advice;
    item.className = one.good ? "" : "look";
    item.append(what, words, advice);
    return item;
  }));
  showTable(value);
}

function showTable({ table: known, measure, scale }) {
  const mm = scale?.px_per_mm;
  const rows = [];
  const row = (tag, cells) => { const line = document.createElement("tr"); for (const [text, here] of cells) { const cell = document.createElement(tag); cell.textContent = text; cell.className = here ? "here" : ""; line.append(cell); } rows.push(line); };
  if (known) {
    row("th", [["ZOI"], [`VSG ${mm ? "mm" : "px"}`], ...known.bursts.map((n) => [n])]);
    for (const one of known.rows) row("td", [[one.zoi], [mm ? (one.vsg / mm).toFixed(2) : one.vsg.toFixed(0)], ...one.noise.map((v, i) => [v == null ? "–" : (v * 1e6).toFixed(0), one.zoi === measure.zoi && known.bursts[i] === measure.burst])]);
    const caption = document.createElement("caption");
    caption.textContent = t("strain noise of one ZOI, µm/m, by frames of a burst");
    rows.unshift(caption);
  }
  $("table").replaceChildren(...rows);
}

function showScale() {
  if (scaled || asking) return;
  const s = state.scale;
  put($("scale"), s?.px_per_mm ? `${s.px_per_mm.toFixed(2)} px/mm${s.sigma ? ` ± ${(100 * s.sigma * s.px_per_mm).toFixed(2)} %` : ""}${state.remarks.map((one) => ` · ${one}`).join("")}` : "");
}

choose("rectangle");
