"""Simulated indicators of the protocols that people have on their rigs.

Written from the manufacturers' descriptions, apart from the parsers of ``acquire.protocols`` that
their tests pair with: a misreading on one side does not hide the same one on the other. Each talks
and understands its commands on a pseudo-terminal through ``hw_mocks.indicator_server``.

    mt-sics, aed-standard, mark10, sauter, hbm-aed here; modbus and ascii in files of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

from hw_mocks.indicator import NEWTONS, AsciiIndicator, Indicator, IndicatorReading, decimals
from hw_mocks.indicator_server import ModbusIndicator

CRLF = b"\r\n"


class MtSicsIndicator(Indicator):
    """Mettler-Toledo: ``S S     100.00 g``; the value stands in ten characters."""

    name = "mt-sics"
    serial_number: ClassVar[bytes] = b"B021002593"
    banner: ClassVar[bytes] = b'I4 A "B021002593"\r\n'

    def render(self, shown: IndicatorReading) -> bytes:
        """See ``Indicator``."""
        return b"S " + self._status_and_value(shown) + CRLF

    def _status_and_value(self, shown: IndicatorReading) -> bytes:
        if shown.status != "ok":
            return {"overload": b"+", "underload": b"-", "error": b"I"}[shown.status]
        value, unit = self.displayed(shown)
        return f"{'S' if shown.stable else 'D'} {value:>10} {unit}".encode()

    def answer(self, command: bytes, shown: IndicatorReading) -> bytes:
        """S SI SIU SIR SIRU SR SNR T TI TAC Z ZI @ I4; anything else is a syntax error."""
        if command in (b"S", b"SI", b"SIU", b"@"):
            self.left = 0.0
        if command in (b"SIR", b"SIRU", b"SR", b"SNR"):
            self.left = math.inf
            return b"" if command in (b"SIR", b"SIRU") else self.render(shown)
        if command == b"S" and not shown.stable:
            return b"S I" + CRLF
        if command in (b"S", b"SI", b"SIU"):
            return self.render(shown)
        return self._other(command, shown)

    def _other(self, command: bytes, shown: IndicatorReading) -> bytes:
        if command in (b"T", b"TI", b"Z", b"ZI"):
            if command in (b"T", b"Z") and not shown.stable:
                return command + b" I" + CRLF
            tared = command + b" " + self._status_and_value(shown)
            self.tare(shown)
            zeroed = {b"Z": b"Z A", b"ZI": b"ZI S" if shown.stable else b"ZI D"}
            return zeroed.get(command, tared) + CRLF
        if command == b"TAC":
            self.offset = 0.0
            return b"TAC A" + CRLF
        if command in (b"@", b"I4"):
            self.left = 0.0
            return b'I4 A "' + self.serial_number + b'"' + CRLF
        return b"ES" + CRLF


class AedStandardIndicator(Indicator):
    """A&D and its many relatives: ``ST,+00123.45  g``, with a second header ``ST,GS,+0001.234kg``.

    Parameters
    ----------
    resolution, unit : see ``Indicator``
    second_header : bool
    prefix : str
        RS-485 number such as ``01``.
    blank_overload : bool
        Overload as a field of spaces with its point, as the AD-4403 does.
    """

    name = "aed-standard"
    line = (2400, 7, "E")
    unasked: ClassVar[bool] = True  # the output mode most of them are left in

    def __init__(
        self,
        resolution: float = 0.1,
        unit: str = "N",
        *,
        second_header: bool = True,
        prefix: str = "",
        blank_overload: bool = False,
    ) -> None:
        super().__init__(resolution, unit)
        self._second, self._prefix, self._blank = second_header, prefix, blank_overload

    def render(self, shown: IndicatorReading) -> bytes:
        """See ``Indicator``."""
        value, unit = self.displayed(shown)
        head = "ST" if shown.stable else "US"
        data = f"{float(value):+09.{len(value.partition('.')[2])}f}"
        if shown.status != "ok":
            head, data = self._beyond(shown)
        second = ("NT," if self.offset else "GS,") if self._second else ""
        padded = f"{unit:>2}" if self._second else f"{unit:>3}"
        return f"{self._prefix}{head},{second}{data}{padded}".encode() + CRLF

    def _beyond(self, shown: IndicatorReading) -> tuple[str, str]:
        if self._blank:
            return "OL", " " * 6 + ". "
        if shown.status == "underload":
            return "UL", "-9999999.9"
        return "OL", "+9999999.9"

    def answer(self, command: bytes, shown: IndicatorReading) -> bytes:
        """Q (and KERN's W) at once, S when stable, SIR continuous until C, Z, T."""
        if command in (b"Q", b"W") or (command == b"S" and shown.stable):
            return self.render(shown)
        if command in (b"SIR", b"C"):
            self.left = math.inf if command == b"SIR" else 0.0
        if command in (b"Z", b"T"):
            self.tare(shown)
        return b""


class Mark10Indicator(Indicator):
    """Mark-10 gauges: ``-18.78 lbF``; tension is negative, and nothing marks an overload."""

    name = "mark10"
    foreign: ClassVar[str] = "lbF"
    rates: ClassVar[tuple[int, ...]] = (1, 2, 5, 10, 25, 50, 125, 250)
    units: ClassVar[dict[bytes, str]] = {b"N": "N", b"LB": "lbF", b"KG": "kgF"}

    def restart(self) -> None:
        """See ``Indicator``."""
        super().restart()
        self._full, self._peaks = True, [0.0, 0.0]

    def render(self, shown: IndicatorReading) -> bytes:
        """See ``Indicator``."""
        self._peaks = [max(self._peaks[0], self.net(shown)), min(self._peaks[1], self.net(shown))]
        return self._line(self.net(shown), shown)

    def _line(self, force: float, shown: IndicatorReading) -> bytes:
        unit = self.foreign if shown.foreign_unit else self.unit
        value = -force / NEWTONS[unit] + 0.0  # no minus before zero
        text = f"{value:.{decimals(self.resolution / NEWTONS[unit])}f}"
        return (f"{text} {unit}" if self._full else text).encode() + CRLF

    def answer(self, command: bytes, shown: IndicatorReading) -> bytes:
        """? ?C ?PT ?PC Z N LB KG FULL NUM AOUTn FLTCn LIST; *10 for anything else."""
        if command in (b"?", b"?C"):
            return self.render(shown)
        if command in (b"?PT", b"?PC"):
            return self._line(self._peaks[command == b"?PC"], shown)
        if command == b"Z":
            self.tare(shown)
        elif command in self.units:
            self.unit = self.units[command]
        elif command in (b"FULL", b"NUM"):
            self._full = command == b"FULL"
        elif command.startswith((b"AOUT", b"FLTC")):
            return self._numbered(command[:4], command[4:])
        elif command == b"LIST":
            return b"V1.00;N;CUR;FLTC8;FLTP1;AOUT%d;FULL" % (self.rate or 0) + CRLF
        else:
            return b"*10" + CRLF
        return b""

    def _numbered(self, name: bytes, text: bytes) -> bytes:
        if not text.isdigit():
            return b"*12" + CRLF
        number = int(text)
        if name == b"FLTC":
            return b"" if number in (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024) else b"*12" + CRLF
        if number > 250:
            return b"*22" + CRLF
        if number and number not in self.rates:
            return b"*12" + CRLF
        self.rate = (50.0 if number == 1 else float(number)) if number else None
        self.left = math.inf if number else 0.0
        return b""


class SauterIndicator(Indicator):
    """Sauter FH and FL: a ``9`` is answered with a sign digit and six characters, nothing more."""

    name = "sauter"
    ends: ClassVar[bytes] = b""
    WIDTH: ClassVar[int] = 6

    def render(self, shown: IndicatorReading) -> bytes:
        """See ``Indicator``."""
        force = self.net(shown)
        digits = decimals(self.resolution)
        while digits and len(f"{abs(force):.{digits}f}") > self.WIDTH:
            digits -= 1
        return f"{'1' if force >= 0 else '0'}{abs(force):0{self.WIDTH}.{digits}f}".encode()

    def receive(self, data: bytes, shown: IndicatorReading) -> bytes:
        """Each ``9`` asks once; other bytes are ignored."""
        return b"".join(self.render(shown) for byte in data if byte == ord("9"))


class HbmAedIndicator(Indicator):
    """HBM AD103, AED, WE2107: counts, 1 000 000 at the nominal load; ``;`` or LF ends a command.

    Parameters
    ----------
    resolution, unit : see ``Indicator``
    nominal_N : float, N
    """

    name = "hbm-aed"
    line = (9600, 8, "E")
    ends: ClassVar[bytes] = b";\n\r"
    rates: ClassVar[tuple[float, ...]] = (100, 50, 25, 12, 6, 3, 2, 1)
    formats: ClassVar[tuple[int, ...]] = (3, 9, 11)

    def __init__(self, resolution: float = 0.1, unit: str = "N", *, nominal_N: float = 10_000.0) -> None:
        self._nominal = nominal_N
        super().__init__(resolution, unit)

    def restart(self) -> None:
        """See ``Indicator``."""
        super().restart()
        self._format = 9

    def render(self, shown: IndicatorReading) -> bytes:
        """See ``Indicator``; status bits: 0 to 2 overflows, 3 standstill."""
        beyond = shown.status in ("overload", "underload")
        counts = round(self.net(shown) / self._nominal * 1_000_000)
        if beyond:
            counts = 1_600_000 if shown.status == "overload" else -1_600_000
        status = (0b0011 if beyond else 0) | (0b1000 if shown.stable else 0)
        text = f"{counts: 08d}"
        more = {3: "", 9: f",31,{status:03d}", 11: f",{status:03d}"}
        return (text + more[self._format]).encode() + CRLF

    def answer(self, command: bytes, shown: IndicatorReading) -> bytes:
        """MSV?n STP TAR ICRn COFn NOV? IDN? ESR?; ``0`` for a good setting, ``?`` for a bad one."""
        if command.startswith(b"MSV?"):
            return self._measure(command[4:], shown)
        if command == b"STP":
            self.left = 0.0
            return b""
        if command == b"TAR":
            self.tare(shown)
            return b"0" + CRLF
        if command[:3] in (b"ICR", b"COF") and command[3:].isdigit():
            return self._set(command[:3], int(command[3:]))
        answers = {b"NOV?": b"0000000", b"IDN?": b"HBM,AD103C,0012345,P20", b"ESR?": b"000"}
        return answers.get(command, b"?") + CRLF

    def _measure(self, text: bytes, shown: IndicatorReading) -> bytes:
        if not text:
            return self.render(shown)
        if not text.isdigit():
            return b"?" + CRLF
        self.left = float(text) or math.inf
        return b""

    def _set(self, name: bytes, number: int) -> bytes:
        if name == b"ICR" and number < len(self.rates):
            self.rate = float(self.rates[number])
        elif name == b"COF" and number in self.formats:
            self._format = number
        else:
            return b"?" + CRLF
        return b"0" + CRLF


INDICATORS: dict[str, Callable[..., Indicator]] = {
    "ascii": AsciiIndicator,
    "mt-sics": MtSicsIndicator,
    "aed-standard": AedStandardIndicator,
    "mark10": Mark10Indicator,
    "sauter": SauterIndicator,
    "hbm-aed": HbmAedIndicator,
    "modbus": ModbusIndicator,
}
"""By the name of their protocol; each takes ``resolution`` (N) and ``unit``."""
