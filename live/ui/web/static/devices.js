// Camera and load cell by hand: lists of what there is, addresses, format and rate; the live force and its zero.
import { $, change, el, fill, put } from "./base.js";
import { fixed, withSigma } from "./numbers.js";
import { t } from "./words.js";

const OTHER = "another address …", LABELS = { simulated: "simulated", session: "recorded session", none: "none", other: OTHER };
let shown = {};

for (const [select, kind] of [["cameras", "address"], ["loads", "load"]]) {
  $(select).addEventListener("change", (event) => {
    if (event.target.value) change({ do: kind, value: event.target.value });
    else $(kind === "load" ? "loadaddress" : "cameraaddress").focus();
    event.target.blur();
  });
}
$("cameraform").addEventListener("submit", (event) => { event.preventDefault(); change({ do: "address", value: $("cameraaddress").value.trim() }); document.activeElement.blur(); });
$("loadform").addEventListener("submit", (event) => { event.preventDefault(); change({ do: "load", value: $("loadaddress").value.trim() }); document.activeElement.blur(); });
$("format").addEventListener("change", (event) => { change({ do: "option", key: "format", value: event.target.value }); event.target.blur(); });
$("rate").addEventListener("change", (event) => { change({ do: "option", key: "fps", value: event.target.value }); event.target.blur(); });
$("identify").addEventListener("click", () => change({ do: "identify", port: $("loadaddress").value.split("?")[0] }));
$("tab-devices").addEventListener("click", () => { if (!shown.cameras?.length) change({ do: "devices" }); });

export function showDevices(value) {
  const { devices, load } = value;
  shown = devices;
  offer($("cameras"), devices.cameras, value.address);
  offer($("loads"), devices.loads, load.address);
  keep($("cameraaddress"), value.address);
  keep($("loadaddress"), load.address);
  const query = new URLSearchParams(value.address.split("?")[1] ?? "");
  keep($("format"), query.get("format") ?? "");
  keep($("rate"), query.get("fps") ?? "");
  $("rate").placeholder = value.camera?.fps ?? "";
  fill($("formats"), devices.formats, (name) => el("option", { value: name }));
  fill($("camerawarnings"), value.camera?.warnings ?? [], (text) => el("li", { text: t(text) }));
  put($("finding"), t(devices.finding));
  showLoad(load);
}

function showLoad(load) {
  const none = load.address === "none:", [force, noise] = withSigma(load.force_N, load.noise_N, { factor: 1, digits: 1 });
  put($("setupforce"), none ? t("none") : load.force_N == null ? "–" : `${force} N`);
  put($("forcenoise"), none || load.noise_N == null ? "–" : `${noise || fixed(load.noise_N, 1)} N`);
  put($("loadtrouble"), t(load.trouble));
  put($("loadname"), none ? t("no load cell: no force, no stress, no modulus") : load.rate == null ? load.name : `${load.name}, ${load.rate.toPrecision(3)} 1/s`);
  put($("zero"), load.zero_N ? `${t("zero")} ${fixed(load.zero_N, 1)} N` : "");
  $("setupforce").classList.toggle("bad", Boolean(load.trouble));
}

function keep(input, value) {
  if (input !== document.activeElement && input.value !== value) input.value = value;
}

// The address in force is in the list, whether or not it was found.
function offer(select, found, address) {
  if (select === document.activeElement) return;
  const known = found.some((one) => one.address === address) ? found : [{ address, name: "", trouble: "" }, ...found];
  fill(select, [...known, { address: "", name: OTHER }], (one) => {
    const name = Object.values(LABELS).includes(one.name) ? t(one.name) : one.name, trouble = one.trouble ? ` (${t(one.trouble)})` : "";
    return el("option", { value: one.address, text: `${one.address} ${name}${trouble}`.trim() });
  });
  select.value = address;
}
