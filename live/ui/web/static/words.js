// The texts of the page and the messages of the program in the language of the operator. The keys of the catalogue
// are the English texts; {} stands for any words, which are translated where the catalogue has them. Names of files,
// devices and settings before a message stay as they are.
const response = await fetch("/static/catalogue.json");
const catalogue = await response.json();
const patterns = Object.keys(catalogue).filter((key) => key.includes("{}"))
  .map((key) => ({ key, weak: key.replaceAll("{}", "").length < 12, form: new RegExp(`^${key.split("{}").map(escaped).join("(.*?)")}$`, "s") }))
  .sort((a, b) => b.key.length - a.key.length);
const SPACED = { fr: " " };  // before a colon and a semicolon
const FIELD = /\{\{|\}\}|\{(\w+)(?::([^{}]*))?\}/g;  // as in acquire/text/message.py
const tables = { en: {} };  // language -> English template -> its own
let chosen = "en", entries = {}, found = new Map();

// What was shown without a translation; the tests read it.
export const missing = new Set();
globalThis.untranslated = missing;

function escaped(text) {
  return text.replace(/[.*+?^${}()|[\]\\/]/g, "\\$&");
}

// A text, or a message of the program: a template (say) and its values (with).
export function t(text) {
  if (text?.say != null) return said(text.say, text.with);
  if (chosen === "en" || !text) return text ?? "";
  if (text in entries) return entries[text];
  const words = translated(text);
  if (words == null) missing.add(text);
  return words ?? text;
}

function said(template, values) {
  const own = chosen === "en" ? template : entries[template];
  if (own != null) return filledIn(own, values, shown);
  const english = filledIn(template, values, (value, format) => (typeof value === "number" ? number(value, format) : inEnglish(value)));
  return t(english);
}

const inEnglish = (value) => (value?.say != null ? filledIn(value.say, value.with, (one, format) => (typeof one === "number" ? number(one, format) : inEnglish(one))) : String(value));
const filledIn = (template, values, show) => template.replace(FIELD, (whole, name, format) => (name == null ? whole[0] : show(values[name], format ?? "")));

function shown(value, format) {
  if (typeof value !== "number") return typeof value === "boolean" ? String(value) : t(value);
  const text = number(value, format);
  return chosen === "en" || Number.isInteger(value) && !format ? text : text.replace(".", ",");
}

// A number in a format of Python: sign, width, digits, and one of f, g, e, d, x, %.
export function number(value, format) {
  const [, sign, zero, width, digits, kind] = /^(\+?)(0?)(\d*)(?:\.(\d+))?([fgedx%]?)$/.exec(format) ?? [];
  let text = String(value);
  if (kind === "f") text = value.toFixed(digits ?? 6);
  else if (kind === "%") text = `${(100 * value).toFixed(digits ?? 6)}%`;
  else if (kind === "e") text = exponent(value.toExponential(digits ?? 6));
  else if (kind === "x") text = value.toString(16);
  else if (kind === "g") text = general(value, Number(digits ?? 6) || 1);
  if (sign && value >= 0) text = `+${text}`;
  return width ? text.padStart(Number(width), zero ? "0" : " ") : text;
}

function general(value, digits) {
  if (value === 0) return "0";
  const power = Number(value.toExponential(digits - 1).split("e")[1]);
  if (power < -4 || power >= digits) return exponent(value.toExponential(digits - 1).replace(/\.?0+e/, "e"));
  const text = value.toFixed(Math.max(digits - 1 - power, 0));
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

const exponent = (text) => text.replace(/e([+-])(\d)$/, "e$10$2");

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

async function table(name) {
  try {
    const answer = await fetch(`/words/${name}.json`);
    return answer.ok ? await answer.json() : {};
  } catch { return {}; }
}

export async function setLanguage(name) {
  tables[name] ??= await table(name);
  [chosen, entries] = [name, tables[name]];
  found = new Map();
  localStorage.setItem("language", name);
  document.documentElement.lang = name;
  document.getElementById("language").value = name;
  translate();
  dispatchEvent(new Event("language"));
}
