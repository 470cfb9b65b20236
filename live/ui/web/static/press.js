// Presses act once. A finger that rests or bounces repeats a key, or clicks twice: these are ignored. What ends or
// replaces something is confirmed in place: the first press arms the button, the second one acts, half a second later
// or more; so does holding it for a second. Escape, four seconds, or another stage disarms it.
import { $, put } from "./base.js";
import { t } from "./words.js";

const LEAST_MS = 500, ARMED_MS = 4000, HOLD_MS = 1000, PAUSE_MS = 1000, BOUNCE_MS = 300;
let pausing = 0, armed = null, pressed = null, swallowed = null, holding = 0;

// After a change of the stage the commands pause: the finger may still be on its way.
export function pause() {
  disarm(false);
  document.body.classList.add("pausing");
  clearTimeout(pausing);
  pausing = setTimeout(() => document.body.classList.remove("pausing"), PAUSE_MS);
}
const isPausing = () => document.body.classList.contains("pausing");

document.addEventListener("click", (event) => {
  const button = event.target.closest?.("button, a.button");
  if (!button) return;
  const again = event.detail > 1 && !button.dataset.often;
  if (again || (isPausing() && button.dataset.line) || button.getAttribute("aria-disabled") === "true" || swallowed === button) return stop(event);
  pressed = button;
  if (armed?.button !== button) return disarm(false);
  stop(event);
  if (performance.now() - armed.since >= LEAST_MS) disarm(true);
}, true);

function stop(event) {
  event.preventDefault();
  event.stopImmediatePropagation();
}

const REPEATED = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Tab", "Backspace", "Delete", "z", "y"];
const isTyping = (target) => target.closest?.("input:not([type=range]):not([type=checkbox]), select, textarea");
const lastDown = new Map();
document.addEventListener("keydown", (event) => {
  const before = lastDown.get(event.key), typed = isTyping(event.target) && event.key !== "Enter";
  lastDown.set(event.key, event);
  if (event.key === "Escape" && armed) { disarm(false); return stop(event); }
  if (typed || REPEATED.includes(event.key)) return;
  if (event.repeat || (before?.target === event.target && event.timeStamp - before.timeStamp < BOUNCE_MS)) stop(event);
}, true);

// Whether the operator confirms by another press of the button that was pressed, or by holding it; false where it is
// disarmed.
export function ask(question, because, yes, button = pressed) {
  disarm(false);
  const words = button.querySelector("span"), usual = [...words.childNodes];
  words.replaceChildren(`${t("Press again")}: ${t(yes)}`);
  button.classList.add("armed");
  $("answer").className = "asks";
  put($("answer"), `${t(question)} ${t(because)}`);
  return new Promise((resolve) => {
    armed = { button, words, usual, resolve, since: performance.now(), timer: setTimeout(() => disarm(false), ARMED_MS) };
  });
}

function disarm(confirmed) {
  if (!armed) return;
  const { button, words, usual, resolve, timer } = armed;
  armed = null;
  clearTimeout(timer);
  clearTimeout(holding);
  words.replaceChildren(...usual);
  button.classList.remove("armed", "holding");
  $("answer").className = "";
  put($("answer"), "");
  resolve(confirmed);
}

// Held for a second it acts without a second press; the click of letting go is none.
document.addEventListener("pointerdown", (event) => {
  const button = event.target.closest?.("button[data-ask]");
  if (!button || button.disabled || event.button !== 0 || isPausing()) return;
  button.classList.add("holding");
  holding = setTimeout(() => {
    swallowed = button;
    if (armed?.button === button) disarm(true);
    else button.dispatchEvent(new CustomEvent("held", { bubbles: true }));
  }, HOLD_MS);
});
for (const kind of ["pointerup", "pointercancel"]) {
  document.addEventListener(kind, () => {
    clearTimeout(holding);
    setTimeout(() => { swallowed = null; }, 100);
    for (const one of document.querySelectorAll(".holding")) one.classList.remove("holding");
  });
}
