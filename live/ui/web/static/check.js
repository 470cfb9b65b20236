// The check of the still specimen: three verdicts, its other lines folded, its table; and the button that starts.
import { $, el, fill, put } from "./base.js";
import { icon, putIcon } from "./icons.js";
import { fixed, strainText } from "./numbers.js";
import { t, told } from "./words.js";

const LABELS = { picture: "Picture", force: "Force", disk: "Disk" };
const ICONS = { picture: "camera", force: "force", disk: "disk" };
const PARTS = { "load cell": "force", zero: "force", disk: "disk" };
const nameOf = (line) => line.what?.say ?? line.what, partOf = (line) => PARTS[nameOf(line)] ?? "picture";

export function showCheck(value) {
  const parts = Object.keys(LABELS).filter((part) => value.lines.some((line) => partOf(line) === part));
  fill($("verdicts"), parts.map((part) => verdictOf(part, value)), verdict);
  const shown = parts.map((part) => verdictOf(part, value).line), others = value.lines.filter((line) => !shown.includes(line));
  fill($("remarks"), others.filter((one) => !one.good), line);
  const good = others.filter((one) => one.good);
  fill($("lines"), good, line);
  $("morechecks").closest("details").hidden = !good.length;
  put($("morechecks"), `${t("More checks, all good")}: ${good.length}`);
  const m = value.measure;
  put($("pointsum"), `${t("ZOIs")}: ${m.zoi} px, ${t("Step")} ${m.step} px, ${m.burst} ${t("frames")}`);
  showTable(value);
}

// One figure and one sentence: of what fails, why and what to do; else of the line that stands for the part.
const FIGURES = { picture: "strain noise", force: "load cell", disk: "disk" };
function verdictOf(part, value) {
  const lines = value.lines.filter((line) => partOf(line) === part), bad = lines.find((line) => !line.good);
  const line = bad ?? lines.find((one) => nameOf(one) === FIGURES[part]) ?? lines[0];
  const figure = { picture: value.sigma == null ? "" : strainText(value.sigma), force: value.load?.rate ? `${fixed(value.load.rate)} 1/s` : "", disk: "" }[part];
  return { part, line, figure };
}

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);

function verdict({ part, line: { what, value, good, advice }, figure }) {
  const words = `${sentence(t(what))}: ${told(value)}${good || !advice ? "" : `. ${sentence(t(advice))}`}`;
  return el("section", { class: `verdict ${good ? "good" : "bad"}` }, icon(ICONS[part]), el("h3", { text: t(LABELS[part]) }), el("span", { class: "big num", text: figure }), el("p", { text: words }));
}

const line = (one) => el("li", { class: one.good ? (one.measured ? "" : "open") : "look" },
  el("b", { text: t(one.what) }), el("span", { text: told(one.value) }), ...(one.good ? [] : [el("em", { text: t(one.advice) })]));

// The verdict on all cameras. Without GO the button looks different and has to be pressed twice, with the reason.
export function showStart(values) {
  const button = $("start"), go = allGo(values), isReady = go === true, isChecking = values.some((one) => one.checking);
  put($("verdict"), isChecking ? t("checking …") : go == null ? t("not checked") : go ? "GO" : "NO-GO");
  $("go").className = `go ${go == null ? "open" : go ? "good" : "bad"}`;
  if (!$("go").querySelector(".lamp")) $("go").prepend(el("span", { class: "lamp" }));
  putIcon($("go").firstChild, go == null ? "info" : go ? "check" : "error");
  const side = values.find((one) => one.lines.some((line) => !line.good)), worst = side?.lines.find((one) => !one.good);
  const whose = side?.side ? `${t(side.side)}: ` : "";
  put($("reason"), worst ? `${whose}${t(worst.what)}: ${told(worst.value)}` : "");
  if (!button.classList.contains("armed")) put(button.querySelector("span"), t(isReady ? "Start the test" : go === false ? "Start without GO" : "Start without a check"));
  button.classList.toggle("doubtful", !isReady);
  button.classList.toggle("main", isReady);
  if (isReady) { delete button.dataset.ask; return; }
  button.dataset.ask = go === false ? "Start although the check says NO-GO?" : "Start without a check?";
  button.dataset.because = worst ? `${t(worst.what)}: ${told(worst.value)}` : "Light, focus, noise and load cell have not been checked.";
  button.dataset.yes = "Start anyway";
}

const allGo = (values) => (values.some((one) => one.go === false) ? false : values.every((one) => one.go) ? true : null);

const SIZES = { caption: "strain noise of one ZOI, µm/m, by frames of a burst", size: "VSG" };
function showTable({ table: known, measure, scale }) {
  const mm = scale?.px_per_mm, rows = [];
  if (known) {
    rows.push({ caption: SIZES.caption });
    rows.push({ tag: "th", cells: [["ZOI"], [`${SIZES.size} ${mm ? "mm" : "px"}`], ...known.bursts.map((n) => [n])] });
    for (const one of known.rows) {
      const noise = one.noise.map((v, i) => [fixed(v == null ? null : v * 1e6), one.zoi === measure.zoi && known.bursts[i] === measure.burst]);
      rows.push({ tag: "td", cells: [[one.zoi], [mm ? fixed(one.vsg / mm, 2) : fixed(one.vsg)], ...noise] });
    }
  }
  fill($("table"), rows, ({ caption, tag, cells }) => (caption ? el("caption", { text: t(caption) })
    : el("tr", {}, ...cells.map(([text, here]) => el(tag, { text, class: here ? "here" : "" })))));
}
