// The check of the still specimen: its verdict, its lines and its table; and the button that starts the test.
import { $, el, fill, put } from "./base.js";
import { fixed } from "./numbers.js";
import { t } from "./words.js";

export function showCheck(value) {
  const sorted = [...value.lines].sort((a, b) => a.good - b.good);
  fill($("lines"), sorted, (one) => el("li", { class: one.good ? (one.measured ? "" : "open") : "look" },
    el("b", { text: t(one.what) }), el("span", { text: ` ${t(one.value)}` }), el("em", { text: one.good ? "" : t(one.advice) })));
  showTable(value);
}

// The verdict on all cameras. Without GO the button looks different and asks first, with the reason.
export function showStart(values) {
  const verdict = $("verdict"), button = $("start"), go = allGo(values), ready = go === true;
  put(verdict, values.some((one) => one.checking) ? t("checking …") : go == null ? t("not checked") : go ? "GO" : "NO-GO");
  verdict.className = go == null ? "" : go ? "go" : "nogo";
  const side = values.find((one) => one.lines.some((line) => !line.good)), worst = side?.lines.find((one) => !one.good);
  const whose = side?.side ? `${t(side.side)}: ` : "";
  put($("reason"), worst ? `${whose}${t(worst.what)}: ${t(worst.value)}` : "");
  put(button.firstElementChild, t(ready ? "Start the test" : "Start without GO"));
  button.classList.toggle("doubtful", !ready);
  if (ready) { delete button.dataset.ask; return; }
  button.dataset.ask = go === false ? "Start although the check says NO-GO?" : "Start without a check?";
  button.dataset.because = worst ? `${worst.what}: ${worst.value}` : "Light, focus, noise and load cell have not been checked.";
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
      rows.push({ tag: "td", cells: [[one.zoi], [mm ? (one.vsg / mm).toFixed(2) : one.vsg.toFixed(0)], ...noise] });
    }
  }
  fill($("table"), rows, ({ caption, tag, cells }) => (caption ? el("caption", { text: t(caption) })
    : el("tr", {}, ...cells.map(([text, here]) => el(tag, { text, class: here ? "here" : "" })))));
}
