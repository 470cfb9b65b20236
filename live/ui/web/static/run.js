// A running test: large figures, the map, the curves, the events.
import { $, command, post, put } from "./base.js";
import { drawGauges } from "./draw.js";
import { t } from "./words.js";
import { Curves } from "./curves.js";

const curves = new Curves($("curve1"), $("curve2"));
let ramp = [], loading = false, shownPicture = 0, paused = false;

export const fixed = (value, digits = 0) => (value == null ? "–" : value.toFixed(digits).replace("-", "−"));
const signed = (value, digits = 0) => (value == null ? "–" : (value < 0 ? "−" : "+") + Math.abs(value).toFixed(digits));

export function strainUnit(largest) {
  return largest >= 0.02 ? { name: "%", factor: 100, digits: 3 } : { name: "µm/m", factor: 1e6, digits: 0 };
}

function time(seconds) {
  const whole = Math.floor(Math.max(seconds ?? 0, 0)), two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  return `${hours ? `${hours}:` : ""}${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
}

const WORDS = {
  opening: "opening", reference: "reference: keep still", measuring: "measuring", paused: "paused", ended: "closing the files",
};

export function showRun(state) {
  paused = state.state === "paused";
  $("state").dataset.word = state.state;
  put($("word"), t(WORDS[state.state] ?? state.state));
  put($("elapsed"), time(state.elapsed_s));
  put($("pause").querySelector("[data-t]"), t(paused ? "Resume" : "Pause"));
  $("state").classList.toggle("unrecorded", state.recording === false);
  put($("notrecorded"), state.recording === false && state.state !== "ended" ? t("not recorded") : "");
  document.querySelector("#run [data-line=start]").disabled = state.recording !== false;
  document.querySelector("#run [data-line=stop]").disabled = state.recording !== true;
  put($("force"), fixed(state.force_N, Math.abs(state.force_N ?? 0) < 1000 ? 1 : 0));
  put($("stress"), state.stress_Pa == null ? "–" : fixed(state.stress_Pa / 1e6, 1));
  showStrains(state);
  showStrip(state);
  showEvents(state.events);
  showAlarm(state);
  showPicture(state.picture);
  curves.update(state.points);
}

showRun.begin = (stage) => {
  ramp = stage.ramp;
  shownPicture = 0;
  curves.clear();
  const chosen = $("component");
  if (!chosen.children.length) {
    for (const name of stage.components) chosen.append(new Option(t(name), name));
    chosen.addEventListener("change", () => post("/map", { of: chosen.value }));
  }
  $("ramp").style.background = `linear-gradient(to left, ${ramp.join(", ")})`;
};
showRun.theme = () => curves.theme();

function showStrains(state) {
  const axial = state.axial, unit = strainUnit(Math.abs(axial?.value ?? 0));
  put($("axialname"), axial?.name ?? "");
  put($("axial"), axial ? signed(axial.value == null ? null : axial.value * unit.factor, unit.digits) : "–");
  put($("axialunit"), unit.name);
  put($("axialsigma"), axial?.sigma == null ? "" : `± ${(axial.sigma * unit.factor).toFixed(unit.digits || 1)}`);
  const rows = (state.gauges ?? []).filter((one) => one.name !== "axial").slice(0, 6);
  const list = $("others");
  while (list.children.length < rows.length) list.append(row());
  while (list.children.length > rows.length) list.lastChild.remove();
  rows.forEach((one, i) => {
    const u = strainUnit(Math.abs(one.value ?? 0)), [name, value] = list.children[i].children;
    put(name, one.name);
    put(value, one.reason || one.value == null ? t("lost") : `${signed(one.value * u.factor, u.digits)} ± ${(one.sigma * u.factor).toFixed(u.digits || 1)} ${u.name}`);
  });
}

function row() {
  const item = document.createElement("li");
  item.append(document.createElement("span"), document.createElement("b"));
  return item;
}

const CELLS = ["ZOIs", "frames/s", "latency", "recorded", "skipped", "lost", "kernel", "peak force", "disk"];
function showStrip(state) {
  const l = state.ledger ?? {}, lost = (l.lost ?? 0) + (l.unrecorded ?? 0);
  const values = [
    state.zois == null ? "–" : `${state.valid} / ${state.zois}`, fixed(state.fps, 0), state.late_s == null ? "–" : `${fixed(state.late_s * 1e3)} ms`,
    String(l.recorded ?? "–"), String(l.skipped ?? "–"), String(lost), state.kernel_s == null ? "–" : `${fixed(state.kernel_s * 1e3)} ms`,
    state.peak_N == null ? "–" : `${fixed(state.peak_N, 0)} N`, state.disk_min == null ? "–" : disk(state.disk_min),
  ];
  const box = $("strip");
  if (!box.children.length) {
    for (const name of CELLS) {
      const cell = document.createElement("div"), head = document.createElement("dt");
      head.dataset.t = name;
      head.textContent = t(name);
      cell.append(head, document.createElement("dd"));
      box.append(cell);
    }
  }
  values.forEach((value, i) => put(box.children[i].lastChild, value));
  box.children[5].lastChild.classList.toggle("bad", lost > 0);
}

const disk = (minutes) => (minutes > 600 ? `${fixed(minutes / 60)} h` : `${fixed(minutes)} min`);

let newest = "";
function showEvents(list) {
  const mark = `${list.length} ${list.at(-1)?.s} ${list.at(-1)?.text}`;
  if (mark === newest) return;
  newest = mark;
  $("events").replaceChildren(...list.toReversed().map((one) => {
    const item = document.createElement("li"), when = document.createElement("time"), text = document.createElement("span");
    when.textContent = time(one.s);
    text.textContent = one.text;
    text.className = one.level;
    item.append(when, text);
    return item;
  }));
}

// An alarm stays until it clears or is switched off, an error for 20 s.
function showAlarm(state) {
  const error = state.events.findLast((one) => one.level === "error" && state.elapsed_s - one.s < 20);
  const words = [...(state.alarms ?? []), ...(error && !state.alarms?.length ? [error.text] : [])].join(" · ");
  $("state").classList.toggle("alarm", Boolean(words));
  put($("alarm"), words);
}

// The next picture is requested when the last has arrived: a slow page gets fewer pictures, never old ones.
function showPicture(picture) {
  if (picture.n === shownPicture || loading) return;
  const image = $("map");
  loading = true;
  shownPicture = picture.n;
  image.onload = image.onerror = () => { loading = false; };
  image.src = `/picture?run=${picture.n}`;
  if ($("component") !== document.activeElement) $("component").value = picture.of;
  const scaled = picture.high != null;
  $("ramp").parentElement.classList.toggle("status", Boolean(picture.legend));
  $("ramp").style.visibility = scaled ? "" : "hidden";
  $("statuses").replaceChildren(...(picture.legend ?? []).map((one) => {
    const item = document.createElement("span"), key = document.createElement("i");
    key.style.background = one.colour;
    item.append(key, one.text);
    return item;
  }));
  put($("low"), scaled ? fixed(picture.low, picture.unit === "µm/m" ? 0 : 3) : "");
  put($("high"), scaled ? fixed(picture.high, picture.unit === "µm/m" ? 0 : 3) : "");
  put($("unit"), scaled ? picture.unit : "");
  if (picture.width) drawGauges($("gaugemap"), picture.gauges, picture.width, picture.height);
}

$("pause").addEventListener("click", () => command(paused ? "resume" : "pause"));
