// Numbers for a person. Each quantity has one unit through a test: the operator chooses that of strains.
const DASH = "–", UNITS = { "µm/m": { factor: 1e6, digits: 0 }, "%": { factor: 100, digits: 4 } };

export const fixed = (value, digits = 0) => (value == null ? DASH : value.toFixed(digits).replace("-", "−"));
export const signed = (value, digits = 0) => (value == null ? DASH : (value < 0 ? "−" : "+") + Math.abs(value).toFixed(digits));

export function strainUnit() {
  const name = localStorage.getItem("strain");
  return name in UNITS ? { name, ...UNITS[name] } : { name: "µm/m", ...UNITS["µm/m"] };
}

export function chooseStrainUnit(name) {
  localStorage.setItem("strain", name);
  dispatchEvent(new Event("unit"));
}

// Value and uncertainty as texts: the uncertainty with two digits, the value to the same place.
export function withSigma(value, sigma, { factor, digits }) {
  if (value == null) return [DASH, ""];
  if (!(sigma > 0)) return [signed(value * factor, digits), ""];
  const two = Number((sigma * factor).toPrecision(2)), place = Math.floor(Math.log10(two)) - 1;
  const step = 10 ** place, decimals = Math.max(-place, 0);
  return [signed(Math.round((value * factor) / step) * step, decimals), (Math.round(two / step) * step).toFixed(decimals)];
}

export function strainText(value, sigma) {
  const unit = strainUnit(), [text, two] = withSigma(value, sigma, unit);
  return value == null ? DASH : `${text}${two && ` ± ${two}`} ${unit.name}`;
}

export function time(seconds) {
  const whole = Math.floor(Math.max(seconds ?? 0, 0)), two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  return `${hours ? `${hours}:` : ""}${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
}

// As short as four digits allow, without an exponent for what a person reads.
export function short(value) {
  if (value == null) return DASH;
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(1).replace(/-/g, "−");
  return String(Number(value.toPrecision(4))).replace("-", "−");
}

export const percent = (value) => (value == null ? DASH : value > 0 && value < 1e-4 ? "<0.01 %" : `${(value * 100).toFixed(2)} %`);

// Blue, vermilion, green, purple, ochre, grey, told apart with any colour vision: --c1 to --c6 of phasedic.css, light.
const COLOURS = ["#0060ad", "#bd4a00", "#007a62", "#9a3a80", "#7a5c00", "#56606b"];
// The colour of a gauge over a picture.
export const colourOf = (k) => COLOURS[k % COLOURS.length];
// The same, dark enough for letters on white.
export const inkOf = (k) => `color-mix(in srgb, ${colourOf(k)} 70%, black)`;
