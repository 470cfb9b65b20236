// After a test: whether the figures can be believed, the figures, the curve with its lines, the map, the report.
import { $, el, fill, put } from "./base.js";
import { finishCurve, updateCurves } from "./curves.js";
import { drawGauges } from "./draw.js";
import { icon, key, putIcon } from "./icons.js";
import { setRatio, showLegend } from "./legend.js";
import { quantity, strainText, time } from "./numbers.js";
import { t, told } from "./words.js";

let result = null, chosen = { side: 0, time: "peak" };
for (const kind of ["unit", "language"]) addEventListener(kind, () => { if (result) show(); });

export async function showAfter(value) {
  result = value;
  show();
  if (value.points) await updateCurves(value.points, true);
  finishCurve(value.lines ?? []);
}

function show() {
  showBelief(result);
  const heads = result.figures.filter((one) => one.head), others = result.figures.filter((one) => !one.head);
  fill($("tiles"), heads, tile);
  fill($("results"), others.filter((one) => one.text != null), row);
  showFold("unknown", others.filter((one) => one.text == null), unknown, `${t("Figures that are not known")}: `);
  showFold("gauge", result.gauges.map((one, k) => ({ ...one, k: one.colour ?? k })), gauge, `${t("Gauges")}, ${t(result.atpeak ?? "")}: `);
  put($("folder"), result.folder);
  put($("ledger"), told(result.ledger));
  put($("next"), result.next ?? "");
  put($("again"), result.again ?? "");
  finishCurve(result.lines ?? []);
  showMaps();
  showReport(result.report);
}

function showBelief({ belief, words, troubles }) {
  const kind = words ? "bad" : (belief?.kind ?? "look");
  $("belief").className = `band ${kind}`;
  putIcon(document.querySelector("#belief .lamp"), { good: "check", look: "warn", bad: "error" }[kind]);
  put($("believed"), told(words || belief?.words));
  put($("ended"), [words && belief ? belief.words : "", troubles[0] ?? belief?.more ?? ""].map(told).filter(Boolean).join(" "));
  $("troublefold").hidden = !troubles.length;
  put($("troublecount"), String(troubles.length));
  fill($("troubles"), troubles, (text) => el("li", { text: told(text) }));
}

const nameOf = (one) => `${typeof one.name === "string" && !one.name.includes(" ") ? one.name : t(one.name)}${one.side ? `, ${t(one.side)}` : ""}`;

// Value, uncertainty and unit of a figure: a quantity, or a text as it is.
function parts(one, bound) {
  if (typeof one.text === "string" || one.text?.say != null) return { value: told(one.text), sigma: "", unit: "" };
  const found = quantity(one.text);
  return one.bound ? { ...found, value: `${bound} ${found.value}` } : found;
}

function tile(one) {
  const isKnown = one.text != null, isBound = isKnown && one.bound, { value, sigma, unit } = isKnown ? parts(one, "≥") : { value: "–", sigma: "", unit: "" };
  const says = isKnown ? one.remark : one.why, isDoubtful = isKnown && says && !isBound;
  const reason = says ? [el("p", { class: `says ${isDoubtful ? "look" : ""}` }, icon(isDoubtful ? "warn" : "info"), el("span", { text: told(says), title: told(says) }))] : [];
  const interval = sigma ? [el("span", { text: "95 %" }), el("span", { class: "num" }, "± ", el("b", { text: sigma }))] : isBound ? [el("span", { text: t("at least") })] : [];
  return el("section", { class: `tile ${isKnown ? (isDoubtful ? "look" : "") : "stale"}`.trim() }, el("h3", { text: nameOf(one) }), el("span", { class: "age" }),
    el("p", { class: "value" }, el("span", { class: "figure num", text: value }), el("span", { text: unit })), el("p", { class: "sigma" }, ...interval), ...reason);
}

