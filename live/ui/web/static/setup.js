// Set-up: the live picture and its figures, the fields of the rig, the list of gauges.
import { $, change, el, fill, put } from "./base.js";
import { beginDrawing, forgetDrawing, showDrawing } from "./drawing.js";
import { showCheck, showStart } from "./check.js";
import { showDevices } from "./devices.js";
import { numberField, onEscape } from "./fields.js";
import { colourOf, fixed, percent, short, strainText } from "./numbers.js";
import { all, beginViews, received } from "./views.js";
import { t } from "./words.js";

let busy = false, shownPicture = -1, edition = -1;

// -- the panels at the right --------------------------------------------------------------------

const tabs = [...document.querySelectorAll("[role=tab]")];
export function showPanel(tab) {
  for (const one of tabs) {
    const here = one === tab;
    one.setAttribute("aria-selected", String(here));
    one.tabIndex = here ? 0 : -1;
    $(one.getAttribute("aria-controls")).hidden = !here;
  }
}
for (const [k, tab] of tabs.entries()) {
  tab.addEventListener("click", () => showPanel(tab));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    const next = tabs[(k + step + tabs.length) % tabs.length];
    showPanel(next);
    next.focus();
  });
}
showPanel($("tab-picture"));
document.querySelector("[data-do=check]").addEventListener("click", () => showPanel($("tab-check")));

export function beginSetup(stage) {
  busy = false;
  shownPicture = edition = -1;
  beginDrawing(stage);
  beginViews("setup", (value) => { busy = false; shownPicture = edition = -1; forgetDrawing(); showSetup(value); });
}

export function showSetup(state, isSecond) {
  const value = received("setup", state, isSecond), both = all("setup");
  showStart(both.length ? both : [state]);
  if (!value) return;
  put($("trouble"), t(value.trouble || value.doubt));
  put($("busy"), t(value.busy));
  put($("sharpness"), fixed(value.sharpness, 3));
  put($("saturated"), percent(value.saturated));
  put($("sigma"), value.sigma == null ? "–" : strainText(value.sigma).replace("+", ""));
  $("sharp").value = value.peak ? (value.sharpness ?? 0) / value.peak : 0;
  const c = value.camera;
  put($("camera"), c ? `${t(c.name)}, ${c.width} × ${c.height} px, ${c.bits} ${t("bits")}${c.fps ? `, ${short(c.fps)} 1/s` : ""}` : "");
  put($("region"), value.region ? `${t(value.region.words)}${value.zois == null ? "" : ` · ${value.zois} ${t("ZOIs")}`}` : "");
  put($("file"), `${value.file} · ${t(value.unsaved.length ? "not saved" : "saved")}`);
  showPicture(value);
  showDrawing(value);
  listGauges(value.gauges);
  showSliders(c?.sliders ?? []);
  showFields(value);
  for (const box of document.querySelectorAll("[data-overlay]")) if (box !== document.activeElement) box.checked = value.overlays[box.dataset.overlay];
  showDevices(value);
  showCheck(value);
}

function showPicture(value) {
  if (value.picture && value.picture !== shownPicture && !busy) {
    busy = true;
    shownPicture = value.picture;
    const image = $("live");
    image.onload = image.onerror = () => { busy = false; };
    image.src = `/picture?side=${value.side}&setup=${value.picture}`;
  }
  if (value.region && value.region.edition !== edition) {
    edition = value.region.edition;
    $("mask").src = `/mask?side=${value.side}&edition=${edition}-${Date.now()}`;
  }
}

function listGauges(gauges) {
  const list = $("gauges");
  if (list.contains(document.activeElement) && document.activeElement !== list) return;
  fill(list, Object.entries(gauges).map(([name, { colour }]) => [name, colour]), ([name], k) => {
    const input = el("input", { value: name, maxLength: 32, "aria-label": t("Name") });
    const remove = el("button", { type: "button", text: "×", "aria-label": `${t("Remove")} ${name}` });
    const key = el("i", { class: "key" });
    key.style.background = colourOf(gauges[name].colour ?? k);
    onEscape(input, () => { input.value = name; input.blur(); });
    input.addEventListener("change", async () => {
      const { refused } = await change({ do: "gauge", name: input.value, was: name });
      if (refused) input.value = name;
      input.blur();
      list.dataset.mark = "";
    });
    remove.addEventListener("click", () => { remove.blur(); change({ do: "gauge", name, gauge: null }); });
    return el("li", {}, key, input, remove);
  });
}

// -- sliders and fields ---------------------------------------------------------------------------

const LABELS = { exposure_us: "Exposure, µs", gain: "Gain", brightness: "Brightness" };
function showSliders(settings) {
  const box = $("sliders");
  fill(box, settings.map((one) => one.key), (key) => {
    const input = el("input", { type: "range", min: 0, max: 1000, step: 1 }), value = el("output");
    input.dataset.key = key;
    input.addEventListener("change", () => change({ do: "camera", key, value: sliderValue(input) }));
    input.addEventListener("input", () => put(value, number(sliderValue(input))));
    return el("label", {}, el("span", key in LABELS ? { t: LABELS[key] } : { text: key }), input, value);
  });
  settings.forEach((one, i) => {
    const [, input, value] = box.children[i].children;
    Object.assign(input.dataset, { low: one.low, high: one.high, log: one.log, step: one.step });
    if (input === document.activeElement && input.matches(":active")) return;
    const share = one.log ? Math.log(one.value / one.low) / Math.log(one.high / one.low) : (one.value - one.low) / (one.high - one.low);
    input.value = Math.round(1000 * share);
    put(value, number(one.value));
  });
}

function sliderValue(input) {
  const low = Number(input.dataset.low), high = Number(input.dataset.high), share = input.value / 1000;
  const value = input.dataset.log === "true" ? low * (high / low) ** share : low + share * (high - low), step = Number(input.dataset.step);
  return step ? low + Math.min(Math.round((value - low) / step), Math.floor((high - low) / step)) * step : Number(value.toPrecision(3));
}
const number = (value) => (value >= 100 ? value.toFixed(0) : value.toPrecision(3));

const numbers = new Map();
for (const input of document.querySelectorAll("[data-set]")) {
  const isRange = input.type === "range", send = (value) => change({ do: "set", key: input.dataset.set, value });
  if (input.dataset.number) {
    numbers.set(input, numberField(input, { unit: input.dataset.number, onvalue: (value) => send(value ?? "") }));
    continue;
  }
  if (!isRange && input.type === "text") onEscape(input, () => { input.value = input.dataset.kept ?? ""; input.blur(); });
  if (isRange) input.addEventListener("input", () => put(input.nextElementSibling, input.value));
  input.addEventListener("change", () => send(isRange ? Number(input.value) : input.value));
}

function showFields(value) {
  const area = value.specimen.area_mm2;
  put($("section"), area ? `${t("Section")} ${fixed(area, 2)} mm²` : t("no section: forces, no stresses"));
  for (const input of document.querySelectorAll("[data-set]")) {
    const [section, key] = input.dataset.set.split("."), now = value[section][key] ?? "";
    numbers.get(input)?.show(value[section][key]);
    input.dataset.kept = now;
    if (input === document.activeElement || numbers.has(input)) continue;
    if (input.value !== String(now)) input.value = now;
    if (input.type === "range") put(input.nextElementSibling, String(now));
  }
}

for (const box of document.querySelectorAll("[data-overlay]")) {
  box.addEventListener("change", () => { change({ do: "overlay", name: box.dataset.overlay, on: box.checked }); box.blur(); });
}
