// The texts of the page and the messages of the program in the language of the operator. The keys of the catalogue
// are the English texts; {} stands for any words, which are translated where the catalogue has them. Names of files,
// devices and settings before a message stay as they are.
const response = await fetch("/static/catalogue.json");
const catalogue = await response.json();
const patterns = Object.keys(catalogue).filter((key) => key.includes("{}"))
  .map((key) => ({ key, weak: key.replaceAll("{}", "").length < 12, form: new RegExp(`^${key.split("{}").map(escaped).join("(.*?)")}$`, "s") }))
  .sort((a, b) => b.key.length - a.key.length);
const SPACED = { fr: " " };  // before a colon and a semicolon
let chosen = "en", found = new Map();

// What was shown without a translation; the tests read it.
export const missing = new Set();
globalThis.untranslated = missing;

function escaped(text) {
  return text.replace(/[.*+?^${}()|[\]\\/]/g, "\\$&");
}

export function t(text) {
  if (chosen === "en" || !text) return text ?? "";
  const words = translated(text);
  if (words == null) missing.add(text);
  return words ?? text;
}

function translated(text) {
  if (!/[A-Za-z]{2}/.test(text)) return text;
  if (!found.has(text)) {
    if (found.size > 5000) found = new Map();
    found.set(text, lookedUp(text));
  }
  return found.get(text);
}

// A whole text, then one after a name, then one that a long pattern fits, then both sides of a separator, then one
// that a short pattern fits with all its parts, then one after any words, such as the name of a camera.
function lookedUp(text) {
  return catalogue[text]?.[chosen] ?? named(text, isName) ?? filled(text, false) ?? separated(text) ?? filled(text, true)
    ?? named(text, () => true);
}

function filled(text, weak) {
  for (const { key, form } of patterns.filter((one) => one.weak === weak)) {
    const parts = form.exec(text)?.slice(1);
    if (!parts || (weak && parts.some((one) => !areNames(one) && translated(one) == null))) continue;
    return catalogue[key][chosen].replace(/\{\}/g, () => part(parts.shift()));
  }
  return null;
}

const isName = (text) => !text.includes(" ") || /[/:]/.test(text);

const areNames = (text) => text.split(", ").every((one) => isName(one.replace(/[\d.]+/g, "").trim()));

function named(text, isName) {
  const at = text.indexOf(": "), left = text.slice(0, Math.max(at, 0));
  return at > 0 && isName(left) && !(left in catalogue) ? joined(left, ": ", translated(text.slice(at + 2))) : null;
}

function separated(text) {
  for (const between of ["; ", ": "]) {
    for (let at = text.indexOf(between); at >= 0; at = text.indexOf(between, at + 1)) {
      const left = translated(text.slice(0, at));
      const whole = left == null ? null : joined(left, between, translated(text.slice(at + between.length)));
      if (whole != null) return whole;
    }
  }
  return null;
}

const joined = (left, between, right) => (right == null ? null : `${left}${SPACED[chosen] ?? ""}${between}${right}`);
const part = (text) => translated(text) ?? text;

export function translate(root = document) {
  for (const element of root.querySelectorAll("[data-t]")) {
    const text = t(element.dataset.t);
    if (element.textContent !== text) element.textContent = text;
  }
  for (const element of root.querySelectorAll("[data-label]")) element.setAttribute("aria-label", t(element.dataset.label));
}

export function language() {
  const stored = localStorage.getItem("language"), own = navigator.language.slice(0, 2);
  return stored ?? (own in catalogue.Cancel ? own : "en");
}

export function setLanguage(name) {
  chosen = name;
  found = new Map();
  localStorage.setItem("language", name);
  document.documentElement.lang = name;
  document.getElementById("language").value = name;
  translate();
  dispatchEvent(new Event("language"));
}
