// After a test: figures, summary, report.
import { $, put } from "./base.js";
import { t } from "./words.js";

export function showAfter(result) {
  $("results").replaceChildren(...result.figures.map((one) => {
    const box = document.createElement("div"), name = document.createElement("span"), value = document.createElement("output");
    name.textContent = one.name;
    value.textContent = one.text ?? "–";
    const why = document.createElement("em");
    why.textContent = one.why;
    box.append(name, value, why);
    return box;
  }));
  put($("folder"), result.folder);
  put($("ended"), result.words);
  $("summary").replaceChildren(...[...result.lines, result.ledger, ...result.troubles].map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
  $("report").setAttribute("aria-disabled", String(!result.report));
  put($("next"), result.next ?? "");
  if (result.report) $("report").textContent = t("Open the report");
}
