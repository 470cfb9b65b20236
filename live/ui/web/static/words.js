// The texts of the page and the messages of the program in the language of the operator. The keys of the catalogue
// are the English texts; {} stands for any words, which are translated where the catalogue has them.
const response = await fetch("/static/catalogue.json");
const catalogue = await response.json();
const patterns = Object.keys(catalogue).filter((key) => key.includes("{}"))
  .map((key) => ({ key, weak: key.replaceAll("{}", "").length < 12, form: new RegExp(`^${key.split("{}").map(escaped).join("(.+?)")}$`, "s") }))
  .sort((a, b) => b.key.length - a.key.length);
let chosen = "en", found = new Map();

// What was shown without a translation; the tests read it.
export const missing = new Set();
globalThis.untranslated = missing;

function escaped(text) {
  return text.replace(/[.*+?^${}()|[\]\\/]/g, "\\$&");
}

export function t(text) {
  if (chosen === "en" || !text) return text ?? "";
  if (!found.has(text)) {
    if (found.size > 5000) found = new Map();
    const words = translated(text);
    if (words == null && /[A-Za-z]{2}/.test(text)) missing.add(text);
    found.set(text, words ?? text);
  }
  return found.get(text);
}

// A whole text, then one that a long pattern fits, then both sides of a separator, then any pattern.
function translated(text) {
  return catalogue[text]?.[chosen] ?? filled(text, false) ?? separated(text) ?? filled(text, true);
}

function filled(text, weak) {
  for (const { key, form } of patterns.filter((one) => one.weak === weak)) {
    const parts = form.exec(text);
    if (!parts) continue;
    let k = 0;
    return catalogue[key][chosen].replace(/\{\}/g, () => part(parts[++k]));
  }
  return null;
}

function separated(text) {
  for (const between of ["; ", ": "]) {
    for (let at = text.indexOf(between); at >= 0; at = text.indexOf(between, at + 1)) {
      const left = translated(text.slice(0, at)), right = left == null ? null : translated(text.slice(at + between.length));
      if (right != null) return `${left}${between}${right}`;
    }
  }
  return null;
}

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
