"""``mt-sics``: Mettler-Toledo, and A&D balances in their MT mode.

``S S     100.00 g`` stable, ``S D     100.03 g`` dynamic, ``S I`` not executable, ``S +`` and ``S -``
(A&D: ``SI+``, ``SI-``) over- and underload; ``ES``, ``ET``, ``EL`` are errors. Other replies (tare, zero,
serial number) are no readings.

What cannot be detected: transmission errors. A changed digit reads as another value.
"""

from __future__ import annotations

import re

from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, ParserSettings, Protocol, Reading, is_unit
from acquire.protocols.buffers import Line, LineParser, bad, number
from acquire.text import Message

_VALUE = re.compile(rb"S ([SD]) +([-+]? *[0-9]+(?:\.[0-9]*)?) ([A-Za-z]{1,4}) *")
_STATUS = {
    b"S +": LoadFlag.OVERLOAD,
    b"SI+": LoadFlag.OVERLOAD,
    b"S -": LoadFlag.UNDERLOAD,
    b"SI-": LoadFlag.UNDERLOAD,
}
_OTHER = re.compile(rb"(?:T|TI|TA|TAC|Z|ZI|@|I[0-9]{1,2}|SR|SIR|SNR|DAT|TIM)(?: .*)?", re.DOTALL)


class MtSicsParser(LineParser):
    """See the module."""

    def parse(self, line: Line) -> Reading | None:
        """The reading of a line."""
        found = _VALUE.fullmatch(line.data)
        if found and is_unit(found[3].decode()):
            stable = found[1] == b"S"
            value = number(found[2].decode())
            flags = LoadFlag.NONE if stable else LoadFlag.UNSTABLE
            return Reading(value, found[3].decode(), line.data, line.start, stable, flags)
        status = _STATUS.get(line.data.rstrip(b" "))
        if status is not None:
            return bad(line, status)
        return None if _OTHER.fullmatch(line.data) else bad(line)


class MtSicsSettings(ParserSettings):
    """No settings of its own."""

    def parser(self, address: str) -> Parser:
        """The one there is."""
        return MtSicsParser()


PROTOCOL = Protocol(
    name="mt-sics",
    summary="Mettler-Toledo; A&D in MT mode",
    settings=MtSicsSettings,
    mode="stream",
    commands={
        "poll": b"SI\r\n",
        "single": b"SI\r\n",
        "start": b"SIR\r\n",
        "stop": b"SI\r\n",
        "tare": b"TI\r\n",
        "zero": b"ZI\r\n",
        "identify": b"I4\r\n",
    },
    undetected=Message("transmission errors are not detected: a changed digit reads as another value"),
)