function row(one) {
  if (one.words) return el("li", { class: "row words" }, el("span", { text: nameOf(one) }), el("span", { class: "small", text: told(one.text) }));
  const remark = one.remark ? [el("span", { class: "small", text: told(one.remark) })] : [], { value, sigma, unit } = parts(one, t("at least"));
  return el("li", { class: "row" }, el("span", { text: nameOf(one) }), el("b", { class: "num" }, `${value} ${unit} `, el("small", { text: sigma && `± ${sigma}` })), ...remark);
}

const unknown = (one) => el("li", { class: "row words" }, el("span", { text: nameOf(one) }), el("span", { class: "small", text: told(one.why) }));

function gauge(one) {
  const text = one.value == null ? told(one.reason) || t("lost") : strainText(one.value, one.sigma);
  return el("li", { class: "row" }, el("span", {}, key(one.k), " ", nameOf(one)), el("b", { class: "num", text }));
}

function showFold(name, list, make, words) {
  $(`${name}fold`).hidden = !list.length;
  put($(`${name}count`), `${words}${list.length}`);
  fill($(name === "gauge" ? "gaugeresults" : name), list, make);
}

// The map at the highest force or in the last picture, of the camera that is chosen.
function showMaps() {
  const sides = result.cameras ?? [result], side = sides[chosen.side] ?? result;
  choices($("peakside"), sides.length > 1 ? sides.map((one, k) => [k, t(one.side)]) : [], chosen.side, (k) => { chosen.side = k; });
  const whole = (side.whole ?? []).map((name) => [name, name]);
  const times = [["peak", side.atpeak], ["last", "last picture"], ...whole].filter(([name, words]) => side[name] && words);
  if (!side[chosen.time]) chosen.time = "peak";
  choices($("peaktime"), times.length > 1 ? times.map(([name, words]) => [name, t(words)]) : [], chosen.time, (name) => { chosen.time = name; });
  const shown = side[chosen.time], shot = $("peakmap").closest(".shot");
  shot.hidden = !shown;
  if (!shown) return;
  if (!$("peakmap").src.endsWith(shown.picture)) $("peakmap").src = shown.picture;
  setRatio(shot, shown.width, shown.height);
  drawGauges($("peakgauges"), shown.gauges, shown.width, shown.height);
  const words = t(times.find(([name]) => name === chosen.time)[1]), at = whole.some(([name]) => name === chosen.time) || shown.s == null ? "" : `${time(shown.s)}, `;
  put($("peakwords"), `${at}${side.side ? `${t(side.side)}, ` : ""}${words}`);
  showLegend($("peaklegend"), shown);
}

// A few stand side by side, more in a list.
function choices(box, list, now, choose) {
  const isLong = list.length > 3, take = (value) => { choose(value); showMaps(); };
  box.hidden = !list.length;
  box.className = isLong ? "box" : "segments";
  fill(box, isLong ? [list] : list, isLong ? listed : ([value, words]) => {
    const button = el("button", { type: "button", class: "button" }, el("span", { text: words }));
    button.addEventListener("click", () => take(value));
    return button;
  });
  if (isLong) box.firstChild.value = now;
  else list.forEach(([value], k) => box.children[k].setAttribute("aria-pressed", String(value === now)));

  function listed(all) {
    const select = el("select", { "aria-label": t("Time of the map") }, ...all.map(([value, words]) => el("option", { value, text: words })));
    select.addEventListener("change", () => take(select.value));
    return select;
  }
}

// The report opens in a window of its own, or the page shows why there is none.
function showReport(report) {
  const link = $("report"), isReady = report === true, words = { wait: "The report is being made …", ready: "Open the report", none: "No report" };
  put(link.querySelector("span"), t(report === null ? words.wait : isReady ? words.ready : words.none));
  link.setAttribute("aria-disabled", String(!isReady));
  put($("whynoreport"), typeof report === "string" || report?.say ? told(report) : "");
}
