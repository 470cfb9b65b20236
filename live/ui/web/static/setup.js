// Set-up: four steps, the live picture and its figures, the fields of the rig, the list of gauges.
import { $, change, el, fill, put } from "./base.js";
import { beginDrawing, forgetDrawing, showDrawing } from "./drawing.js";
import { showCheck, showStart } from "./check.js";
import { showDevices } from "./devices.js";
import { numberField, onEscape } from "./fields.js";
import { icon, key, putIcon } from "./icons.js";
import { setRatio } from "./legend.js";
import { fixed, percent, short, strainText, strainUnit } from "./numbers.js";
import { all, beginViews, received } from "./views.js";
import { t, told } from "./words.js";

let busy = false, shownPicture = -1, edition = -1;

// -- the steps: one is open ------------------------------------------------------------------------

const steps = [...document.querySelectorAll(".step")];
// By its number, or the one that holds an element; the tools of the picture belong to the gauges.
export function openStep(which) {
  const step = typeof which === "number" ? steps[which] : which.closest(".draw") ? $("step-gauges") : which.closest(".step");
  if (!step) return;
  for (const one of steps) one.open = one === step;
  $("setup").dataset.step = step.id.replace("step-", "");
  if (step.id === "step-camera" && !$("cameras").dataset.asked) { $("cameras").dataset.asked = "1"; change({ do: "devices" }); }
}
for (const step of steps) {
  step.querySelector("summary").addEventListener("click", (event) => { event.preventDefault(); openStep(step); });
}
document.querySelector("[data-do=check]").addEventListener("click", () => openStep($("step-check")));

// Ready, to be looked at, or to be done, with a word and a shape.
const CHIPS = { good: "check", look: "warn", open: "info" }, LABELS = { good: "ready", look: "look", open: "to do" };
function showStep(name, kind) {
  const step = $(`step-${name}`), chip = step.querySelector("summary > .chip");
  step.classList.toggle("done", kind === "good");
  step.classList.toggle("look", kind === "look");
  chip.className = `chip ${kind}`;
  if (!chip.children.length) chip.append(el("span"), el("span"));
  putIcon(chip.firstChild, CHIPS[kind]);
  put(chip.lastChild, t(LABELS[kind]));
}

export function sectionOf(s) {
  const isArea = (mm2) => Math.abs(mm2 / s.area_mm2 - 1) < 1e-6; // the file may give several
  if (isArea(s.width_mm * s.thickness_mm)) return `${short(s.width_mm)} × ${short(s.thickness_mm)} mm`;
  if (isArea((Math.PI / 4) * s.diameter_mm ** 2)) return `⌀ ${short(s.diameter_mm)} mm`;
  return s.area_mm2 ? `${short(s.area_mm2)} mm²` : "";
}

function showSteps(value) {
  if (!steps.some((one) => one.open) && (value.camera || value.trouble)) openStep(!value.camera ? 0 : value.specimen.area_mm2 ? 2 : 1);
  const s = value.specimen, area = s.area_mm2, isLoaded = value.load.address !== "none:";
  showStep("camera", value.trouble || !value.camera ? "look" : value.load.trouble ? "look" : "good");
  showStep("specimen", area || !isLoaded ? "good" : "open");
  showStep("gauges", Object.keys(value.gauges).length || value.region ? "good" : "open");
  showStep("check", value.go == null ? "open" : value.go ? "good" : "look");
  put($("specimensum"), [value.metadata.specimen ?? "", sectionOf(s), area ? `${fixed(area, 2)} mm²` : t("no section: forces, no stresses")].filter(Boolean).join(", "));
  put($("section"), area ? `${t("Section")} ${fixed(area, 2)} mm²` : t("no section: forces, no stresses"));
}

// Of the kinds of gauges.
const ICONS = { extension: "gauge", line: "gauge", area: "area", box: "area", zoi: "point", point: "point", circle: "circle", strip: "strip" };

export function beginSetup(stage) {
  busy = false;
  shownPicture = edition = -1;
  beginDrawing(stage);
  for (const button of $("kinds").children) { button.classList.add("button"); button.prepend(icon(ICONS[button.dataset.tool] ?? "gauge")); }
  beginViews("setup", stage.cameras, (value) => { busy = false; shownPicture = edition = -1; forgetDrawing(); showSetup(value); });
}

export function showSetup(state) {
  const value = received("setup", state), every = all("setup");
  showStart(every.length ? every : [state]);
  if (!value) return;
  put($("trouble"), told(value.trouble || value.doubt));
  put($("busy"), told(value.busy));
  showLive(value);
  const c = value.camera;
  put($("camera"), c ? `${told(c.name)}, ${c.width} × ${c.height} px, ${c.bits} ${t("bits")}${c.fps ? `, ${short(c.fps)} 1/s` : ""}` : "");
  put($("loadsum"), value.load.rate == null ? "" : `${t("Load cell")} ${fixed(value.load.rate)} 1/s`);
  put($("region"), value.region ? `${told(value.region.words)}${value.zois == null ? "" : ` · ${fixed(value.zois)} ${t("ZOIs")}`}` : "");
  put($("specimen"), value.metadata.specimen ?? "");
  put($("file"), `· ${value.file} · ${t(value.unsaved.length ? "not saved" : "saved")}`);
  showPicture(value);
  showDrawing(value);
  listGauges(value.gauges);
  showSliders(c?.sliders ?? []);
  showFields(value);
  for (const button of document.querySelectorAll("[data-overlay]")) button.setAttribute("aria-pressed", String(value.overlays[button.dataset.overlay]));
  showSteps(value);
  showDevices(value);
  showCheck(value);
}

