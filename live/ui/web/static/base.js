// Shared by all parts of the page: elements by name, and requests to phasedic.
import { t } from "./words.js";

export const $ = (id) => document.getElementById(id);

// Writes only a changed text, so that the layout is not computed again.
export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export async function post(path, value) {
  let answer;
  try {
    const response = await fetch(path, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(value),
    });
    answer = response.ok ? (await response.json()).answer : `no: ${await response.text()}`;
  } catch {
    answer = `no: ${t("NO LINK")}`;
  }
  put($("answer"), answer === "ok" ? `${value.line ?? value.do ?? value.of ?? ""} ✓` : answer);
  $("answer").classList.toggle("no", answer.startsWith("no"));
  return answer;
}

export const command = (line) => post("/order", { line });
export const change = (value) => post("/setup", value);
