// Two cameras: a card for each, with its picture and what it does. The chosen one is shown large.
import { $, el, put } from "./base.js";
import { fixed, strainText } from "./numbers.js";
import { t } from "./words.js";

const latest = { setup: {}, run: {} }, failed = new Set();
let redraw = () => {};

export const chosen = () => document.body.dataset.side ?? "";

// The cameras that have failed; the card of such a one stays as it was, and says so.
export function noteFailed(cameras) {
  for (const one of cameras ?? []) if (one.failed) failed.add(one.side);
}

// Keeps what came of one camera, the first one first; the one to be shown large, or null where that is another.
export function received(stage, value, isSecond) {
  if (!value.side) { showCards(stage); return value; }
  if (isSecond && !all(stage).length) return null;
  latest[stage][value.side] = value;
  if (!(chosen() in latest[stage])) document.body.dataset.side = value.side;
  showCards(stage);
  return value.side === chosen() ? value : null;
}

export function beginViews(stage, again) {
  redraw = again;
  latest[stage] = {};
  failed.clear();
  $(`${stage}views`).replaceChildren();
  if (stage === "run") delete document.body.dataset.side;
}

export const all = (stage) => Object.values(latest[stage]);

function choose(stage, side) {
  document.body.dataset.side = side;
  showCards(stage);
  redraw(latest[stage][side]);
}

function showCards(stage) {
  const box = $(`${stage}views`), known = latest[stage];
  box.hidden = Object.keys(known).length < 2;
  document.body.classList.toggle("two", !box.hidden);
  if (box.hidden) return;
  for (const side of Object.keys(known)) if (!box.querySelector(`[data-view="${side}"]`)) box.append(card(stage, side));
  for (const button of box.querySelectorAll("[data-view]")) showCard(button, stage, known[button.dataset.view]);
}

function card(stage, side) {
  const picture = el("img", { alt: "" }), button = el("button", { type: "button", class: "button" }, picture, el("b", { t: side }), el("span"));
  button.dataset.view = side;
  picture.onload = picture.onerror = () => { delete picture.dataset.busy; };
  button.addEventListener("click", () => choose(stage, side));
  return button;
}

function showCard(button, stage, value) {
  const [picture, , words] = button.children, n = stage === "run" ? value.picture?.n : value.picture;
  button.setAttribute("aria-pressed", String(value.side === chosen()));
  put(words, stage === "run" ? running(value) : verdict(value));
  button.classList.toggle("bad", stage === "run" ? failed.has(value.side) : value.go === false || Boolean(value.trouble));
  if (!n || picture.dataset.n === String(n) || picture.dataset.busy) return;
  Object.assign(picture.dataset, { n, busy: "1" });
  picture.src = `/picture?side=${value.side}&n=${n}`;
}

const verdict = (value) => t(value.trouble) || (value.checking ? t("checking …") : value.go == null ? t("not checked") : value.go ? "GO" : "NO-GO");

function running(value) {
  if (failed.has(value.side)) return t("the camera has failed");
  if (value.zois == null) return "–";
  return `${strainText(value.axial?.value, value.axial?.sigma)} · ${fixed(value.valid)} / ${fixed(value.zois)} ${t("ZOIs")}`;
}
