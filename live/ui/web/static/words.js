// The texts of the page; the English ones are the keys, each other language is one file.
const FILES = { de: "./words-de.js", fr: "./words-fr.js" };
let translations = {};

export const t = (text) => translations[text] ?? text;

export function translate(root = document) {
  for (const element of root.querySelectorAll("[data-t]")) {
    const text = t(element.dataset.t);
    if (element.textContent !== text) element.textContent = text;
  }
}

export function language() {
  const stored = localStorage.getItem("language");
  return stored ?? (navigator.language.slice(0, 2) in FILES ? navigator.language.slice(0, 2) : "en");
}

export async function setLanguage(name) {
  translations = name in FILES ? (await import(FILES[name])).default : {};
  localStorage.setItem("language", name);
  document.documentElement.lang = name;
  document.getElementById("language").value = name;
  translate();
}
