// A running test: what is done with the frames, figures with their age and limits, alarms, machine and events.
import { $, el, fill, put } from "./base.js";
import { clearCurves, showAges, updateCurves } from "./curves.js";
import { key, putIcon } from "./icons.js";
import { beginMap, showMap } from "./map.js";
import { chooseStrainUnit, fixed, powered, quantity, quantityText, short, strainText, strainUnit, time, unitOf, withSigma } from "./numbers.js";
import { beginViews, cameras, noteFailed, received } from "./views.js";
import { nameOfRegion, setAlong, t, told } from "./words.js";

const WORDS = {
  opening: "opening", reference: "reference: keep still", measuring: "measuring", paused: "paused", ended: "closing the files",
  silent: "Load cell silent", blind: "No picture",
};
const DIGITS = 6; // of live figures, a sign, point or space counting half: so many are mostly needed
const RECORDING = { on: "REC", off: "NOT RECORDING" };
const LABELLED = { force: "Force", stress: "Stress", axial: "Strain along the load" };
let state = null, stage = {}, goOn = {}, sides = null, silentS = 0, digits = DIGITS;

$("strainunit").value = strainUnit().name;
$("strainunit").addEventListener("change", (event) => { chooseStrainUnit(event.target.value); event.target.blur(); });
for (const kind of ["unit", "language"]) addEventListener(kind, () => { if (state) { regrow(); show(state); } });

export function beginRun(value) {
  stage = value;
  goOn = {};
  setAlong(value.what?.along);
  regrow();
  clearCurves(value);
  beginMap(value);
  beginViews("run", value.cameras, (one) => { if (one.picture) showMap(one.picture, one.side); });
  show({ state: "opening", elapsed_s: 0, events: [], troubles: [], figures: {}, gauges: [], recording: null });
}

// The curves are of the first camera, the figures of the first one that goes on: without it there is no mean.
export function showRun(value) {
  const [first] = cameras(), leads = value.side === first;
  goOn[value.side] = value.state !== "ended";
  if (leads) {
    ({ sides } = value);
    noteFailed(sides?.cameras);
    if (value.points) updateCurves(value.points);
  }
  if (value.side === (cameras().find((one) => goOn[one]) ?? first)) show(leads ? value : { ...value, sides: sides && { ...sides, strains: [] } });
  const large = received("run", value);
  if (large?.picture) showMap(large.picture, large.side);
}

// Without a link all figures are old, and their ages run on.
export function linkLost(seconds) {
  const was = silentS;
  silentS = seconds;
  if (state && (seconds || was)) showFigures(state);
}

function show(value) {
  state = value;
  const isPaused = value.state === "paused", isEnded = value.state === "ended";
  $("state").dataset.word = value.state;
  put($("elapsed"), time(value.elapsed_s));
  showRecording(value.recording, isEnded);
  $("pause").dataset.line = isPaused ? "resume" : "pause";
  if (isPaused) delete $("pause").dataset.ask; else $("pause").dataset.ask = "Pause measuring?";
  const word = $("pause").querySelector("span");
  word.dataset.t = isPaused ? "Resume" : "Pause";
  if (!$("pause").classList.contains("armed")) put(word, t(word.dataset.t));
  showFigures(value);
  const { value: longer, sigma } = value.elongation ? quantity(value.elongation) : { value: "–" };
  put($("elongation"), sigma ? `${longer} ± ${sigma}` : longer);
  put($("strainrate"), value.strain_rate?.[0] == null ? "–" : powered(...value.strain_rate));
  showGauges(value);
  showSides(value.sides);
  showMachine(value);
  showEvents(value.events);
  showState(value);
}

// -- figures -----------------------------------------------------------------------------------------

function showFigures(value) {
  const unit = strainUnit(), axial = value.axial, figures = value.figures, of = nameOfRegion(axial?.name ?? "");
  const name = value.side ? `${of}, ${t(value.side)}` : of;
  const N = unitOf("force", value.peak_N ?? 0), MPa = unitOf("stress", 0); // that of a test, whatever the force is now
  showTile("force", figures.force, N, value.peak_N == null ? "" : `${t("highest")} ${quantityText({ kind: "force", value: value.peak_N })}`);
  showTile("stress", figures.stress, MPa, stage.what?.area_mm2 ? `${t("over")} ${fixed(stage.what.area_mm2, 2)} mm²` : "");
  showTile("axial", figures.axial, unit, withPart(withPart(name, axial?.assumed), value.part));
  const isPictureOld = silentS || ["old", "unknown"].includes(figures.axial?.state);
  $("gaugemap").closest(".frame").classList.toggle("old", Boolean(isPictureOld));
  put($("pictureage"), isPictureOld && figures.axial?.age_s != null ? time(value.elapsed_s - figures.axial.age_s) : "");
  showAges(figures, value);
}

