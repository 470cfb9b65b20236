// What came out.
import { $, put } from "./base.js";
import { t } from "./words.js";

export function showAfter(told) {
  $("results").replaceChildren(...told.figures.map((one) => {
    const box = document.createElement("div"), name = document.createElement("span"), value = document.createElement("output");
    name.textContent = one.name;
    value.textContent = one.text ?? "–";
    const why = document.createElement("em");
    why.textContent = one.why;
    box.append(name, value, why);
    return box;
  }));
  put($("folder"), told.folder);
  put($("ended"), told.words);
  $("summary").replaceChildren(...[...told.lines, told.ledger, ...told.troubles].map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
  $("report").setAttribute("aria-disabled", String(!told.report));
  put($("next"), told.next ?? "");
  if (told.report) $("report").textContent = t("Open the report");
}
