"""``ascii``: the free text of HX711 sketches, Arduino, ESP, OpenScale and whatever prints a number.

``12.3``, ``Reading: 12.3 kg``, ``12345,0.512,kg,8388607,21.5,`` (milliseconds, value, unit, raw,
temperature). A line is an optional label that ends in ``:`` or ``=``, then numbers and units separated
by commas, semicolons, tabs or spaces. The value is the number in ``column``, else the only number
beside ``millis``, else the only number followed by a unit. A line that is not taken as a whole gives no
value, nor does one that leaves a choice: ``12,5 kg``, ``1.234,5 N`` or ``1,234.5`` may be one number or two,
until ``decimal=comma`` says one or ``decimal=point`` says two. With ``decimal=comma`` points stand between
thousands, if they stand there.

What cannot be detected: transmission errors. A digit lost or changed within a line, or two
lines run together into one number, reads as another value; ``capacity=`` and ``max_step=`` flag the
gross ones.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, ParserSettings, Protocol, Reading, is_unit
from acquire.protocols.buffers import Line, LineParser, bad, number
from acquire.settings import choice, setting, whole
from acquire.text import Message

SATURATED = {8388607.0: LoadFlag.OVERLOAD, -8388608.0: LoadFlag.UNDERLOAD}  # of a 24-bit converter

WIDTH_STAYS = 100  # lines in a row

_LABEL = re.compile(r"[A-Za-z][\w .()\[\]/-]{0,60}[:=]", re.ASCII)
_FIELD = re.compile(r"([-+]? *[0-9.,]+(?:[eE][-+]?[0-9]+)?)?(?:([A-Za-z]+)\.?)?")
_SPACED_SIGN = re.compile(r"([-+]) +(?=[0-9.])")
_POINT_SPLIT = re.compile(r"( *[,;\t] *| +)")
_COMMA_SPLIT = re.compile(r"( *[;\t] *| +)")


@dataclass(frozen=True, slots=True)
class AsciiSettings(ParserSettings):
    """How the address describes the lines.

    Attributes
    ----------
    decimal_comma : bool or None
        None: not given; then two numbers with a comma between them may be one.
    """

    column: int | None = setting(whole(1, 64), None, "place of the value in a line, from 1")
    millis: int | None = setting(whole(1, 64), None, "place of the device's own time, from 1")
    decimal: str | None = setting(
        choice("point", "comma"), None, "the decimal mark, where the line is ambiguous"
    )

    @property
    def decimal_comma(self) -> bool | None:
        return None if self.decimal is None else self.decimal == "comma"

    def parser(self, address: str) -> Parser:
        """Their parser; raises ConfigError where two columns are the same."""
        if self.column is not None and self.column == self.millis:
            raise ConfigError("{text}: column and millis must differ", address)
        return AsciiParser(self)


@dataclass(frozen=True, slots=True)
class _Field:
    value: float  # NaN: none
    unit: str | None
    digits: str
    apart: bool  # from the field before, by what no number has within it

    @property
    def numeric(self) -> bool:
        return not math.isnan(self.value)


class AsciiParser(LineParser):
    """See the module."""

    def __init__(self, settings: AsciiSettings | None = None) -> None:
        super().__init__()
        self._settings = settings or AsciiSettings()
        self._width, self._other_width, self._others = 0, 0, 0

    def parse(self, line: Line) -> Reading | None:
        """The reading of a line."""
        fields = self._fields(line.data)
        chosen = self._choose(fields) if fields and self._usual(len(fields)) else None
        if fields is None or chosen is None:
            return bad(line)
        unit = fields[chosen].unit or _unit_only(fields[chosen + 1 : chosen + 2])
        saturated = _saturation(fields[chosen:])
        return Reading(
            value=math.nan if saturated else fields[chosen].value,
            unit=unit,
            raw=line.data,
            start=line.start,
            flags=saturated,
            device_ms=None if self._settings.millis is None else fields[self._settings.millis - 1].value,
        )

    def _fields(self, data: bytes) -> list[_Field] | None:
        """The fields of a line; None where one is neither a number nor a unit."""
        text = data.decode("ascii", "replace").strip(" \t")
        label = _LABEL.match(text)
        text = _SPACED_SIGN.sub(r"\1", text[label.end() if label else 0 :].strip(" \t"))
        split = _COMMA_SPLIT if self._settings.decimal_comma else _POINT_SPLIT
        words = split.split(text)
        while words and not words[-1].strip(" ,;\t"):
            words.pop()
        gaps = ["", *words[1::2]]
        fields = [self._field(word, gap) for word, gap in zip(words[::2], gaps, strict=False)]
        whole = [field for field in fields if field is not None]
        return whole if len(whole) == len(fields) else None

    def _usual(self, width: int) -> bool:
        """Whether a line has as many fields as the lines before: a decimal comma makes one more.

        Only where columns are given; a new width that stays is taken over.
        """
        if self._settings.column is None or width == self._width or not self._width:
            self._width, self._others = width, 0
            return True
        self._others = self._others + 1 if width == self._other_width else 1
        self._other_width = width
        if self._others > WIDTH_STAYS:
            self._width, self._others = width, 0
        return width == self._width

    def _field(self, word: str, gap: str) -> _Field | None:
        found = _FIELD.fullmatch(word)
        if not found or not word:
            return None
        comma, digits = bool(self._settings.decimal_comma), found[1] or ""
        value = number(digits, comma) if digits else math.nan
        if (found[1] and math.isnan(value)) or (found[2] and not is_unit(found[2])):
            return None
        apart = ";" in gap or "\t" in gap or (self._settings.decimal_comma is False and "," in gap)
        digits = digits.replace(".", "").replace(",", ".") if comma else digits
        return _Field(value, found[2] or None, digits, apart)

    def _choose(self, fields: list[_Field]) -> int | None:
        """Where the value stands; None where the line leaves that open."""
        millis, column = self._settings.millis, self._settings.column
        if millis is not None and not (_numeric_at(fields, millis) and self._is_time(fields[millis - 1])):
            return None
        if column is not None:
            return (
                column - 1 if _numeric_at(fields, column) and self._only_number(fields, column - 1) else None
            )
        numeric = [i for i, field in enumerate(fields) if field.numeric and i + 1 != millis]
        if len(numeric) != 1:
            numeric = [i for i in numeric if fields[i].unit or _unit_only(fields[i + 1 : i + 2])]
        return numeric[0] if len(numeric) == 1 and self._only_number(fields, numeric[0]) else None

    def _only_number(self, fields: list[_Field], i: int) -> bool:
        """Whether the number in field ``i`` cannot be a part of one that its neighbours complete."""
        millis = self._settings.millis
        pairs = [(i - 1, i)] if i > 0 and i != millis else []
        pairs += [(i, i + 1)] if i + 1 < len(fields) and i + 2 != millis else []
        return not any(self._may_be_one(fields[before], fields[after]) for before, after in pairs)

    def _is_time(self, field: _Field) -> bool:
        """A comma within milliseconds separates two fields, whatever ``decimal`` is."""
        return not (self._settings.decimal_comma and "." in field.digits)

    def _may_be_one(self, before: _Field, after: _Field) -> bool:
        """Whether two neighbours may be one number: 12,5 or 1,234.5 or 1.234,5 or 1 234."""
        if (
            after.apart
            or after.digits[:1] in ("+", "-")
            or not (before.numeric and after.numeric)
            or before.unit
        ):
            return False
        whole, point, _ = after.digits.partition(".")
        first = before.digits.lstrip("+-")
        if not point or (self._settings.decimal_comma and len(whole) == 3):
            return True
        return len(whole) == 3 and len(first) <= 3 and "." not in first


def _numeric_at(fields: list[_Field], column: int) -> bool:
    return column <= len(fields) and fields[column - 1].numeric


def _unit_only(after: list[_Field]) -> str | None:
    return after[0].unit if after and not after[0].numeric else None


def _saturation(fields: list[_Field]) -> LoadFlag:
    return next((SATURATED[f.value] for f in fields if f.value in SATURATED), LoadFlag.NONE)


PROTOCOL = Protocol(
    name="ascii",
    summary="free text lines: [milliseconds,] value [unit] ... (HX711, Arduino, ESP, OpenScale)",
    settings=AsciiSettings,
    baud=9600,
    flags_overload=False,
    undetected=Message(
        "transmission errors are not detected: a lost or changed digit reads as another value"
    ),
)