// A figure that is not live has a word and its age; the last value of one that is old is thin and grey.
const LABELS = {
  overload: "OVERLOAD", underload: "UNDERLOAD", unknown: "not known", "not yet": "not yet", paused: "paused", ended: "ended",
  near: "near limit", beyond: "beyond limit",
};
const SAYS = { near: ["look", "warn"], beyond: ["bad", "error"], paused: ["open", "pause"] };
function showTile(id, one, unit, of) {
  const isLost = silentS > 0 && one?.state === "live", state = isLost ? "old" : (one?.state ?? "not yet"), tile = $(`${id}tile`);
  const isOld = state === "old" || state === "unknown", isBeyond = state.endsWith("load"), isLive = state === "live";
  const last = isLost ? one.value : one?.last, isKept = (isOld || state === "paused" || state === "ended") && last != null;
  tile.hidden = state === "none" && id !== "axial";
  const limit = isLive ? one.limit : null, says = isBeyond || limit?.beyond ? "beyond" : limit?.near ? "near" : state;
  const text = isLive ? number(one.value, one.sigma, unit) : isKept ? number(last, 0, unit) : isBeyond ? t(LABELS[state]) : "–";
  put($(id), text);
  $(id).classList.toggle("word", isBeyond);
  if (isLive || isKept) grow(text);
  put($(`${id}unit`), isBeyond ? "" : unit.name);
  const age = (one?.age_s ?? 0) + (isLost ? silentS : 0), two = isLive ? withSigma(one.value, one.sigma, unit)[1] : "";
  const since = state === "unknown" && one.why ? told(one.why) : isKept && one.age_s != null ? `${t("last value at")} ${time(state_s() - one.age_s)}` : t(LABELS[state] ?? "");
  put($(`${id}sigma`), isLive ? (two && `± ${two} ${unit.name}`) : since);
  put($(`${id}of`), isLive ? of : "");
  tile.className = ["tile", id === "axial" ? "strain" : "", isOld || state === "paused" ? "stale" : "", says === "beyond" ? "bad" : says === "near" ? "look" : ""].join(" ").trim();
  showChip(tile.querySelector(".age"), isOld ? ["full", "error", `${fixed(age)} ${t("s old")}`] : SAYS[says] && [...SAYS[says], t(LABELS[says])]);
  showLimit(tile.querySelector(".to"), limit, unit);
}
const state_s = () => state?.elapsed_s ?? 0;
const number = (value, sigma, unit) => withSigma(value, sigma, unit)[0];

function showChip(place, says) {
  const [kind, name, words] = says ?? [];
  if (!kind) { place.replaceChildren(); place.dataset.now = ""; return; }
  if (place.dataset.now !== kind + name) {
    place.dataset.now = kind + name;
    place.replaceChildren(el("span", { class: `chip ${kind}` }, el("span"), el("span")));
    putIcon(place.firstChild.firstChild, name);
  }
  put(place.firstChild.lastChild, words);
}

// The share of the limit, and the limit.
function showLimit(place, limit, unit) {
  place.hidden = !limit;
  if (!limit) return;
  place.querySelector(".fill").setAttribute("width", `${Math.min(Math.max(limit.share, 0), 1) * 100}%`);
  put(place.lastElementChild, `${ofLimit(limit)}, ${short(limit.value * unit.factor)} ${unit.name}`);
}
const ofLimit = (limit) => `${fixed(100 * limit.share)} % ${t(limit.range ? "of the range" : "of the limit")}`;

// All figures of a screen have one size, that of the longest number; its digits only become more during a test.
function regrow() {
  digits = DIGITS;
  document.querySelector(".figures").style.removeProperty("--n");
}

function grow(text) {
  const n = [...text].reduce((sum, one) => sum + (/\d/.test(one) ? 1 : 0.5), 0);
  if (n <= digits) return;
  digits = n;
  document.querySelector(".figures").style.setProperty("--n", String(n));
}

// A value whose area lost a block stands for a part of it.
const withPart = (text, part) => (part ? `${text} ${told(part)}` : text);

