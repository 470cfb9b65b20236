// Presses act once. A finger that rests or bounces repeats a key, or clicks twice: these are ignored. What ends or
// replaces something is asked for in a dialog, whose buttons work after half a second and lie elsewhere.
import { $, put } from "./base.js";
import { t } from "./words.js";

const ANSWER_MS = 500, PAUSE_MS = 1000, BOUNCE_MS = 300;
let pausing = 0, answer = null;

// After a change of the stage the commands pause: the finger may still be on its way.
export function pause() {
  closeQuestion(false);
  document.body.classList.add("pausing");
  clearTimeout(pausing);
  pausing = setTimeout(() => document.body.classList.remove("pausing"), PAUSE_MS);
}
const isPausing = () => document.body.classList.contains("pausing");

document.addEventListener("click", (event) => {
  const button = event.target.closest?.("button, a.button");
  if (!button) return;
  const again = event.detail > 1 && !button.dataset.often;
  if (again || (isPausing() && button.dataset.line) || button.getAttribute("aria-disabled") === "true") {
    event.preventDefault();
    event.stopImmediatePropagation();
  }
}, true);

const REPEATED = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Tab", "Backspace", "Delete", "z", "y"];
const isTyping = (target) => target.closest?.("input:not([type=range]):not([type=checkbox]), select, textarea");
const lastDown = new Map();
document.addEventListener("keydown", (event) => {
  const before = lastDown.get(event.key), typed = isTyping(event.target) && event.key !== "Enter";
  lastDown.set(event.key, event);
  if (typed || REPEATED.includes(event.key)) return;
  if (event.repeat || (before?.target === event.target && event.timeStamp - before.timeStamp < BOUNCE_MS)) {
    event.preventDefault();
    event.stopImmediatePropagation();
  }
}, true);

// Whether the operator confirms; false where the dialog is closed, or the stage changes.
export function ask(question, because, yes) {
  closeQuestion(false);
  const dialog = $("ask"), buttons = [$("no"), $("yes")];
  put($("question"), t(question));
  put($("because"), t(because));
  put($("yes").firstElementChild, t(yes));
  for (const button of buttons) button.disabled = true;
  dialog.showModal();
  return new Promise((resolve) => {
    answer = resolve;
    setTimeout(() => {
      if (answer !== resolve) return;
      for (const button of buttons) button.disabled = false;
      $("no").focus();
    }, ANSWER_MS);
  });
}

function closeQuestion(value) {
  $("ask").close();
  answer?.(value);
  answer = null;
}

$("yes").addEventListener("click", () => closeQuestion(true));
$("no").addEventListener("click", () => closeQuestion(false));
$("ask").addEventListener("close", () => { if (answer) closeQuestion(false); });
$("ask").addEventListener("keydown", (event) => {
  event.stopPropagation();
  if (event.key === "y" && !$("yes").disabled) closeQuestion(true);
});
