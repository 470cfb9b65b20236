// A running test: large figures, the map, the curves, what happened.
import { $, order, post, put } from "./base.js";
import { drawGauges } from "./draw.js";
import { t } from "./words.js";
import { Curves } from "./curves.js";

const curves = new Curves($("curve1"), $("curve2"));
let ramp = [], loading = false, shownPicture = 0, paused = false;

export const fixed = (value, digits = 0) => (value == null ? "–" : value.toFixed(digits).replace("-", "−"));
const SIGNED = (value, digits = 0) => (value == null ? "–" : (value < 0 ? "−" : "+") + Math.abs(value).toFixed(digits));

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

export function showRun(told) {
  paused = told.state === "paused";
  $("state").dataset.word = told.state;
  put($("word"), t(WORDS[told.state] ?? told.state));
  put($("elapsed"), time(told.elapsed_s));
  put($("pause").querySelector("[data-t]"), t(paused ? "Go on" : "Pause"));
  $("state").classList.toggle("unrecorded", told.recording === false);
  put($("notrecorded"), told.recording === false && told.state !== "ended" ? t("not recorded") : "");
  document.querySelector("#run [data-line=start]").disabled = told.recording !== false;
  document.querySelector("#run [data-line=stop]").disabled = told.recording !== true;
  put($("force"), fixed(told.force_N, Math.abs(told.force_N ?? 0) < 1000 ? 1 : 0));
  put($("stress"), told.stress_Pa == null ? "–" : fixed(told.stress_Pa / 1e6, 1));
  strains(told);
  strip(told);
  events(told);
  alarm(told);
  picture(told.picture);
  curves.follow(told.points);
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

function strains(told) {
  const axial = told.axial, unit = strainUnit(Math.abs(axial?.value ?? 0));
  put($("axialname"), axial?.name ?? "");
  put($("axial"), axial ? SIGNED(axial.value == null ? null : axial.value * unit.factor, unit.digits) : "–");
  put($("axialunit"), unit.name);
  put($("axialsigma"), axial?.sigma == null ? "" : `± ${(axial.sigma * unit.factor).toFixed(unit.digits || 1)}`);
  const rows = (told.gauges ?? []).filter((one) => one.name !== "axial").slice(0, 6);
  const list = $("others");
  while (list.children.length < rows.length) list.append(row());
  while (list.children.length > rows.length) list.lastChild.remove();
  rows.forEach((one, i) => {
    const u = strainUnit(Math.abs(one.value ?? 0)), [name, value] = list.children[i].children;
    put(name, one.name);
    put(value, one.reason || one.value == null ? t("lost") : `${SIGNED(one.value * u.factor, u.digits)} ± ${(one.sigma * u.factor).toFixed(u.digits || 1)} ${u.name}`);
  });
}

function row() {
  const item = document.createElement("li");
  item.append(document.createElement("span"), document.createElement("b"));
  return item;
}

const CELLS = ["ZOIs", "frames/s", "latency", "recorded", "skipped", "lost", "kernel", "peak force", "disk"];
function strip(told) {
  const l = told.ledger ?? {}, lost = (l.lost ?? 0) + (l.unrecorded ?? 0);
  const values = [
    told.zois == null ? "–" : `${told.valid} / ${told.zois}`, fixed(told.fps, 0), told.late_s == null ? "–" : `${fixed(told.late_s * 1e3)} ms`,
    String(l.recorded ?? "–"), String(l.skipped ?? "–"), String(lost), told.kernel_s == null ? "–" : `${fixed(told.kernel_s * 1e3)} ms`,
    told.peak_N == null ? "–" : `${fixed(told.peak_N, 0)} N`, told.disk_min == null ? "–" : disk(told.disk_min),
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
function events(told) {
  const list = told.events, mark = `${list.length} ${list.at(-1)?.s} ${list.at(-1)?.text}`;
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

// An alarm stays until it goes or is silenced, an error for a while.
function alarm(told) {
  const error = told.events.findLast((one) => one.level === "error" && told.elapsed_s - one.s < 20);
  const words = [...(told.alarms ?? []), ...(error && !told.alarms?.length ? [error.text] : [])].join(" · ");
  $("state").classList.toggle("alarm", Boolean(words));
  put($("alarm"), words);
}

// The next picture is asked for when the last has come: a slow page gets fewer, never old ones.
function picture(told) {
  if (told.n === shownPicture || loading) return;
  const image = $("map");
  loading = true;
  shownPicture = told.n;
  image.onload = image.onerror = () => { loading = false; };
  image.src = `/picture?run=${told.n}`;
  if ($("component") !== document.activeElement) $("component").value = told.of;
  const some = told.high != null;
  $("ramp").parentElement.classList.toggle("status", Boolean(told.legend));
  $("ramp").style.visibility = some ? "" : "hidden";
  $("statuses").replaceChildren(...(told.legend ?? []).map((one) => {
    const item = document.createElement("span"), key = document.createElement("i");
    key.style.background = one.colour;
    item.append(key, one.text);
    return item;
  }));
  put($("low"), some ? fixed(told.low, told.unit === "µm/m" ? 0 : 3) : "");
  put($("high"), some ? fixed(told.high, told.unit === "µm/m" ? 0 : 3) : "");
  put($("unit"), some ? told.unit : "");
  if (told.width) drawGauges($("gaugemap"), told.gauges, told.width, told.height);
}

$("pause").addEventListener("click", () => order(paused ? "resume" : "pause"));
