// Numbers for a person, by the rules of acquire/text/quantity.py; one table of cases holds both. The operator chooses
// the unit of the strains of a test; what has none is told in the one for its size.
export const MINUS = "−";
const DASH = "–", GAP = "\u202f", LIVE_DIGITS = 5, MOST_DECIMALS = 6, WHOLE = 1e15, COMMA = ["de", "fr"];
// Name, size in SI, magnitude from which on it is taken, decimals of a value without an uncertainty.
const UNITS = {
  "": [["", 1, 0, 3]],
  share: [["%", 1e-2, 0, 2]],
  strain: [["µm/m", 1e-6, 0, 0], ["%", 1e-2, 1e-2, 4]],
  force: [["N", 1, 0, 1], ["kN", 1e3, 1e4, 3]],
  stress: [["MPa", 1e6, 0, 1], ["GPa", 1e9, 1e10, 2]],
  time: [["s", 1, 0, 1], ["min", 60, 120, 1]],
  rest: [["min", 60, 0, 0], ["h", 3600, 36e3, 0]],
  delay: [["ms", 1e-3, 0, 0]],
  length: [["mm", 1e-3, 0, 2]],
  pixels: [["px", 1, 0, 2]],
  size: [["MB", 1e6, 0, 1], ["GB", 1e9, 1e9, 2]],
  count: [["", 1, 0, 0]],
};

export function unitOf(kind, size, name) {
  const all = UNITS[kind], named = all.filter((one) => one[0] === name), fit = all.filter((one) => Math.abs(size) >= one[2]);
  const [unit, one, , decimals] = [named, fit, all.slice(0, 1)].find((some) => some.length).at(-1);
  return { name: unit, factor: 1 / one, digits: decimals };
}

export const decimalMark = () => (COMMA.includes(document.documentElement.lang) ? "," : ".");

// To so many decimals, negative ones of tens; three digits a group, the decimal mark of the language.
export function fixed(value, decimals = 0) {
  if (!Number.isFinite(value)) return DASH;
  const size = Math.abs(value), step = 10 ** -decimals;
  const shown = decimals < 0 ? Math.round(size / step) * step : size;
  const [whole, part] = (size < WHOLE ? shown.toFixed(Math.max(decimals, 0)) : size.toExponential(3)).split(".");
  const text = whole.replace(/\B(?=(\d{3})+$)/g, GAP) + (part ? decimalMark() + part : "");
  return value < 0 && /[1-9]/.test(text) ? MINUS + text : text;
}

const placesOf = (size, digits) => digits - 1 - Number(size.toExponential(digits - 1).split("e")[1]);

// The decimals of a number with four digits, without zeros at its end.
const shortest = (value) => Math.max(placesOf(value, 4) - /0*$/.exec(value.toExponential(3).split("e")[0])[0].length, 0);

// Value and uncertainty as texts, to the place of the first digit of the uncertainty of a live figure, of the second
// of a result; ``decimals`` are those of a value without.
export function withSigma(value, sigma, { factor, digits: decimals }, digits = 1) {
  if (!Number.isFinite(value)) return [DASH, ""];
  const known = Number.isFinite(sigma) && sigma > 0, shown = value * factor, half = sigma * factor;
  if (known || digits > 1) decimals = Math.min(known ? placesOf(half, digits) : shortest(shown), MOST_DECIMALS);
  if (digits === 1) decimals = Math.min(decimals, Math.max(0, LIVE_DIGITS - Math.abs(shown).toFixed(0).length));
  const last = 10 ** -decimals, small = half < last / 2;
  return [fixed(shown, decimals), known ? (small ? "< " : "") + fixed(small ? last : half, decimals) : ""];
}

// The parts of a quantity as the program sends it.
export function quantity({ kind, value, sigma, digits = 1, unit = "" }) {
  const one = unitOf(kind, value, unit), [text, half] = withSigma(value, sigma, one, digits);
  return { value: text, sigma: half, unit: one.name };
}

export function quantityText(given) {
  const { value, sigma, unit } = quantity(given);
  return `${value}${sigma && ` ± ${sigma}`} ${unit}`.trim();
}

export function strainUnit() {
  const name = localStorage.getItem("strain");
  return unitOf("strain", 0, name);
}

export function chooseStrainUnit(name) {
  localStorage.setItem("strain", name);
  dispatchEvent(new Event("unit"));
}

export function strainText(value, sigma) {
  const unit = strainUnit(), [text, half] = withSigma(value, sigma, unit);
  return Number.isFinite(value) ? `${text}${half && ` ± ${half}`} ${unit.name}` : DASH;
}

export function time(seconds) {
  const whole = Math.floor(Math.max(seconds ?? 0, 0)), two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  return `${hours ? `${hours}:` : ""}${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
}

// 2.5·10⁻⁴, or (2.5 ± 0.3)·10⁻⁴: one form for all rates.
export function powered(value, sigma = 0) {
  const most = Math.max(Math.abs(value), sigma);
  if (most === 0) return "0";
  const power = Math.floor(Math.log10(most)), one = 10 ** power;
  const above = [...String(power)].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c])).join("");
  const text = sigma < 0.05 * one ? fixed(value / one, 1) : `(${fixed(value / one, 1)} ± ${fixed(sigma / one, 1)})`;
  return `${text}·10${above}`;
}

// As short as four digits allow, without an exponent for what a person reads.
export function short(value) {
  if (!Number.isFinite(value)) return DASH;
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return powered(value);
  return fixed(value, (String(Number(value.toPrecision(4))).split(".")[1] ?? "").length);
}

export const percent = (value) => (Number.isFinite(value) ? (value > 0 && value < 1e-4 ? `< ${fixed(0.01, 2)} %` : `${fixed(value * 100, 2)} %`) : DASH);

// Blue, vermilion, green, purple, ochre, grey, told apart with any colour vision: --c1 to --c6 of phasedic.css, light.
const COLOURS = ["#0060ad", "#bd4a00", "#007a62", "#9a3a80", "#7a5c00", "#56606b"];
// The colour of a gauge over a picture.
export const colourOf = (k) => COLOURS[k % COLOURS.length];
// The same, dark enough for letters on white.
export const inkOf = (k) => `color-mix(in srgb, ${colourOf(k)} 70%, black)`;
