// Camera and load cell by hand: lists of what there is, addresses, format and rate; the live force and its zero.
import { $, change, el, fill, put } from "./base.js";
import { numberField, onEscape } from "./fields.js";
import { fixed, short, withSigma } from "./numbers.js";
import { t, told } from "./words.js";

let shown = {};

// A choice with the mouse acts at once; with the keyboard on Enter or when the focus leaves, not on the way there.
function onChoice(select, act) {
  let isTyped = false, isPending = false;
  const finish = () => { if (isPending) act(select.value); isPending = false; };
  select.addEventListener("pointerdown", () => { isTyped = false; });
  select.addEventListener("keydown", (event) => { isTyped = true; if (event.key === "Escape") isPending = false; if (event.key === "Enter" && isPending) { event.preventDefault(); finish(); } });
  select.addEventListener("change", () => { isPending = true; if (!isTyped) { finish(); select.blur(); } });
  select.addEventListener("blur", finish);
}

for (const [select, kind, other] of [["cameras", "address", "cameraaddress"], ["loads", "load", "loadaddress"]]) {
  onChoice($(select), (value) => { if (value) change({ do: kind, value }); else $(other).focus(); });
}
$("cameraform").addEventListener("submit", (event) => { event.preventDefault(); change({ do: "address", value: $("cameraaddress").value.trim() }); document.activeElement.blur(); });
$("loadform").addEventListener("submit", (event) => { event.preventDefault(); change({ do: "load", value: $("loadaddress").value.trim() }); document.activeElement.blur(); });
for (const input of [$("cameraaddress"), $("loadaddress")]) onEscape(input, () => input.blur());
onChoice($("format"), (value) => change({ do: "option", key: "format", value }));
const rate = numberField($("rate"), { unit: "1/s", onvalue: (value) => change({ do: "option", key: "fps", value: value ?? "" }) });
$("identify").addEventListener("click", () => change({ do: "identify", port: $("loadaddress").value.split("?")[0] }));

// The settings of each kind of device, as the program declares them. A changed one is written into the address.
let kinds = {};
const now = { camera: "", load: "" }, order = { camera: "address", load: "load" };
fetch("/settings.json").then((answer) => answer.json()).then((found) => { kinds = found; for (const what in now) showKind(what, now[what]); }).catch(() => {});

// The address and its settings; as in acquire/addresses.py, the values of some have question marks.
const PAIR = "(?:(?:pattern|unstable|overload|underload|error|poll)=[^&]*|[A-Za-z_]\\w*=[^&?]*)";
const PARTS = new RegExp(`^(.*?)(?:\\?(${PAIR}(?:&${PAIR})*))?$`);

function withSetting(address, key, value) {
  const [, body, query = ""] = PARTS.exec(address);
  const others = query.split("&").filter((pair) => pair && pair.split("=")[0] !== key);
  if (value) others.push(`${key}=${encodeURIComponent(value)}`);
  return others.length ? `${body}?${others.join("&")}` : body;
}

// A load cell on a line has the settings of its protocol too.
function settingsOf(what, address, given) {
  const found = kinds[what] ?? {}, scheme = /^([A-Za-z][\w+.-]+):/.exec(address)?.[1] ?? "";
  if (what === "load" && (!scheme || address.includes("://"))) return [...found[""] ?? [], ...found[`protocol=${given.get("protocol") ?? "ascii"}`] ?? []];
  return found[scheme] ?? [];
}

function showKind(what, address) {
  now[what] = address;
  const given = new URLSearchParams((PARTS.exec(address)[2] ?? "").replaceAll("+", "%2B")), settings = settingsOf(what, address, given);
  $(`${what}kind`).hidden = !settings.length;
  if ($(`${what}settings`).contains(document.activeElement)) return;
  fill($(`${what}settings`), settings.map((one) => ({ ...one, what, value: given.get(one.key) ?? "" })), settingRow);
}

function settingRow({ what, key, value, words, unit, default: preset }) {
  const input = el("input", { type: "text", maxLength: 80, value, placeholder: preset, autocomplete: "off", "aria-label": `${key} ${t(words)}` });
  input.addEventListener("change", async () => {
    input.blur();
    const answer = await change({ do: order[what], value: withSetting(now[what], key, input.value.trim()) });
    if (answer.refused) input.value = value;
  });
  onEscape(input, () => { input.value = value; input.blur(); });
  const field = key ? el("span", { class: "box" }, input, el("span", { class: "unit", text: unit })) : "";
  return el("tr", {}, el("th", {}, el("span", key ? { text: key } : { t: "others" }), el("small", { t: words })), el("td", {}, field));
}

export function showDevices(value) {
  const { devices, load } = value;
  shown = devices;
  offer($("cameras"), devices.cameras, value.address);
  offer($("loads"), devices.loads, load.address);
  keep($("cameraaddress"), value.address);
  showKind("camera", value.address);
  showKind("load", load.address);
  keep($("loadaddress"), load.address);
  const query = new URLSearchParams(value.address.split("?")[1] ?? "");
  offerFormats(value.camera?.formats ?? [], value.camera?.format ?? "", query.get("format") ?? "");
  rate.show(Number(query.get("fps")) || null);
  $("rate").placeholder = short(value.camera?.fps);
  fill($("rates"), value.camera?.rates ?? [], (rate) => el("option", { value: rate }));
  fill($("camerawarnings"), value.camera?.warnings ?? [], (text) => el("li", { text: told(text) }));
  put($("finding"), told(devices.finding));
  showLoad(load);
}

function showLoad(load) {
  const none = load.address === "none:", [force, noise] = withSigma(load.force_N, load.noise_N, { factor: 1, digits: 1 });
  put($("setupforce"), none ? t("none") : load.force_N == null ? "–" : force);
  put($("forcenoise"), none || load.noise_N == null ? "" : `± ${noise || fixed(load.noise_N, 1)} N`);
  put($("forcerate"), load.rate == null ? "" : `${fixed(load.rate)} 1/s`);
  put($("loadtrouble"), told(load.trouble));
  put($("loadname"), none ? t("no load cell: no force, no stress, no modulus") : load.rate == null ? told(load.name) : `${told(load.name)}, ${fixed(load.rate)} 1/s`);
  put($("zero"), load.zero_N ? `${t("zero")} ${fixed(load.zero_N, 1)} N` : "");
  $("setupforcetile").classList.toggle("stale", Boolean(load.trouble));
  $("setupforce").nextElementSibling.hidden = none;
}

function keep(input, value) {
  if (input !== document.activeElement && input.value !== value) input.value = value;
}

// The formats of the camera; without one in the address the camera is opened with the best.
function offerFormats(formats, now, asked) {
  const select = $("format");
  if (select === document.activeElement) return;
  select.disabled = !formats.length;
  const best = formats.length && !asked ? `${t("automatic")} (${now})` : t(formats.length ? "automatic" : "none");
  fill(select, [{ value: "", text: best }, ...formats.map((name) => ({ value: name, text: name }))], (one) => el("option", one));
  select.value = asked;
}

// The address in force is in the list, whether or not it was found.
function offer(select, found, address) {
  if (select === document.activeElement) return;
  const known = found.some((one) => one.address === address) ? found : [{ address, name: "", trouble: "" }, ...found];
  fill(select, [...known, { address: "", name: "" }], (one) => {
    const name = one.address ? told(one.name) : t("another address …"), trouble = one.trouble ? ` (${told(one.trouble)})` : "";
    return el("option", { value: one.address, text: `${one.address} ${name}${trouble}`.trim() });
  });
  select.value = address;
}
