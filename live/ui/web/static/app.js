// The page: receives the events of phasedic, shows the stage, sends commands.
import { $, change, command, post, put } from "./base.js";
import { language, setLanguage, translate } from "./words.js";
import { showRun } from "./run.js";
import { showSetup, setupKeys } from "./setup.js";
import { showAfter } from "./after.js";

const LOST_MS = 2000, CONFIRM_MS = 3000;
let last = performance.now(), stage = {};

const handlers = {
  stage(value) {
    stage = value;
    const changed = document.body.dataset.stage !== value.stage;
    document.body.dataset.stage = value.stage;
    document.body.classList.toggle("alone", value.alone);
    for (const item of $("stages").children) item.classList.toggle("here", item.dataset.of === value.stage);
    if (value.words) { put($("answer"), value.words); $("answer").classList.add("no"); }
    if (changed && value.stage === "run") showRun.begin(value);
    if (changed && value.stage === "setup") showSetup.begin(value);
  },
  setup: (value) => { if (stage.stage === "setup") showSetup(value); },
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
  document.body.classList.toggle("nolink", stage.stage !== "gone" && performance.now() - last > LOST_MS);
}, 200);

// A command that ends something needs a second press.
function confirmed(button) {
  if (!button.dataset.twice || button.classList.contains("confirm")) return true;
  const label = button.querySelector("[data-t]");
  button.classList.add("confirm");
  label.dataset.t0 = label.dataset.t;
  label.dataset.t = "Press again to end";
  translate(button);
  setTimeout(() => { button.classList.remove("confirm"); label.dataset.t = label.dataset.t0; translate(button); }, CONFIRM_MS);
  return false;
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  if (button.dataset.line && confirmed(button)) command(button.dataset.line);
  if (button.dataset.do) change({ do: button.dataset.do });
});

for (const button of document.querySelectorAll("[data-key]")) {
  const key = document.createElement("kbd");
  key.textContent = button.dataset.key;
  button.append(key);
}

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input:not([type=range]):not([type=checkbox]), select")) return;
  if (stage.stage === "setup" && setupKeys(event)) return;
  const button = $(stage.stage)?.querySelector(`[data-key="${CSS.escape(event.key)}"]`);
  if (button && !button.disabled) { event.preventDefault(); button.click(); }
  if (event.key === "n" && stage.stage === "run") { event.preventDefault(); $("notetext").focus(); }
});

$("note").addEventListener("submit", async (event) => {
  event.preventDefault();
  const text = $("notetext").value.trim();
  if (text && (await command(`note ${text}`)).startsWith("ok")) { $("notetext").value = ""; $("notetext").blur(); }
});
$("notetext").addEventListener("keydown", (event) => { if (event.key === "Escape") event.target.blur(); });
$("viewer").addEventListener("click", () => post("/viewer", {}));

function theme(name) {
  document.documentElement.dataset.theme = name;
  localStorage.setItem("theme", name);
  showRun.theme();
}
$("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
$("language").addEventListener("change", (event) => setLanguage(event.target.value));
theme(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
await setLanguage(language());
connect();
