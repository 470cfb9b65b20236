// The page: receives the events of phasedic, shows the stage, sends commands.
import { $, change, command, el, post, put } from "./base.js";
import { addIcons } from "./icons.js";
import { ask, pause } from "./press.js";
import { isExpert, language, setExpert, setLanguage, t, told } from "./words.js";
import { themeChanged } from "./curves.js";
import { fixed } from "./numbers.js";
import { beginRun, linkLost, showRun } from "./run.js";
import { beginSetup, openStep, sectionOf, showSetup } from "./setup.js";
import { setupKeys } from "./drawing.js";
import { showAfter } from "./after.js";

const LOST_MS = 2000;
let last = performance.now(), stage = {};

// A refused Start stands in red until something changes on which it depends.
const ON_START = ["camera", "trouble", "region", "gauges", "plates", "measure", "scale", "specimen", "metadata", "can"], grounds = new Map();
const allGrounds = () => JSON.stringify([...grounds]);
let refused = null;
function forgetRefused() {
  if ($("answer").textContent === refused.text) { put($("answer"), ""); $("answer").className = ""; }
  refused = null;
}

const handlers = {
  stage(value) {
    const changed = stage.n !== value.n;
    stage = value;
    document.body.dataset.stage = value.stage;
    document.body.classList.toggle("alone", value.alone);
    for (const item of $("stages").children) {
      if (item.dataset.of === value.stage) item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
    }
    if (value.ramp) document.documentElement.style.setProperty("--seq", value.ramp.toReversed().join(", "));
    put($("specimen"), value.what?.specimen ?? "");
    if (value.stage !== "setup") put($("file"), value.what ? [value.what.material, sectionOf(value.what)].filter(Boolean).map((one) => `· ${one}`).join(" ") : "");
    $("failed").hidden = !value.words;
    put($("whyfailed"), told(value.words));
    if (!changed) return;
    if (!value.words) put($("answer"), "");
    pause();
    $(value.stage)?.focus({ preventScroll: true });
    if (value.stage === "run") beginRun(value);
    if (value.stage === "setup") beginSetup(value);
  },
  setup(value) {
    grounds.set(value.side, JSON.stringify(ON_START.map((key) => value[key])));
    if (refused && refused.grounds !== allGrounds()) forgetRefused();
    if (stage.stage === "setup") showSetup(value);
  },
  run: (value) => { if (stage.stage === "run") showRun(value); },
  after: showAfter,
  beat() {},
  gone() {
    source.close();
    if (stage.stage === "after") document.body.classList.add("ended");  // the results stay readable
    else document.body.dataset.stage = "gone";
    stage = { stage: "gone" };
  },
};

// A picture that is not there yet leaves its place empty; the browser would draw a broken one.
document.addEventListener("error", ({ target }) => { if (target.tagName === "IMG") target.removeAttribute("src"); }, true);

let source;
function connect() {
  source = new EventSource("/events");
  for (const [kind, handle] of Object.entries(handlers)) {
    source.addEventListener(kind, (event) => { last = performance.now(); handle(JSON.parse(event.data)); });
  }
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED && stage.stage !== "gone") setTimeout(connect, 1000);
  };
}

setInterval(() => {
  const silent = performance.now() - last, isLost = stage.stage !== "gone" && silent > LOST_MS;
  document.body.classList.toggle("nolink", isLost);
  put($("nolinkage"), isLost ? t("for {} s").replace("{}", fixed(silent / 1e3)) : "");
  if (stage.stage === "run") linkLost(isLost ? silent / 1e3 : 0);
}, 200);

// One command at a time; what needs it is confirmed. A tare under load is refused once, and forced when confirmed. An
// armed button is its own question: another press of it comes here only when that is answered.
let busy = null;
async function order(button, isHeld = false) {
  if (busy && busy === button) return;
  busy = button;
  try {
    const { line, ask: question, because, yes } = button.dataset;
    if (question && !isHeld && !(await ask(question, because ?? "", yes, button))) return;
    const { risk, refused: isRefused } = await command(line);
    if (isRefused && stage.stage === "setup") refused = { grounds: allGrounds(), text: $("answer").textContent };
    if (risk && (await ask("Tare in mid-test?", risk, "Tare", button))) await command("tare force");
  } finally {
    if (busy === button) busy = null;
  }
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  if (button.dataset.line) order(button);
  if (button.dataset.do) change({ do: button.dataset.do });
});
document.addEventListener("held", (event) => { if (event.target.dataset.line) order(event.target, true); });

addIcons();
for (const button of document.querySelectorAll("[data-key]")) {
  button.append(el("kbd", { text: button.dataset.key, "aria-hidden": "true" }));
  button.setAttribute("aria-keyshortcuts", button.dataset.key);
}

document.addEventListener("keydown", (event) => {
  if (event.altKey && !event.ctrlKey && /^[1-4]$/.test(event.key) && stage.stage === "setup") { event.preventDefault(); openStep(Number(event.key) - 1); return; }
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.target.closest("input:not([type=range]):not([type=checkbox]), select")) return;
  if (stage.stage === "setup" && setupKeys(event)) return;
  if (event.key === "n" && stage.stage === "run") { event.preventDefault(); $("notetext").focus(); return; }
  const button = document.querySelector(`[data-part="${stage.stage}"] [data-key="${CSS.escape(event.key)}"]:not([hidden])`);
  if (!button || button.disabled) return;
  event.preventDefault();
  openStep(button); // of the set-up: where the button is
  button.click();
});

$("note").addEventListener("submit", async (event) => {
  event.preventDefault();
  const input = $("notetext"), text = input.value.trim();
  input.blur(); // at once: a key that follows is a command, not a letter of the note
  if (!text) return;
  input.value = "";
  if ((await command(`note ${text}`)).refused && !input.value) input.value = text;
});
$("notetext").addEventListener("keydown", (event) => { if (event.key === "Escape") event.target.blur(); });
$("viewer").addEventListener("click", () => post("/viewer", {}));
$("seen").addEventListener("click", () => { $("failed").hidden = true; });

function theme(name) {
  document.documentElement.dataset.theme = name;
  localStorage.setItem("theme", name);
  themeChanged();
}
$("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
$("language").addEventListener("change", (event) => setLanguage(event.target.value));
$("expert").checked = isExpert();
document.body.classList.toggle("expert", isExpert());
$("expert").addEventListener("change", () => setExpert($("expert").checked));

// The menu closes where anything else is pressed, or with Escape.
const showMenu = (isOpen) => $("menu").setAttribute("aria-expanded", String(isOpen));
document.addEventListener("click", ({ target }) => {
  if (target.closest("#menu")) showMenu($("menu").getAttribute("aria-expanded") !== "true");
  else if (!target.closest("#more")) showMenu(false);
});
document.addEventListener("keydown", (event) => { if (event.key === "Escape") showMenu(false); });
theme(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
await setLanguage(language());
connect();
