// One kind of field for a number: a text with a decimal comma or point, groups of three, and a unit typed along. A text
// that is no number changes nothing: the field says so, and what is kept. Arrows and the wheel change nothing either.
import { el, put } from "./base.js";
import { decimalMark } from "./numbers.js";
import { t } from "./words.js";

// Units that may be typed, by the unit of the field, and what they are of it.
const LENGTHS = { mm: 1, cm: 10, m: 1000, "µm": 1e-3, um: 1e-3, in: 25.4, inch: 25.4, '"': 25.4, "″": 25.4 };
const STRAINS = { "µm/m": 1, "um/m": 1, "µε": 1, "%": 1e4 };
const UNITS = {
  mm: LENGTHS, "1/s": { "1/s": 1, "/s": 1, hz: 1, fps: 1 }, "µm/m": STRAINS,
  "%": Object.fromEntries(Object.entries(STRAINS).map(([name, factor]) => [name, factor / 1e4])),
};
const WORDS = {
  read: "“{text}” read as {value}",
  mm: "“{text}” is not a length; {kept} is kept",
  number: "“{text}” is not a number; {kept} is kept",
  whole: "“{text}” is not a whole number; {kept} is kept",
  refused: "{why}: {kept} is kept",
  nothing: "no value",
  missing: "a number is missing here",
};

// The value of a text in the unit of its field: a number, null for an empty text, NaN where it is neither.
export function readNumber(text, unit = "") {
  const plain = text.replaceAll("μ", "µ").replace(/[−–]/g, "-").replace(/[\s'’]+/g, " ").trim();
  if (!plain) return null;
  const [, digits, name] = /^([-+]?[\d., ]*(?:e[-+]?\d+)?) ?(.*)$/is.exec(plain);
  const value = Number(withPoint(digits.trim()) ?? NaN), known = UNITS[unit] ?? { [unit]: 1 };
  const factor = name === "" ? 1 : known[name] ?? (name.length > 1 ? known[name.toLowerCase()] : undefined);
  return Number.isFinite(value * factor) ? Number((value * factor).toPrecision(12)) : NaN;
}

// One mark is a decimal mark, whichever it is; two of a kind, or another before it, are groups of three.
function withPoint(digits) {
  const grouped = [/^[-+]?\d{1,3}( \d{3})+([.,]\d*)?$/, /^[-+]?\d{1,3}(,\d{3})+\.\d*$/, /^[-+]?\d{1,3}(\.\d{3})+,\d*$/, /^[-+]?\d{1,3}([.,])\d{3}(\1\d{3})+$/];
  const group = [/ /g, /,/g, /\./g, /[.,]/g][grouped.findIndex((one) => one.test(digits))];
  const text = (group ? digits.replace(group, "") : digits).replace(",", ".");
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(text) ? text : null;
}

// A number as it is typed in the language of the page: no groups, no more digits than it has.
export const typed = (value) => (value == null ? "" : String(Number(value.toPrecision(12))).replace(".", decimalMark()));

// Calls for Escape while an element, or what is in it, has the focus.
export function onEscape(element, act) {
  element.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    event.stopPropagation();
    act();
  });
}

// Makes a text field one for a number. `unit` is that of the value, a text or a function; `onvalue` gets a number, or
// null where an optional field was emptied, and may answer { refused, text }. Returns
//   show(value): what the program has in force; a refused text stays until that changes,
//   read(): the number for a form, null where it is refused or missing.
export function numberField(input, { unit = "", isWhole = false, isRequired = false, onvalue } = {}) {
  const unitNow = () => (typeof unit === "function" ? unit() : unit);
  const box = input.closest(".field") ?? input.closest("label") ?? input.parentElement;
  const says = box.querySelector(".says") ?? box.appendChild(el("small", { class: "says", role: "status" }));
  let kept = null, shown = null, isSending = false;
  Object.assign(input, { type: "text", inputMode: "decimal", autocomplete: "off", spellcheck: false });

  function say(kind, words = "") {
    box.classList.toggle("wrong", kind === "wrong");
    box.classList.toggle("right", kind === "right");
    input.setAttribute("aria-invalid", String(kind === "wrong"));
    put(says, words);
  }
  const withUnit = (value) => (value == null ? t(WORDS.nothing) : `${typed(value)} ${unitNow()}`.trim());
  const refuse = (say_, values) => say("wrong", t({ say: say_, with: { kept: withUnit(kept), ...values } }));

  // What the text says, told where it differs from the text; undefined where it is refused.
  function understood() {
    const text = input.value.trim(), value = readNumber(text, unitNow());
    if (value == null) {
      say(isRequired ? "wrong" : "", isRequired ? t(WORDS.missing) : "");
      return isRequired ? undefined : null;
    }
    if (Number.isNaN(value)) { refuse(WORDS[unitNow()] ?? WORDS.number, { text }); return undefined; }
    if (isWhole && !Number.isInteger(value)) { refuse(WORDS.whole, { text }); return undefined; }
    const isPlain = /^[-+−]?[\d.,]+$/.test(text) && Number(text.replace(/[.,]/g, (one) => (one === decimalMark() ? "." : "x")).replace("−", "-")) === value;
    input.value = typed(value);
    say(isPlain ? "" : "right", isPlain ? "" : t({ say: WORDS.read, with: { text, value: withUnit(value) } }));
    return value;
  }

  function show(value) {
    if (isSending) return;
    kept = value ?? null;
    if (kept !== shown && input !== document.activeElement) write();
  }

  function write() {
    input.value = typed(kept);
    shown = kept;
    say("");
  }

  input.addEventListener("input", () => say(""));
  if (onvalue) onEscape(input, () => { write(); input.blur(); });
  input.addEventListener("change", async () => {
    const value = understood();
    if (!onvalue || value === undefined || value === kept) return;
    isSending = true;
    const answer = await onvalue(value);
    isSending = false;
    if (answer?.refused) refuse(WORDS.refused, { why: answer.text });
    else kept = shown = value;
  });
  addEventListener("language", () => { if (onvalue && shown === kept && !box.matches(".wrong")) write(); });
  return { show, read: () => understood() ?? null };
}
