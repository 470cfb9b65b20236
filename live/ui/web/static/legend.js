// The colours of a map: title with unit, bar, marks and histogram, beside an upright picture and below a wide one.
import { el, fill, put } from "./base.js";
import { make } from "./draw.js";
import { fixed, short, strainUnit } from "./numbers.js";
import { t } from "./words.js";

export const factorOf = (picture) => (picture?.strain ? strainUnit().factor : 1);
export const unitOf = (picture) => (picture.strain ? strainUnit().name : (picture.unit ?? ""));

// Of a picture as the server describes it: of, low, high, unit or strain, histogram, ramp; or the legend of statuses.
export function showLegend(element, picture) {
  const isScaled = picture.high != null, unit = unitOf(picture), factor = factorOf(picture);
  const [title, across, up, , marks, marksUp, statuses] = element.children;
  element.classList.toggle("status", !isScaled);
  element.classList.toggle("diverging", Boolean(picture.diverging));
  if (picture.ramp) element.style.setProperty("--seq", picture.ramp.join(", "));
  put(title, isScaled ? `${t(picture.of)}${unit && `, ${unit}`}` : "");
  const at = (share) => (isScaled ? short((picture.low + share * (picture.high - picture.low)) * factor) : "");
  [0, 0.5, 1].forEach((share, k) => { put(marks.children[k], at(share)); put(marksUp.children[2 - k], at(share)); });
  const bars = picture.histogram ?? [], most = Math.max(...bars, 1);
  across.replaceChildren(...bars.map((n, k) => make("rect", { x: k, y: 10 - (10 * n) / most, width: 1, height: (10 * n) / most })));
  up.replaceChildren(...bars.map((n, k) => make("rect", { x: 10 - (10 * n) / most, y: 23 - k, width: (10 * n) / most, height: 1 })));
  fill(statuses, picture.legend ?? [], (one) => {
    const key = el("i", { class: "key box-key" });
    key.style.background = one.colour;
    return el("li", {}, key, `${fixed(one.count)} ${t(one.text)}`);
  });
}

// The room that a picture takes is of its ratio; one that is not upright has its colours below.
export function setRatio(shot, width, height) {
  if (!(width > 0 && height > 0)) return;
  shot.style.setProperty("--ratio", String(Math.round((1e4 * width) / height) / 1e4));
  if (shot.matches(".shot")) shot.classList.toggle("horizontal", width >= height);
}
