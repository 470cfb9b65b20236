// A running test: what is done with the frames, large figures, alarms, machine and events.
import { $, el, fill, put } from "./base.js";
import { clearCurves, updateCurves } from "./curves.js";
import { beginMap, showMap } from "./map.js";
import { chooseStrainUnit, colourOf, fixed, strainText, strainUnit, time, withSigma } from "./numbers.js";
import { beginViews, noteFailed, received } from "./views.js";
import { t } from "./words.js";

const WORDS = {
  opening: "opening", reference: "reference: keep still", measuring: "measuring", paused: "paused", ended: "closing the files",
};
const RECORDING = { on: "REC", off: "NOT RECORDING" };
let state = null, firstEnded = false, secondGoesOn = false;

$("strainunit").value = strainUnit().name;
$("strainunit").addEventListener("change", (event) => { chooseStrainUnit(event.target.value); event.target.blur(); });
addEventListener("unit", () => { if (state) showStrains(state); });

export function beginRun(stage) {
  secondGoesOn = false;
  clearCurves();
  beginMap(stage);
  beginViews("run", (value) => { if (value.picture) showMap(value.picture, value.side); });
  showRun({ state: "opening", elapsed_s: 0, events: [], troubles: [], figures: {}, gauges: [], recording: null });
}

export function showRun(value) {
  firstEnded = value.state === "ended";
  if (firstEnded && secondGoesOn) state = value;
  else show(value);
  noteFailed(value.sides?.cameras);
  showMapOf(value, false);
  if (value.points) updateCurves(value.points);
}

function show(value) {
  state = value;
  const paused = value.state === "paused", ended = value.state === "ended";
  $("state").dataset.word = value.state;
  put($("word"), t(WORDS[value.state] ?? value.state));
  put($("elapsed"), time(value.elapsed_s));
  showRecording(value.recording, ended);
  $("pause").dataset.line = paused ? "resume" : "pause";
  if (paused) delete $("pause").dataset.ask; else $("pause").dataset.ask = "Pause measuring?";
  $("pause").firstElementChild.dataset.t = paused ? "Resume" : "Pause";
  put($("pause").firstElementChild, t($("pause").firstElementChild.dataset.t));
  showFigure("force", value.figures.force, (one) => fixed(one, 1));
  showFigure("stress", value.figures.stress, (one) => fixed(one / 1e6, 2));
  showStrains(value);
  put($("peak"), value.peak_N == null ? "–" : `${fixed(value.peak_N, 1)} N`);
  put($("elongation"), value.elongation_mm == null ? "–" : `${fixed(value.elongation_mm, 4)} mm`);
  put($("strainrate"), value.strain_rate == null ? "–" : `${rate(value.strain_rate)} 1/s`);
  showSides(value.sides);
  showStrip(value);
  showEvents(value.events);
  showAlarm(value);
}

// A figure that is not live has no value: a word instead, and of one that is old the last value, grey, with its age.
const LABELS = {
  overload: "OVERLOAD", underload: "UNDERLOAD", old: "old", unknown: "not known", "not yet": "not yet", paused: "paused", ended: "ended",
};
function showFigure(id, one, text, beside = "") {
  const state = one?.state ?? "not yet", isBeyond = state.endsWith("load"), isOld = state === "old" || state === "unknown";
  const age = one?.age_s == null ? "" : t("{} s ago").replace("{}", fixed(one.age_s));
  const instead = isOld && one.last != null ? `${text(one.last)}, ${age}` : isBeyond ? "" : t(LABELS[state] ?? "");
  $(id).parentElement.hidden = state === "none" && id !== "axial";
  put($(id), state === "live" ? text(one.value) : isBeyond ? t(LABELS[state]) : "–");
  put($(`${id}sigma`), state === "live" ? beside : instead);
  $(id).classList.toggle("bad", isBeyond);
  $(id).classList.toggle("isold", isOld);
}

// The other one of two cameras has its card, and its map where it is chosen; the figures too once the first has ended.
export function showSecond(value) {
  secondGoesOn = value.state !== "ended";
  if (firstEnded && secondGoesOn) show({ ...value, sides: state.sides && { ...state.sides, strains: [] } });
  showMapOf(value, true);
}

function showMapOf(value, isSecond) {
  const shown = received("run", value, isSecond);
  if (shown?.picture) showMap(shown.picture, shown.side);
}

