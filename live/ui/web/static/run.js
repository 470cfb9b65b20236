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
let state = null, firstEnded = false;

$("strainunit").value = strainUnit().name;
$("strainunit").addEventListener("change", (event) => { chooseStrainUnit(event.target.value); event.target.blur(); });
addEventListener("unit", () => { if (state) showStrains(state); });

export function beginRun(stage) {
  clearCurves();
  beginMap(stage);
  beginViews("run", (value) => { if (value.picture) showMap(value.picture, value.side); });
  showRun({ state: "opening", elapsed_s: 0, events: [], alarms: [], gauges: [], recording: null });
}

export function showRun(value) {
  firstEnded = value.state === "ended";
  show(value);
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
  $("pause").firstElementChild.dataset.t = paused ? "Resume" : "Pause";
  put($("pause").firstElementChild, t($("pause").firstElementChild.dataset.t));
  put($("force"), fixed(value.force_N, 1));
  put($("stress"), value.stress_Pa == null ? "–" : fixed(value.stress_Pa / 1e6, 2));
  showStrains(value);
  put($("peak"), value.peak_N == null ? "–" : `${fixed(value.peak_N, 1)} N`);
  put($("elongation"), value.elongation_mm == null ? "–" : `${fixed(value.elongation_mm, 4)} mm`);
  put($("strainrate"), value.strain_rate == null ? "–" : `${rate(value.strain_rate)} 1/s`);
  showSides(value.sides);
  showStrip(value);
  showEvents(value.events);
  showAlarm(value);
}

// The other one of two cameras has its card, and its map where it is chosen; the figures too once the first has ended.
export function showSecond(value) {
  if (firstEnded && value.state !== "ended") show({ ...value, sides: state.sides && { ...state.sides, strains: [] } });
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
  const unit = strainUnit(), axial = value.axial, [text, sigma] = withSigma(axial?.value, axial?.sigma, unit);
  const name = value.side ? `${axial?.name ?? ""}, ${t(value.side)}` : axial?.name;
  put($("axialname"), withPart(withPart(name ?? "", axial?.assumed), value.part));
  put($("axial"), text);
  put($("axialsigma"), sigma ? `± ${sigma} ${unit.name}` : "");
  const gauges = (value.gauges ?? []).map((one, k) => ({ ...one, k })), list = $("others");
  while (list.children.length > gauges.length) list.lastChild.remove();
  while (list.children.length < gauges.length) list.append(el("li", {}, el("i", { class: "key" }), el("span"), el("b")));
  gauges.forEach((one, i) => {
    const [key, name, number] = list.children[i].children;
    key.style.background = colourOf(one.k);
    put(name, one.name);
    put(number, one.reason || one.value == null ? t("lost") : withPart(strainText(one.value, one.sigma), one.part));
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
function showStrip(value) {
  const l = value.ledger ?? {}, lost = (l.lost ?? 0) + (l.unrecorded ?? 0), ms = (s) => (s == null ? "–" : `${fixed(s * 1e3)} ms`);
  const values = [
    value.zois == null ? "–" : `${value.valid} / ${value.zois}`, fixed(value.fps, 0), ms(value.late_s),
    String(l.recorded ?? "–"), String(l.skipped ?? "–"), String(lost), ms(value.kernel_s), value.disk_min == null ? "–" : disk(value.disk_min),
  ];
  const box = $("strip");
  fill(box, CELLS, (name) => el("div", {}, el("dt", { t: name }), el("dd")));
  values.forEach((text, i) => put(box.children[i].lastChild, text));
  box.children[5].lastChild.classList.toggle("bad", lost > 0);
  box.children[0].lastChild.classList.toggle("bad", Boolean(value.part));
}

const disk = (minutes) => (minutes > 600 ? `${fixed(minutes / 60)} h` : `${fixed(minutes)} min`);

function showEvents(list) {
  fill($("events"), list.toReversed(), (one) => el("li", {}, el("time", { text: time(one.s) }), el("span", { text: t(one.text), class: one.level })));
}

// An alarm stays until it clears or is switched off, an error for 20 s.
function showAlarm(value) {
  const error = value.events.findLast((one) => one.level === "error" && value.elapsed_s - one.s < 20);
  const words = [...(value.alarms ?? []), ...(error && !value.alarms?.length ? [error.text] : [])].map((one) => t(one)).join(" · ");
  $("state").classList.toggle("alarm", Boolean(words));
  put($("alarm"), words);
}

