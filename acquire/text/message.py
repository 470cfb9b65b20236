"""Texts for people as data: a template in English, and the values that are filled in.

A ``Message`` is a ``str``, its English text, so that everything that takes a text takes it. The page and the terminal
put the template of another language in place of the English one and fill in the same values (``live.words``). Words of
others, a file's or a device's, may be anything and are made harmless for a terminal.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from numbers import Number, Real
from typing import Any, Self

from acquire.text.quantity import MINUS, Amount, number

FIELD = re.compile(r"\{\{|\}\}|\{(\w+)(?::((?:(?!\d{3})[^{}])*))?\}")
"""A named field of a template, with its format (of a file's, no width of a gigabyte), or a doubled brace, which is one
of the text."""
MOST = 20_000
"""Letters of a message from a file."""
SAY, WITH = "say", "with"  # keys of a message as JSON
QUANTITY = Amount("strain", 0.0).to_json().keys()

# Control characters of both kinds (but for line feed and tab), halves of surrogate pairs, marks that turn the
# direction of writing or are not seen, and separators that some terminals take for an end of line.
_HARMFUL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)

# A device or file by its address at the beginning of a sentence, with its settings; a path goes on after them.
_ADDRESS = re.compile(r"^([^\s?]+)\?[A-Za-z_]\w*=[^\s/]*(?=: |$)")


def filled(template: str, values: Mapping[str, Any], shown: Callable[[Any, str], str]) -> str:
    """The template with each field replaced by what ``shown`` makes of its value and format."""

    def put(field: re.Match[str]) -> str:
        return shown(values[field[1]], field[2] or "") if field[1] else field[0][0]

    return FIELD.sub(put, template)


def formatted(value: Any, spec: str) -> str:
    """As ``format``, but 6 350, not 6.35e+03, and a true minus; a value without digits (``g``) may be typed again."""
    if isinstance(value, Real) and re.fullmatch(r"\.\d+f", spec):
        return number(float(value), int(spec[1:-1]))
    text = format(value, spec)
    if "e+0" in text and spec == "g":
        return f"{float(text):.0f}"
    if "e+0" in text and spec.endswith("g"):
        return "+" * (spec.startswith("+") and value > 0) + number(float(text))
    return text.replace("-", MINUS, 1) if len(spec) > 1 and isinstance(value, Real) and value < 0 else text


@cache
def fields(template: str) -> tuple[str, ...]:
    """The names of its fields, each once, in their order."""
    return tuple(dict.fromkeys(field[1] for field in FIELD.finditer(template) if field[1]))


class Message(str):
    """A text with named fields: ``Message("{name}: no picture for {waited:.1f} s", camera, 2.13)``.

    Parameters
    ----------
    template : str
    *given
        The values of the fields, in the order in which they first stand in the template: numbers, quantities,
        messages, which are translated, or names, which are not; what else is given counts as its text.
    **named
        Others by their names.

    Attributes
    ----------
    template : str
    values : mapping of str to value

    Raises
    ------
    ValueError, KeyError
        Fields and values do not agree.
    """

    __slots__ = ("template", "values")
    template: str
    values: Mapping[str, Any]

    def __new__(cls, template: str, /, *given: Any, **named: Any) -> Self:
        """Fill it in English."""
        if isinstance(template, cls) and not (given or named):
            return template
        names = [name for name in fields(template) if name not in named] if given else []
        values = dict(zip(names, given, strict=True)) | named
        values = {
            name: _words_of(value) if isinstance(value, Exception) else value
            for name, value in values.items()
        }
        made = super().__new__(cls, filled(template, values, formatted))
        made.template, made.values = template, values
        return made

    def __reduce__(self) -> Any:
        return _made, (self.template, dict(self.values))

    def __add__(self, other: str) -> Message:
        return joined("", (self, other))

    def __radd__(self, other: str) -> Message:
        return joined("", (other, self))

    def __mul__(self, times: Any) -> Any:
        return self if times == 1 else "" if times == 0 else str(self) * times

    def to_json(self) -> Any:
        """``{"say": template, "with": values}``."""
        return {SAY: self.template, WITH: {key: _plain(value) for key, value in self.values.items()}}


def word(text: str) -> str:
    """A text of the program as a message, which is translated; names and what a user wrote are plain and stay."""
    return text if FIELD.search(text) else Message(text)


def _words_of(error: Exception) -> str:
    """The message of an error of the program, else what it or the system says."""
    told = next((one for one in error.args[:1] if isinstance(one, Message)), None)
    return getattr(error, "text", None) or told or word(getattr(error, "strerror", None) or str(error))


def _made(template: str, values: Mapping[str, Any]) -> Message:
    return Message(template, **values)


def _plain(value: Any) -> Any:
    if isinstance(value, Message | Amount):
        return value.to_json()
    if hasattr(value, "item"):
        value = value.item()
    return value if isinstance(value, bool | int | float | str) else str(value)


def from_json(value: Any) -> Any:
    """The message or quantity of such an object, else the value as it is; fit for ``object_hook`` of ``json.loads``."""
    if isinstance(value, dict) and value.keys() == {SAY, WITH}:
        values = {key: from_json(one) for key, one in value[WITH].items()}
        if sum(len(str(values[field[1]])) for field in FIELD.finditer(value[SAY]) if field[1]) > MOST:
            raise ValueError("a text that grows without end")
        return Message(value[SAY], **values)
    if isinstance(value, dict) and "kind" in value and value.keys() == QUANTITY:
        known: dict[str, Any] = {key: math.nan if one is None else one for key, one in value.items()}
        if known["digits"] in (1, 2):
            return Amount(**known)
    return value


def kept(text: str) -> dict[str, Any]:
    """A text for a file: its English words, and the message that it is."""
    return {"text": str(text)} | ({"message": text.to_json()} if isinstance(text, Message) else {})


def taken(stored: Mapping[str, Any]) -> str:
    """The text of ``kept``: the message where it has the same words, else the words."""
    try:
        text = from_json(stored["message"])
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError):
        text = None
    return text if isinstance(text, Message) and text == stored["text"] else str(stored["text"])


def joined(between: str, parts: Iterable[str | Amount]) -> Message:
    """The parts that are not empty, one after the other, each still to be translated."""
    kept = [part for part in parts if part]
    names = [f"part{k}" for k in range(len(kept))]
    template = between.replace("{", "{{").replace("}", "}}").join(f"{{{name}}}" for name in names)
    return Message(template, **dict(zip(names, kept, strict=True)))


def about(name: object, what: object) -> Message:
    """What is said of a file, a device or a setting."""
    return Message("{name}: {what}", name, what)


def without_name(text: str, name: str) -> str:
    """What is said of ``name`` in a text that begins with it."""
    if not isinstance(text, Message):
        return text.removeprefix(f"{name}: ")
    first, *others = fields(text.template) or ("",)
    if not text.template.startswith(f"{{{first}}}: ") or str(text.values[first]) != name:
        return text
    rest = text.template.removeprefix(f"{{{first}}}: ")
    alone: Any = text.values[others[0]] if others and rest == f"{{{others[0]}}}" else None
    return (
        alone if isinstance(alone, str) else Message(rest, **{key: text.values[key] for key in fields(rest)})
    )


def printable(text: object) -> str:
    """``text`` with everything that could command a terminal written as an escape, ``\\x1b`` for one.

    Bytes of a file name that are no UTF-8 are shown as those bytes. A message stays one: its values are changed.
    """
    return changed(text, lambda words: _HARMFUL.sub(_escaped, words))


def changed(text: object, change: Callable[[str], str]) -> str:
    """What ``change`` makes of a text; of a message, of the values in it."""
    text = getattr(text, "text", text) if isinstance(text, Exception) else text
    if not isinstance(text, Message) or not text.values:
        words = change(str(text))
        return text if words == text else words
    values = {
        key: one if isinstance(one, Number | Amount) else changed(one, change)
        for key, one in text.values.items()
    }
    return Message(text.template, **values)


def brief(text: object) -> str:
    """A sentence that begins with an address, without the settings of that address."""
    return changed(text, lambda words: _ADDRESS.sub(r"\1", words))


def meant(given: str, known: Iterable[str]) -> str:
    """Which of the ``known`` words is nearest to ``given``, in brackets to be added to a message; else empty."""
    near = difflib.get_close_matches(given, list(known), 1)
    return Message(" (did you mean {near}?)", near[0]) if near else ""


def counted(n: int, noun: str) -> str:
    """As "1 frame" or "3 frames"."""
    return Message(f"{{n}} {noun}{'' if n == 1 else 's'}", Amount("count", n))


def duration(seconds: float) -> str:
    """As 1:23 or 1:02:03."""
    minutes, rest = divmod(max(0, round(seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _escaped(found: re.Match[str]) -> str:
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:  # a byte that Python could not decode
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def share_text(share: float) -> str:
    """What marks a value whose area lost a block: "of 83 % of the area"; empty where it stands for all of it."""
    if share == 1:
        return ""
    return Message(
        "of {share} % of the area", min(math.floor(100 * share + 1e-4), 99)
    )  # float32 may be below
