// The texts of the page and the messages of the program in the language of the operator. The entries of a language come
// from live/words: English text or template -> its own. A message has a template (say) and values (with); the page fills
// them in, as acquire/text/message.py does it in English. Names of files, devices and settings stay as they are.
import { decimalMark, fixed, MINUS, quantityText } from "./numbers.js";

const FIELD = /\{\{|\}\}|\{(\w+)(?::([^{}]*))?\}/g;
const tables = { en: {} };
let chosen = "en", entries = {};

// What was shown without a translation; the tests read it.
export const missing = new Set();
globalThis.untranslated = missing;

// A text of the page, or a word of the program that has an entry.
export const t = (text) => (typeof text === "string" && text ? own(text) : told(text));

// What the program tells: messages and quantities in the language of the operator; a name or a text of a user as it is.
export function told(text) {
  if (text?.say != null) return filled(own(text.say), text.with);
  return text?.kind == null ? String(text ?? "") : quantityText(text);
}

function own(code) {
  const text = isExpert() ? code : WORDS[code] ?? code;
  if (chosen === "en") return text;
  if (!(text in entries) && isSentence(text)) missing.add(text);
  return entries[text] ?? text;
}

// What an operator reads in place of codes; "Expert" in the menu shows these. The choice stays with the browser.
const WORDS = {
  ZOIs: "points", "noise of one ZOI": "noise of one point", "Quality of the ZOIs": "Quality of the points",
  eyy: "Strain along the load", exx: "Strain across the load", exy: "Shear strain",
  e1: "Largest principal strain", e2: "Smallest principal strain", u: "Displacement to the right", v: "Displacement downwards",
  sigma: "Uncertainty of a point", residual: "Misfit of a point", status: "State of the points",
  amplification: "Amplification of the strain", compliance: "Strain over stress", rate: "Strain rate of the whole test",
  chi2: "Misfit of the line", leaves_at_stress: "Line ends at this stress",
  leaves_at_strain: "Line ends at this strain",
};
export const isExpert = () => localStorage.getItem("expert") === "1";

export function setExpert(on) {
  localStorage.setItem("expert", on ? "1" : "0");
  document.body.classList.toggle("expert", on);
  translate();
  dispatchEvent(new Event("language"));
}

// Which normal strain is that along the load.
export function setAlong(name = "eyy") {
  const other = name === "exx" ? "eyy" : "exx";
  [WORDS[name], WORDS[other]] = ["Strain along the load", "Strain across the load"];
  translate();
}

// A strain of the region has a code as its name, a gauge the one that it was given.
const isCode = (name) => /^e[xy]{2}$/.test(name);
export const nameOfStrain = (name) => (isCode(name) ? t(name) : name);
export const nameOfRegion = (name) => (isCode(name) && !isExpert() ? t("region") : name);

// Not the name of a file, a device or a setting, nor a list of them.
const isSentence = (text) => text.split(", ").some((one) => one.includes(" ")) && /[a-z]{2,}[,;]? [a-z]{2,}/i.test(text.replace(/\{.*?\}/g, "")) && !/^[\w.-]*[:/]/.test(text);

function filled(template, values) {
  return template.replace(FIELD, (whole, name, format) => (name == null ? whole[0] : shown(values[name], format ?? "")));
}

function shown(value, format) {
  if (typeof value !== "number") return told(value);
  return number(value, format).replace(".", decimalMark());
}

// A number in a format of Python: sign, width, digits, and one of f, g, e, d, x, %.
export function number(value, format) {
  const [, sign, zero, width, digits, kind] = /^(\+?)(0?)(\d*)(?:\.(\d+))?([fgedx%]?)$/.exec(format) ?? [];
  let text = exponent(String(value));
  if (kind === "f" && /^\./.test(format)) return fixed(value, Number(digits));
  if (kind === "f") text = value.toFixed(digits ?? 6);
  else if (kind === "%") text = `${(100 * value).toFixed(digits ?? 6)}%`;
  else if (kind === "e") text = exponent(value.toExponential(digits ?? 6));
  else if (kind === "x") text = value.toString(16);
  else if (kind === "g") text = general(value, Number(digits ?? 6) || 1, format !== "g");
  if (sign && value >= 0) text = `+${text}`;
  if (format.length > 1 && value < 0) text = text.replace("-", MINUS);
  return width ? text.padStart(Number(width), zero ? "0" : " ") : text;
}

function general(value, digits, grouped) {
  if (value === 0) return "0";
  const power = Number(value.toExponential(digits - 1).split("e")[1]);
  if (power < -4 || power > 9) return exponent(value.toExponential(digits - 1).replace(/\.?0+e/, "e"));
  const whole = Number(value.toPrecision(digits));
  if (power >= digits) return grouped ? fixed(whole) : whole.toFixed(0);
  const text = value.toFixed(Math.max(digits - 1 - power, 0));
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

const exponent = (text) => text.replace(/e([+-])(\d)$/, "e$10$2");

export function translate(root = document) {
  for (const element of root.querySelectorAll("[data-t]")) {
    const text = t(element.dataset.t);
    if (element.textContent !== text) element.textContent = text;
  }
  for (const element of root.querySelectorAll("[data-label]")) element.setAttribute("aria-label", t(element.dataset.label));
}

// That of an earlier visit, else the browser's.
export function language() {
  const known = [...document.getElementById("language").options].map((option) => option.value);
  return [localStorage.getItem("language"), navigator.language.slice(0, 2)].find((name) => known.includes(name)) ?? "en";
}

// Without its entries the page stays English.
async function table(name) {
  try {
    const answer = await fetch(`/words/${name}.json`);
    return answer.ok ? await answer.json() : {};
  } catch { return {}; }
}

export async function setLanguage(name) {
  tables[name] ??= await table(name);
  [chosen, entries] = [name, tables[name]];
  localStorage.setItem("language", name);
  document.documentElement.lang = name;
  document.getElementById("language").value = name;
  translate();
  dispatchEvent(new Event("language"));
}