function showGauges(value) {
  const gauges = (value.gauges ?? []).map((one, k) => ({ k: one.colour ?? k, ...one })), list = $("others");
  list.hidden = !gauges.length && ["measuring", "paused"].includes(value.state); // its place is kept until they come
  fill(list, gauges.map(({ name, k }) => [name, k]), ([name, k]) => el("li", {}, key(k), el("span", { class: "name", text: name }), el("b", { class: "num" })));
  gauges.forEach((one, i) => {
    const number = list.children[i].lastChild;
    put(number, one.reason ? t("lost") : one.value == null ? "–" : withPart(strainText(one.value, one.sigma), one.part));
    number.title = told(one.reason);
    number.classList.toggle("bad", Boolean(one.reason));
  });
}

// Several cameras: of sides mean and bending, the figures so far, and each camera.
function showSides(sides) {
  const rows = [];
  for (const one of sides?.strains ?? []) {
    rows.push([`${t("mean")}: ${one.name}`, strainText(one.mean, one.sigma)]);
    rows.push([t("front minus mean"), strainText(one.bending, one.sigma)]);
  }
  for (const one of sides?.cameras ?? []) {
    rows.push([t(one.side), `${fixed(one.valid)} / ${fixed(one.zois)}, ${t("skipped")} ${fixed(one.skipped)}, ${t("lost")} ${fixed(one.lost)}`]);
  }
  for (const one of sides?.figures ?? []) rows.push([`${one.name}, ${t(one.side)}`, one.text]);
  $("sides").hidden = !rows.length;
  fill($("sides"), rows, ([name, text]) => el("li", {}, el("span", { class: "name", text: name }), el("b", { class: "num", text })));
}

// -- the state bar -------------------------------------------------------------------------------------

// Always written: REC or NOT RECORDING.
function showRecording(recording, isEnded) {
  const isOn = recording === true;
  $("state").classList.toggle("unrecorded", !isOn && !isEnded);
  put($("rec"), t(isOn ? RECORDING.on : RECORDING.off));
  $("rec").parentElement.className = isOn ? "rec on" : "rec off";
  const [begin, end] = ["start", "stop"].map((line) => document.querySelector(`[data-part="run"] [data-line=${line}]`));
  begin.disabled = recording !== false || isEnded;
  end.disabled = !isOn;
  if (isEnded) return; // the buttons stay where they are while the files are closed
  begin.hidden = recording !== false;
  end.hidden = recording === false;
}

// Red and the cause: alarms, errors that are not over, figures that are old or unknown, until that is over. Amber near
// a limit, and where an alarm was silenced beyond it.
function showState(value) {
  const troubles = (value.troubles ?? []).map(told), { force, axial } = value.figures;
  const near = Object.keys(LABELLED).find((name) => value.figures[name]?.limit?.near || value.figures[name]?.limit?.beyond);
  const kind = troubles.length ? "alarm" : value.state === "paused" ? "paused" : near ? "near" : value.state === "measuring" ? "measuring" : "";
  for (const one of ["alarm", "paused", "near", "measuring"]) $("state").classList.toggle(one, one === kind);
  putIcon($("lamp"), { alarm: "error", paused: "pause", near: "warn" }[kind] ?? "play");
  const cause = force?.state === "old" ? "silent" : axial?.state === "old" && value.state === "measuring" ? "blind" : value.state;
  put($("word"), t(WORDS[cause] ?? cause));
  const limit = near && value.figures[near].limit;
  put($("alarm"), troubles[0] ?? (near ? `${t(LABELLED[near])}: ${ofLimit(limit)}` : ""));
  put($("alarmmore"), troubles.slice(1).join(" · ") || (near && limit.ends && !troubles.length ? t("At the limit the test ends by itself.") : ""));
  $("alarm").parentElement.title = troubles.join(" · "); // whole, where the bar has no room for it
  $("silence").hidden = !troubles.length;
}

// Small and grey; each turns amber on its own when it counts.
function showMachine({ facts = [], zois, valid, part }) {
  const shown = [...facts.map((one) => [one.label, quantityText(one.amount), one.matters, one.why])];
  if (zois != null) shown.push(["ZOIs", `${fixed(valid)} / ${fixed(zois)}`, Boolean(part)]);
  fill($("strip"), shown.map(([label]) => label), (label) => el("span", {}, el("b"), " ", el("span", { t: label })));
  shown.forEach(([, text, matters, why], i) => {
    put($("strip").children[i].firstChild, text);
    $("strip").children[i].title = told(why);
    $("strip").children[i].classList.toggle("matters", matters);
  });
}

function showEvents(list) {
  const newest = list.at(-1);
  put($("lastevent"), newest ? `${time(newest.s)} ${told(newest.text)}` : "");
  put($("eventcount"), fixed(list.length));
  fill($("events"), list.toReversed(), (one) => el("li", {}, el("time", { text: time(one.s) }), el("span", { text: told(one.text), class: one.level })));
}
