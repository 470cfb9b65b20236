// What all parts of the page use: elements by name, and what is sent to phasedic.
import { t } from "./words.js";

export const $ = (id) => document.getElementById(id);

// Writes only what has changed, so that nothing is laid out anew.
export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export async function post(path, value) {
  let said;
  try {
    const response = await fetch(path, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(value),
    });
    said = response.ok ? (await response.json()).answer : `no: ${await response.text()}`;
  } catch {
    said = `no: ${t("NO LINK")}`;
  }
  put($("answer"), said === "ok" ? `${value.line ?? value.do ?? value.of ?? ""} ✓` : said);
  $("answer").classList.toggle("no", said.startsWith("no"));
  return said;
}

export const order = (line) => post("/order", { line });
export const change = (value) => post("/setup", value);
