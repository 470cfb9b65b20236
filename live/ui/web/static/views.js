// Several cameras: a card for each, with its picture and what it does. The chosen one is shown large.
import { $, el, fill, put } from "./base.js";
import { fixed, strainText } from "./numbers.js";
import { t, told } from "./words.js";

const latest = { setup: {}, run: {} }, failed = new Set();
let redraw = () => {}, names = [""];

// Their names, the first one first.
export const cameras = () => names;

export const chosen = () => document.body.dataset.side ?? "";

// The cameras that have failed; the card of such a one stays as it was, and says so.
export function noteFailed(cameras) {
  for (const one of cameras ?? []) if (one.failed) failed.add(one.side);
}

// Keeps what came of one camera; the one to be shown large, or null where that is another.
export function received(stage, value) {
  if (!value.side) { showCards(stage); return value; }
  if (!names.includes(value.side)) return null; // of a test before
  latest[stage][value.side] = value;
  if (!names.includes(chosen())) [document.body.dataset.side] = names;
  showCards(stage);
  return value.side === chosen() ? value : null;
}

export function beginViews(stage, every = [""], again) {
  [redraw, names] = [again, every];
  latest[stage] = {};
  failed.clear();
  fill($(`${stage}views`), [], card);
  if (stage === "run" || !names.includes(chosen())) delete document.body.dataset.side;
  showCards(stage);
}

export const all = (stage) => names.filter((one) => one in latest[stage]).map((one) => latest[stage][one]);

function choose(stage, side) {
  document.body.dataset.side = side;
  showCards(stage);
  redraw(latest[stage][side]);
}

function showCards(stage) {
  const box = $(`${stage}views`), known = all(stage);
  box.hidden = known.length < 2;
  if (box.hidden) return;
  fill(box, known.map((one) => one.side), (side) => card(stage, side));
  known.forEach((one, i) => showCard(box.children[i], stage, one));
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

const verdict = (value) => told(value.trouble) || (value.checking ? t("checking …") : value.go == null ? t("not checked") : value.go ? "GO" : "NO-GO");

function running(value) {
  if (failed.has(value.side)) return t("the camera has failed");
  if (value.zois == null) return "–";
  return `${strainText(value.axial?.value, value.axial?.sigma)} · ${fixed(value.valid)} / ${fixed(value.zois)} ${t("ZOIs")}`;
}
