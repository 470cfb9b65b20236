// After a test: warnings first, then the figures, the curve with its lines, the map at the highest force, the report.
import { $, el, fill, put } from "./base.js";
import { finishCurve, updateCurves } from "./curves.js";
import { drawGauges } from "./draw.js";
import { quantity, short, strainText, strainUnit } from "./numbers.js";
import { t } from "./words.js";

let result = null;
for (const kind of ["unit", "language"]) addEventListener(kind, () => { if (result) show(); });

export async function showAfter(value) {
  result = value;
  show();
  if (value.points) await updateCurves(value.points);
  finishCurve(value.lines ?? []);
}

function show() {
  put($("ended"), t(result.words));
  fill($("troubles"), result.troubles, (text) => el("li", { text: t(text) }));
  document.querySelector(".warnings").hidden = !result.words && !result.troubles.length;
  fill($("results"), [{ head: ["figure", "value", "interval"] }, ...result.figures], row);
  fill($("gaugeresults"), result.gauges.length ? [{ head: ["gauge", result.atpeak, ""] }, ...result.gauges] : [], gaugeRow);
  put($("folder"), result.folder);
  put($("ledger"), t(result.ledger));
  put($("next"), result.next ?? "");
  put($("again"), result.again ?? "");
  finishCurve(result.lines ?? []);
  showPeak(result, result.side ?? "", document.querySelector(".peak"), "");
  showPeak(result.second ?? {}, result.second?.side ?? "", document.querySelector(".peak.second"), "2");
  document.body.classList.toggle("two", Boolean(result.second));
  showReport(result.report);
}

const heads = (head) => el("tr", {}, ...head.map((text) => el("th", { text: t(text), scope: "col" })));

// One line for a figure: its name, its value with unit, its interval; or why it is not known.
function row(one) {
  if (one.head) return heads(one.head);
  const name = el("th", { text: ofSide(one.name.includes(" ") ? t(one.name) : one.name, one), scope: "row" });
  if (one.text == null) return el("tr", { class: "unknown" }, name, el("td", { text: t(one.why), title: t(one.why), colSpan: 2 }));
  if (one.words) return el("tr", {}, name, el("td", { class: "words", text: t(one.text), colSpan: 2 }));
  const remark = one.remark ? [el("span", { class: "words", text: ` ${t(one.remark)}` })] : [];
  if (typeof one.text === "string") return el("tr", {}, name, el("td", { text: one.text, colSpan: 2 }, ...remark));
  const { value, sigma, unit } = quantity(one.text), least = one.bound ? `${t("at least")} ` : "";
  return el("tr", {}, name, el("td", { text: `${least}${value} ${unit}` }, ...remark), el("td", { text: sigma && `± ${sigma}` }));
}

const ofSide = (name, one) => (one.side ? `${name}, ${t(one.side)}` : name);

function gaugeRow(one) {
  if (one.head) return heads(one.head);
  const text = one.value == null ? t(one.reason || "lost") : strainText(one.value, one.sigma);
  return el("tr", {}, el("th", { text: ofSide(one.name, one), scope: "row" }), el("td", { text, colSpan: 2 }));
}

function showPeak({ peak, atpeak }, side, section, suffix) {
  section.hidden = !peak;
  if (!peak) return;
  const of = (name) => $(name + suffix), factor = peak.strain ? strainUnit().factor : 1, unit = peak.strain ? strainUnit().name : peak.unit;
  put(of("peakwords"), `${side ? `${t(side)}: ` : ""}${t(peak.of)}, ${t(atpeak)}`);
  if (!of("peakmap").src.endsWith(peak.picture)) of("peakmap").src = peak.picture;
  drawGauges(of("peakgauges"), peak.gauges, peak.width, peak.height);
  put(of("peakscale"), peak.high == null ? "" : `${short(peak.low * factor)} … ${short(peak.high * factor)} ${unit}`);
}

// The report opens in a window of its own, or the page shows why there is none.
function showReport(report) {
  const link = $("report"), ready = report === true, words = { wait: "The report is being made …", ready: "Open the report", none: "No report" };
  put(link, t(report === null ? words.wait : ready ? words.ready : words.none));
  link.setAttribute("aria-disabled", String(!ready));
  put($("whynoreport"), typeof report === "string" ? t(report) : "");
}

