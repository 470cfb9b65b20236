// The picture of a running test with its map over it: opacity, colours, range, the value under the pointer.
import { $, el, fill, post, put } from "./base.js";
import { drawGauges, moved, position, showCross, zoomable } from "./draw.js";
import { numberField } from "./fields.js";
import { factorOf, setRatio, showLegend, unitOf } from "./legend.js";
import { fixed, strainText, strainUnit, withSigma } from "./numbers.js";
import { t } from "./words.js";

const READ_MS = 150, OPACITY = 74;
const svg = $("gaugemap"), shot = svg.closest(".shot");
let loading = 0, shownPicture = "", picture = null, side = "", reading = 0, cross = null, pointed = null;
const reset = zoomable(svg.parentElement, () => cross);
svg.addEventListener("dblclick", reset);

export function beginMap(stage) {
  shownPicture = side = "";
  loading = 0;
  picture = pointed = null;
  reset();
  put($("readout"), "");
  fill($("component"), stage.components, (name) => el("option", { value: name, t: name }));
  load({ n: 1 });
}

// Of the map only; at 0 the picture. The choice stays with the browser.
function showOpacity() {
  $("opacity").value = localStorage.getItem("opacity") ?? OPACITY;
  $("map").style.opacity = String($("opacity").value / 100);
}
$("opacity").addEventListener("input", () => { localStorage.setItem("opacity", $("opacity").value); showOpacity(); });
showOpacity();

let choosing = false; // "fixed" is chosen and waits for its limit: the range of the program does not take its place

const limit = numberField($("limit"), { unit: () => strainUnit().name, onvalue: choose });
for (const id of ["component", "range"]) $(id).addEventListener("change", () => choose(limit.read()));

function choose(value) {
  showLimit();
  choosing = $("range").value === "fixed" && !(value > 0);
  if (choosing) { $("limit").focus(); return null; }
  return post("/map", { of: $("component").value, range: $("range").value, limit: value / strainUnit().factor });
}
const showLimit = () => { $("limit").closest(".field").hidden = $("range").value !== "fixed"; };

// The next picture is requested when the last has arrived: a slow page gets fewer pictures, never old ones.
function load({ n, cells, width, height }) {
  for (const [id, layer] of [["shot", "picture"], ["map", "map"]]) {
    const image = $(id);
    loading += 1;
    image.onload = image.onerror = () => { loading -= 1; if (layer === "map" && cells) place(image, cells, width, height); };
    image.src = `/picture?side=${side}&run=${n}&layer=${layer}`;
  }
}

// A pixel of the map is a point: it lies over its cells of the picture.
function place(image, [x, y, across, down], width, height) {
  const shares = { left: x / width, top: y / height, width: across / width, height: down / height };
  for (const [name, share] of Object.entries(shares)) image.style.setProperty(name, `${100 * share}%`);
}

export function showMap(value, of) {
  const name = `${of} ${value.n}`, isNew = name !== `${side} ${picture?.n}`;
  side = of;
  if (name !== shownPicture && loading <= 0) { shownPicture = name; load(value); }
  picture = value;
  if (isNew) showChoice();
  if (!value.width) return;
  setRatio(shot, value.width, value.height);
  drawGauges(svg, value.gauges, value.width, value.height);
  if (cross) showCross(svg, cross);
  if (isNew && (cross ?? pointed)) read(...(cross ?? pointed));
}
for (const kind of ["unit", "language"]) addEventListener(kind, () => { if (picture) showChoice(); });

function showChoice() {
  for (const [id, now] of [["component", picture.of], ["range", choosing ? "fixed" : picture.range]]) if ($(id) !== document.activeElement) $(id).value = now;
  showLimit();
  if (picture.high != null && picture.range === "fixed" && picture.strain) limit.show(Number((picture.high * factorOf(picture)).toPrecision(6)));
  put($("limitunit"), strainUnit().name);
  showLegend($("maplegend"), picture);
}

// The value under the pointer, or at the cross that the arrow keys move; read again with each picture.
async function read(x, y) {
  const now = performance.now();
  if (!picture?.width || now - reading < READ_MS) return;
  reading = now;
  let found;
  try {
    const response = await fetch(`/value?side=${side}&x=${x.toFixed(1)}&y=${y.toFixed(1)}`);
    if (!response.ok) return;
    found = await response.json();
  } catch { return; } // no link: the page says so
  if (!cross && !pointed) return;
  const place = `x ${fixed(x)}, y ${fixed(y)} px`;
  put($("readout"), found.value == null ? `${place}: ${t(found.status)}` : `${place}: ${picture.strain ? strainText(found.value, found.sigma) : `${withSigma(found.value, found.sigma, { factor: 1, digits: 4 }).filter(Boolean).join(" ± ")} ${unitOf(picture)}`}`);
}
for (const kind of ["pointerdown", "pointermove"]) svg.addEventListener(kind, (event) => { pointed = position(svg, event); read(...pointed); });
svg.addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") { pointed = null; put($("readout"), ""); } }); // a touch stays read
svg.addEventListener("keydown", (event) => {
  const { width, height } = picture ?? {}, next = width && moved(event, cross ?? [width >> 1, height >> 1], width, height);
  if (!next) return;
  event.preventDefault();
  cross = next;
  showCross(svg, cross);
  read(...cross);
});
svg.addEventListener("blur", () => { cross = null; showCross(svg, null); put($("readout"), ""); });
