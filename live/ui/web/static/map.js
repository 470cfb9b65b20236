// The map over the picture of a running test: its colours with a histogram, its range, the value under the pointer.
import { $, el, fill, post, put } from "./base.js";
import { drawGauges, make, moved, position, showCross, zoomable } from "./draw.js";
import { numberField } from "./fields.js";
import { fixed, short, strainText, strainUnit } from "./numbers.js";
import { t } from "./words.js";

const READ_MS = 150;
const svg = $("gaugemap");
let loading = false, shownPicture = "", picture = null, side = "", reading = 0, cross = null;
const reset = zoomable(svg.parentElement, () => cross);
svg.addEventListener("dblclick", reset);

export function beginMap(stage) {
  shownPicture = side = "";
  loading = false;
  reset();
  if (!$("component").children.length) {
    for (const name of stage.components) $("component").append(el("option", { value: name, t: name }));
  }
  load("1");
}

let choosing = false; // "fixed" is chosen and waits for its limit: the range of the program does not take its place

const limit = numberField($("limit"), { unit: () => strainUnit().name, onvalue: choose });
for (const id of ["component", "range"]) $(id).addEventListener("change", () => choose(limit.read()));

function choose(value) {
  showLimit();
  choosing = $("range").value === "fixed" && !(value > 0);
  if (choosing) { $("limit").focus(); return null; }
  return post("/map", { of: $("component").value, range: $("range").value, limit: value / strainUnit().factor });
}
const showLimit = () => { $("limit").parentElement.hidden = $("range").value !== "fixed"; };

const factor = () => (picture?.strain ? strainUnit().factor : 1);

// The next picture is requested when the last has arrived: a slow page gets fewer pictures, never old ones.
function load(n) {
  loading = true;
  const image = $("map");
  image.onload = image.onerror = () => { loading = false; };
  image.src = `/picture?side=${side}&run=${n}`;
}

export function showMap(value, of) {
  const name = `${of} ${value.n}`, mark = name !== `${side} ${picture?.n}`;
  side = of;
  if (name !== shownPicture && !loading) { shownPicture = name; load(value.n); }
  picture = value;
  if (mark) showLegend();
  if (!value.width) return;
  drawGauges(svg, value.gauges, value.width, value.height);
  if (cross) { showCross(svg, cross); read(...cross); }
}
addEventListener("unit", () => { if (picture) showLegend(); });

function showLegend() {
  for (const [id, now] of [["component", picture.of], ["range", choosing ? "fixed" : picture.range]]) if ($(id) !== document.activeElement) $(id).value = now;
  showLimit();
  const zero = picture.diverging ? "linear-gradient(#12171d, #12171d) center / 2px 100% no-repeat, " : "";
  $("ramp").style.background = `${zero}linear-gradient(to right, ${(picture.ramp ?? ["transparent", "transparent"]).join(", ")})`;
  const scaled = picture.high != null, unit = picture.strain ? strainUnit().name : (picture.unit ?? "");
  if (scaled && picture.range === "fixed" && picture.strain) limit.show(Number((picture.high * factor()).toPrecision(6)));
  $("ramp").closest(".legend").classList.toggle("status", Boolean(picture.legend));
  fill($("statuses"), picture.legend ?? [], (one) => {
    const key = el("i", { class: "key" });
    key.style.background = one.colour;
    return el("li", {}, key, `${one.count} ${t(one.text)}`);
  });
  const at = (share) => (scaled ? `${short((picture.low + share * (picture.high - picture.low)) * factor())}` : "");
  put($("low"), at(0));
  put($("middle"), at(0.5));
  put($("high"), scaled ? `${at(1)} ${unit}` : "");
  const bars = picture.histogram ?? [], most = Math.max(...bars, 1);
  $("histogram").replaceChildren(...bars.map((n, k) => make("rect", { x: k, y: 1 - n / most, width: 1, height: n / most })));
}

// The value under the pointer, or at the cross that the arrow keys move.
async function read(x, y) {
  const now = performance.now();
  if (!picture?.width || now - reading < READ_MS) return;
  reading = now;
  const response = await fetch(`/value?side=${side}&x=${x.toFixed(1)}&y=${y.toFixed(1)}`);
  if (!response.ok) return;
  const found = await response.json(), place = `x ${x.toFixed(0)}, y ${y.toFixed(0)} px`;
  put($("readout"), found.value == null ? `${place}: ${t(found.status)}` : `${place}: ${picture.strain ? strainText(found.value, found.sigma) : `${fixed(found.value, 4)} ${picture.unit ?? ""}`}`);
}
svg.addEventListener("pointermove", (event) => read(...position(svg, event)));
svg.addEventListener("pointerleave", () => put($("readout"), ""));
svg.addEventListener("keydown", (event) => {
  const { width, height } = picture ?? {}, next = width && moved(event, cross ?? [width >> 1, height >> 1], width, height);
  if (!next) return;
  event.preventDefault();
  cross = next;
  showCross(svg, cross);
  read(...cross);
});
svg.addEventListener("blur", () => { cross = null; showCross(svg, null); put($("readout"), ""); });
