// The words of the page; English ones are the keys, another language is one file.
const FILES = { de: "./words-de.js", fr: "./words-fr.js" };
let known = {};

export const t = (words) => known[words] ?? words;

export function translate(root = document) {
  for (const element of root.querySelectorAll("[data-t]")) {
    const words = t(element.dataset.t);
    if (element.textContent !== words) element.textContent = words;
  }
}

export function language() {
  const stored = localStorage.getItem("language");
  return stored ?? (navigator.language.slice(0, 2) in FILES ? navigator.language.slice(0, 2) : "en");
}

export async function setLanguage(name) {
  known = name in FILES ? (await import(FILES[name])).default : {};
  localStorage.setItem("language", name);
  document.documentElement.lang = name;
  document.getElementById("language").value = name;
  translate();
}
