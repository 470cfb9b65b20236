// Icons: symbols of the sprite in index.html, before the words of what names one in data-icon.
import { make } from "./draw.js";

export const icon = (name) => make("svg", { class: "i", "aria-hidden": "true" }, make("use", { href: `#i-${name}` }));

export function addIcons(root = document) {
  for (const element of root.querySelectorAll("[data-icon]")) element.prepend(icon(element.dataset.icon));
}

// One icon in place of another; the element holds nothing else.
export function putIcon(element, name) {
  if (element.dataset.now === name) return;
  element.dataset.now = name;
  element.replaceChildren(icon(name));
}

// The key of a gauge or curve: its colour and its dash, by the index that is stored with it.
const dashOf = (k) => `c${(k % 6) + 1} d${((k + Math.floor(k / 6)) % 6) + 1}`;
export const key = (k) => make("svg", { class: `key ${dashOf(k)}`, viewBox: "0 0 24 12", "aria-hidden": "true" }, make("path", { d: "M1 6h22" }));
