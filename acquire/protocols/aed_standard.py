"""``aed-standard``: the format of A&D that Dini Argeo, Selleton, Autoda, KERN KFB and many others send.

``HH[,H2],SDDDDDDD UU``: ``ST,+00123.45  g``, ``ST,GS,+0001.234kg``, ``US,NT,-000018.3kg``. ST stable, US
unstable, OL overload, UL underload, TL tilt, QT counting; GS gross, NT net, TR tare, LO/OK/HI comparator;
an RS-485 number such as ``01`` may stand before. A data field of spaces with only its point is an
overflow. Pieces, percent and the stored tare are no load and give no value.

What cannot be detected: transmission errors. A changed digit reads as another value; a lost one is only
where ``digits=`` tells the width of the data field.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, ParserSettings, Protocol, Reading, is_unit
from acquire.protocols.buffers import Line, LineParser, bad, number
from acquire.settings import choice, setting, whole
from acquire.text import Message

_LINE = re.compile(
    rb"(?:@?[0-9]{2},?)?(ST|US|OL|UL|TL|QT)(?:,(GS|NT|TR|LO|OK|HI))?,"
    rb"([-+ ]? *[0-9]*[.,]?[0-9]*) *([A-Za-z%]{0,3}) *"
)
_BEYOND = {b"OL": LoadFlag.OVERLOAD, b"UL": LoadFlag.UNDERLOAD}


class AedStandardParser(LineParser):
    """See the module.

    Parameters
    ----------
    decimal_comma : bool
    digits : int or None
        Characters of the data field after its sign, point included; others are refused.
    """

    def __init__(self, *, decimal_comma: bool = False, digits: int | None = None) -> None:
        super().__init__()
        self._comma, self._digits = decimal_comma, digits

    def parse(self, line: Line) -> Reading | None:
        """The reading of a line."""
        found = _LINE.fullmatch(line.data)
        if not found:
            return bad(line)
        status, which, data, unit = found.groups()
        if status in _BEYOND:
            return bad(line, _BEYOND[status])
        if status in (b"TL", b"QT") or which == b"TR" or (unit and not is_unit(unit.decode())):
            return bad(line)
        return self._value(line, data.decode(), unit.decode(), status == b"ST", which == b"NT")

    def _value(self, line: Line, data: str, unit: str, stable: bool, net: bool) -> Reading:
        if not data.strip(" +-.,"):
            return bad(line, LoadFlag.OVERLOAD) if data.strip() or len(data) > 1 else bad(line)
        value = number(data, self._comma)
        if math.isnan(value) or (self._digits is not None and len(data) - 1 != self._digits):
            return bad(line)
        flags = (LoadFlag.NET if net else LoadFlag.NONE) | (LoadFlag.NONE if stable else LoadFlag.UNSTABLE)
        return Reading(value, unit or None, line.data, line.start, stable, flags)


@dataclass(frozen=True, slots=True)
class AedStandardSettings(ParserSettings):
    """How the data field is written."""

    decimal: str = setting(choice("point", "comma"), "point", "the decimal mark")
    digits: int | None = setting(whole(1, 16), None, "characters of a value after its sign, point included")

    def parser(self, address: str) -> Parser:
        """Their parser."""
        return AedStandardParser(decimal_comma=self.decimal == "comma", digits=self.digits)


PROTOCOL = Protocol(
    name="aed-standard",
    summary="A&D, Dini Argeo, Selleton, Autoda, KERN KFB and many indicators",
    settings=AedStandardSettings,
    baud=2400,
    bytesize=7,
    parity="E",
    commands={"poll": b"Q\r\n", "single": b"Q\r\n", "start": b"SIR\r\n", "tare": b"T\r\n", "zero": b"Z\r\n"},
    undetected=Message("transmission errors are not detected: a changed digit reads as another value"),
)
