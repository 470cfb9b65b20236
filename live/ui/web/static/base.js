// Shared by all parts of the page: elements, and requests to phasedic.
import { t, told } from "./words.js";

export const $ = (id) => document.getElementById(id);

// Writes only a changed text, so that the layout is not computed again.
export function put(element, text) {
  const words = text?.say != null ? told(text) : text;
  if (element.textContent !== words) element.textContent = words;
}

// A new element: tag, properties (class, text, t: a text to translate, data-...), children.
export function el(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key === "class") element.className = value;
    else if (key === "text") element.textContent = value?.say != null ? told(value) : value;
    else if (key === "t") { if (value?.say == null) element.dataset.t = value; element.textContent = t(value); }
    else if (key.includes("-")) element.setAttribute(key, value);
    else element[key] = value;
  }
  element.append(...children);
  return element;
}

// Replaces the children of a list only where its values have changed; make gives an element for a value.
export function fill(list, values, make) {
  const mark = `${document.documentElement.lang} ${localStorage.getItem("strain")} ${localStorage.getItem("expert")} ${JSON.stringify(values)}`;
  if (list.dataset.mark === mark) return;
  list.dataset.mark = mark;
  list.replaceChildren(...values.map(make));
}

export async function post(path, value) {
  let answer;
  try {
    const response = await fetch(path, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(value),
    });
    answer = response.ok ? await response.json() : { text: t(await response.text()), refused: true };
  } catch {
    answer = { text: t("NO LINK"), refused: true };
  }
  put($("answer"), answer.text ? told(answer.text) : `${t("done")} ✓`);
  $("answer").className = answer.refused ? "no" : "";
  return answer;
}

export const command = (line) => post("/order", { line, stage: document.body.dataset.stage });
export const change = (value) => post("/setup", { side: document.body.dataset.side ?? "", ...value });
