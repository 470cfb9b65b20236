"""``mark10``: Mark-10 gauges, series 4, 5, 7 and BG.

``-18.78 lbF``, ``4.285 N``, or the number alone (``NUM`` setting). ``*10`` illegal, ``*11`` not applicable,
``*12`` invalid, ``*22`` too large. These gauges show tension as negative, so the sign is -1 by default.

What cannot be detected: transmission errors, and an overload (say ``capacity=``).
"""

from __future__ import annotations

from acquire.protocols.base import Parser, ParserSettings, Protocol
from acquire.protocols.lines import parser_from
from acquire.text import Message

PATTERN = r"(?i) *(?P<value>[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?: *(?P<unit>lbF|ozF|kgF|gF|kN|mN|N))? *"
RATES = (2, 5, 10, 25, 50, 125, 250)


class Mark10Settings(ParserSettings):
    """No settings of its own."""

    def parser(self, address: str) -> Parser:
        """Lines of one pattern."""
        return parser_from({"pattern": PATTERN})


PROTOCOL = Protocol(
    name="mark10",
    summary="Mark-10 series 4/5/7, BG",
    settings=Mark10Settings,
    baud=9600,
    mode="stream",
    sign=-1,
    flags_overload=False,
    commands={
        "poll": b"?C\r",
        "single": b"?C\r",
        "start": b"AOUT10\r",
        "stop": b"AOUT0\r",
        "tare": b"Z\r",
        "zero": b"Z\r",
        "identify": b"LIST\r",
    },
    rates={float(rate): b"AOUT%d\r" % rate for rate in RATES},
    undetected=Message("transmission errors are not detected, nor an overload: say capacity="),
)
