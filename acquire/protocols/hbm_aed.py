"""``hbm-aed``: HBM AD103, AD104, AED, WE2107.

Eight characters of counts, optionally with address and status: ``xxxxxxxx,aa,sss``. In the output format
``COF9`` the status tells overflow and standstill; without it neither shows. The counts become a force by
``nominal=`` (what the factory scale of 1 000 000 counts stands for, in ``unit``), or by
``decimals=`` where the device's NOV scale gives units times a power of ten.

What cannot be detected: transmission errors, and without status (``COF3``) an overflow (say ``capacity=``).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, ParserSettings, Protocol, Reading
from acquire.protocols.buffers import Line, LineParser, bad, number
from acquire.settings import number as number_setting
from acquire.settings import setting, whole
from acquire.text import Message

NOMINAL_COUNTS = 1_000_000
OVERFLOW, STANDSTILL = 0b0111, 0b1000

_LINE = re.compile(rb"([-+ ][ 0-9]{6}[0-9]|[0-9]{8})(?:,([0-9]{2}))?(?:,([0-9]{3}))?")
_TARE = b"TAR;"


class HbmAedParser(LineParser):
    """See the module.

    Parameters
    ----------
    per_count : float
        Value of one count.
    """

    def __init__(self, per_count: float = 1.0) -> None:
        super().__init__()
        self._per_count = per_count

    def parse(self, line: Line) -> Reading | None:
        """The reading of a line."""
        if line.data == b"0":  # a setting was taken
            return None
        found = _LINE.fullmatch(line.data)
        counts = number(found[1].decode()) if found else float("nan")
        if not found or counts != counts:
            return bad(line)
        if found[3] is None:
            return Reading(counts * self._per_count, None, line.data, line.start)
        return self._with_status(line, counts, int(found[3]))

    def _with_status(self, line: Line, counts: float, status: int) -> Reading:
        if status & OVERFLOW:
            return bad(line, LoadFlag.OVERLOAD if counts >= 0 else LoadFlag.UNDERLOAD)
        stable = bool(status & STANDSTILL)
        flags = LoadFlag.NONE if stable else LoadFlag.UNSTABLE
        return Reading(counts * self._per_count, None, line.data, line.start, stable, flags)


@dataclass(frozen=True, slots=True)
class HbmAedSettings(ParserSettings):
    """What a count is worth."""

    nominal: float | None = setting(
        number_setting(1e-12), None, "load of 1 000 000 counts, in the unit of unit"
    )
    decimals: int | None = setting(whole(0, 8), None, "behind the point, where the device is scaled (NOV)")

    def parser(self, address: str) -> Parser:
        """Their parser; raises ConfigError where both are given."""
        if self.nominal is not None and self.decimals is not None:
            raise ConfigError("{text}: give nominal or decimals, not both", address)
        if self.nominal is not None:
            return HbmAedParser(self.nominal / NOMINAL_COUNTS)
        return HbmAedParser(10.0 ** -(self.decimals or 0))


PROTOCOL = Protocol(
    name="hbm-aed",
    summary="HBM AD103/104, AED, WE2107",
    settings=HbmAedSettings,
    bytesize=8,
    parity="E",
    mode="stream",
    unit_on_line=False,
    commands={
        "poll": b"MSV?;",
        "single": b"MSV?;",
        "start": b"MSV?0;",
        "stop": b"STP;",
        "tare": _TARE,
        "identify": b"IDN?;",
    },
    rates={
        rate: b"ICR%d;MSV?0;" % icr for icr, rate in enumerate((100.0, 50.0, 25.0, 12.0, 6.0, 3.0, 2.0, 1.0))
    },
    undetected=Message(
        "transmission errors are not detected, nor an overflow without the status of COF9: say capacity="
    ),
)