// Sharpness against its best, what is saturated, the noise of one ZOI against the target.
function showLive(value) {
  const of = value.peak ? (value.sharpness ?? 0) / value.peak : 0;
  put($("sharpness"), fixed(value.sharpness, 3));
  put($("sharpof"), value.peak ? `${fixed(100 * of)} % ${t("of the best")}` : "");
  $("sharp").setAttribute("width", `${100 * Math.min(of, 1)}%`);
  put($("saturated"), percent(value.saturated));
  put($("brightest"), value.light == null ? "" : `${t("brightest at")} ${fixed(100 * value.light)} %`);
  const text = value.sigma == null ? "–" : strainText(value.sigma), unit = strainUnit().name;
  put($("sigma"), text.replace(` ${unit}`, ""));
  put($("sigmaunit"), value.sigma == null ? "" : unit);
  put($("sigmato"), value.target == null ? "" : `${t("target")} ${strainText(value.target)}`);
}

function showPicture(value) {
  if (value.camera) setRatio($("frame").closest(".well"), value.camera.width, value.camera.height);
  $("frame").classList.toggle("empty", !value.camera && !value.picture);
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
  fill(list, Object.entries(gauges).map(([name, { colour }]) => [name, colour]), ([name, colour], k) => {
    const input = el("input", { value: name, maxLength: 32, "aria-label": t("Name") });
    const remove = el("button", { type: "button", class: "button plain", "aria-label": `${t("Remove")} ${name}` }, icon("remove"));
    onEscape(input, () => { input.value = name; input.blur(); });
    input.addEventListener("change", async () => {
      const { refused } = await change({ do: "gauge", name: input.value, was: name });
      if (refused) input.value = name;
      input.blur();
      list.dataset.mark = "";
    });
    remove.addEventListener("click", () => { remove.blur(); change({ do: "gauge", name, gauge: null }); });
    return el("li", {}, key(colour ?? k), input, remove);
  });
}

// -- sliders and fields ---------------------------------------------------------------------------

const SIZES = { exposure_us: "Exposure, µs", gain: "Gain", brightness: "Brightness" };
function showSliders(settings) {
  const box = $("sliders");
  fill(box, settings.map((one) => one.key), (key) => {
    const input = el("input", { type: "range", min: 0, max: 1000, step: 1 }), value = el("output", { class: "num" });
    input.dataset.key = key;
    input.addEventListener("change", () => change({ do: "camera", key, value: sliderValue(input) }));
    input.addEventListener("input", () => put(value, short(sliderValue(input))));
    return el("label", { class: "slider" }, el("span", { class: "label small", ...(key in SIZES ? { t: SIZES[key] } : { text: key }) }), value, input);
  });
  settings.forEach((one, i) => {
    const [, value, input] = box.children[i].children;
    Object.assign(input.dataset, { low: one.low, high: one.high, log: one.log, step: one.step });
    if (input === document.activeElement && input.matches(":active")) return;
    const share = one.log ? Math.log(one.value / one.low) / Math.log(one.high / one.low) : (one.value - one.low) / (one.high - one.low);
    input.value = Math.round(1000 * share);
    put(value, short(one.value));
  });
}

function sliderValue(input) {
  const low = Number(input.dataset.low), high = Number(input.dataset.high), share = input.value / 1000;
  const value = input.dataset.log === "true" ? low * (high / low) ** share : low + share * (high - low), step = Number(input.dataset.step);
  return step ? low + Math.min(Math.round((value - low) / step), Math.floor((high - low) / step)) * step : Number(value.toPrecision(3));
}

const numbers = new Map();
for (const input of document.querySelectorAll("[data-set]")) {
  const isRange = input.type === "range", send = (value) => change({ do: "set", key: input.dataset.set, value });
  if (input.dataset.number) {
    numbers.set(input, numberField(input, { unit: input.dataset.number, onvalue: (value) => send(value ?? "") }));
    continue;
  }
  if (!isRange && input.type === "text") onEscape(input, () => { input.value = input.dataset.kept ?? ""; input.blur(); });
  if (isRange) input.addEventListener("input", () => put(input.previousElementSibling, input.value));
  input.addEventListener("change", () => send(isRange ? Number(input.value) : input.value));
}

function showFields(value) {
  for (const input of document.querySelectorAll("[data-set]")) {
    const [section, key] = input.dataset.set.split("."), now = value[section][key] ?? "";
    numbers.get(input)?.show(value[section][key]);
    input.dataset.kept = now;
    if (input === document.activeElement || numbers.has(input)) continue;
    if (input.value !== String(now)) input.value = now;
    if (input.type === "range") put(input.previousElementSibling, String(now));
  }
}

for (const button of document.querySelectorAll("[data-overlay]")) {
  button.addEventListener("click", () => { change({ do: "overlay", name: button.dataset.overlay, on: button.getAttribute("aria-pressed") !== "true" }); });
}
// The tools of the picture: the size of the brush belongs to brush and eraser.
addEventListener("click", () => {
  const tool = document.querySelector("[data-tool][aria-pressed=true]")?.dataset.tool;
  document.querySelector(".draw.brush").hidden = tool !== "brush" && tool !== "eraser";
});
$("fit").addEventListener("click", () => $("drawing").dispatchEvent(new MouseEvent("fit")));