// Always written: REC or NOT RECORDING.
function showRecording(recording, ended) {
  $("state").classList.toggle("unrecorded", recording !== true && !ended);
  put($("rec"), t(recording === true ? RECORDING.on : RECORDING.off));
  $("rec").className = recording === true ? "on" : "off";
  document.querySelector("#run [data-line=start]").disabled = recording !== false;
  document.querySelector("#run [data-line=stop]").disabled = recording !== true;
}

// 2.5·10⁻⁴: one form for all rates.
function rate(value) {
  if (value === 0) return "0";
  const power = Math.floor(Math.log10(Math.abs(value)));
  const digits = [...String(power)].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c])).join("");
  return `${fixed(value / 10 ** power, 1)}·10${digits}`;
}

// A value whose area lost a block stands for a part of it.
const withPart = (text, part) => (part ? `${text} ${t(part)}` : text);

function showStrains(value) {
  const unit = strainUnit(), axial = value.axial, sigma = withSigma(axial?.value, axial?.sigma, unit)[1];
  const name = value.side ? `${axial?.name ?? ""}, ${t(value.side)}` : axial?.name;
  put($("axialname"), withPart(withPart(name ?? "", axial?.assumed), value.part));
  showFigure("axial", value.figures.axial, (one) => withSigma(one, axial?.sigma, unit)[0], sigma ? `± ${sigma} ${unit.name}` : "");
  const gauges = (value.gauges ?? []).map((one, k) => ({ ...one, k })), list = $("others");
  while (list.children.length > gauges.length) list.lastChild.remove();
  while (list.children.length < gauges.length) list.append(el("li", {}, el("i", { class: "key" }), el("span"), el("b")));
  gauges.forEach((one, i) => {
    const [key, name, number] = list.children[i].children;
    key.style.background = colourOf(one.k);
    put(name, one.name);
    put(number, one.reason ? t("lost") : one.value == null ? "–" : withPart(strainText(one.value, one.sigma), one.part));
    number.title = one.reason ? t(one.reason) : "";
  });
}

// Two cameras: mean and bending, the figures so far, and each camera.
function showSides(sides) {
  const rows = [];
  for (const one of sides?.strains ?? []) {
    rows.push([`${t("mean")}: ${one.name}`, strainText(one.mean, one.sigma)]);
    rows.push([t("front minus mean"), strainText(one.bending, one.sigma)]);
  }
  for (const one of sides?.cameras ?? []) {
    rows.push([t(one.side), `${one.valid} / ${one.zois}, ${t("skipped")} ${one.skipped}, ${t("lost")} ${one.lost}`]);
  }
  for (const one of sides?.figures ?? []) rows.push([`${one.name}, ${t(one.side)}`, one.text]);
  $("sides").hidden = !rows.length;
  fill($("sides"), rows, ([name, text]) => el("li", {}, el("span", { text: name }), el("b", { text })));
}

const CELLS = ["ZOIs", "frames/s", "latency", "recorded", "skipped", "lost", "kernel", "disk"];
const BOARD = { kernel: "without a force" };  // in its place where there are any
function showStrip(value) {
  const l = value.ledger ?? {}, lost = (l.lost ?? 0) + (l.unrecorded ?? 0), ms = (s) => (s == null ? "–" : `${fixed(s * 1e3)} ms`);
  const values = [
    value.zois == null ? "–" : `${value.valid} / ${value.zois}`, fixed(value.fps, 0), ms(value.late_s),
    String(l.recorded ?? "–"), String(l.skipped ?? "–"), String(lost), l.without_force ? String(l.without_force) : ms(value.kernel_s), value.disk_min == null ? "–" : disk(value.disk_min),
  ];
  const box = $("strip");
  const cells = CELLS.map((name) => (l.without_force && BOARD[name]) || name);
  fill(box, cells, (name) => el("div", {}, el("dt", { t: name }), el("dd")));
  values.forEach((text, i) => put(box.children[i].lastChild, text));
  box.children[5].lastChild.classList.toggle("bad", lost > 0);
  box.children[6].lastChild.classList.toggle("bad", l.without_force > 0);
  box.children[0].lastChild.classList.toggle("bad", Boolean(value.part));
}

const disk = (minutes) => (minutes > 600 ? `${fixed(minutes / 60)} h` : `${fixed(minutes)} min`);

function showEvents(list) {
  fill($("events"), list.toReversed(), (one) => el("li", {}, el("time", { text: time(one.s) }), el("span", { text: t(one.text), class: one.level })));
}

// Alarms, errors that are not over, and figures that are old or unknown: until that is over.
function showAlarm(value) {
  const words = (value.troubles ?? []).map((one) => t(one)).join(" · ");
  $("state").classList.toggle("alarm", Boolean(words));
  put($("alarm"), words);
}

