"""The lines that stand in the manufacturers' manuals, and what each is worth."""

from __future__ import annotations

import math
from typing import NamedTuple

import pytest

from acquire.load_sample import LoadFlag
from tests.acquire.protocols.conversation import parser, read_line

NONE, OVER, UNDER = LoadFlag.NONE, LoadFlag.OVERLOAD, LoadFlag.UNDERLOAD
UNSTABLE, ERROR, NET = LoadFlag.UNSTABLE, LoadFlag.ERROR, LoadFlag.NET
NAN = math.nan


class Golden(NamedTuple):
    protocol: str
    settings: str
    line: bytes
    value: float
    unit: str | None = None
    stable: bool | None = None
    flags: LoadFlag = NONE


GOLDEN = [
    Golden("ascii", "", b"Reading: 12.3 kg", 12.3, "kg"),
    Golden("ascii", "millis=1", b"12345,0.512,kg,8388606,21.5,", 0.512, "kg"),
    Golden("ascii", "", b"12345,0.512,kg,8388606,21.5,", 0.512, "kg"),
    Golden("ascii", "millis=1", b"12345,0.512,kg,8388607,21.5,", NAN, "kg", None, OVER),
    Golden("ascii", "millis=1", b"12345,-0.512,kg,-8388608,21.5,", NAN, "kg", None, UNDER),
    Golden("ascii", "", b"8388607", NAN, None, None, OVER),
    Golden("ascii", "", b"-8388608", NAN, None, None, UNDER),
    Golden("ascii", "", b"-12.5N", -12.5, "N"),
    Golden("ascii", "", b"- 12.5 kN", -12.5, "kN"),
    Golden("ascii", "column=2", b"1;2;3", 2.0),
    Golden("ascii", "decimal=comma", b"12,5 kg", 12.5, "kg"),
    Golden("ascii", "", b"12,5 kg", NAN, None, None, ERROR),
    Golden("ascii", "", b"1,234.5 kg", NAN, None, None, ERROR),
    Golden("ascii", "", b"1.234,5 N", NAN, None, None, ERROR),
    Golden("ascii", "", b"1 234,5 N", NAN, None, None, ERROR),
    Golden("ascii", "", b"1 234.5 N", NAN, None, None, ERROR),
    Golden("ascii", "", b"1'234.5 N", NAN, None, None, ERROR),
    Golden("ascii", "", b"1.234.567 N", NAN, None, None, ERROR),
    Golden("ascii", "millis=1", b"12345,1.234,5 N", NAN, None, None, ERROR),
    Golden("ascii", "millis=1", b"12345,12,5", NAN, None, None, ERROR),
    Golden("ascii", "column=1", b"12,5", NAN, None, None, ERROR),
    Golden("ascii", "column=1", b"12.5,21.3", 12.5),
    Golden("ascii", "column=1", b"12;5", 12.0),
    Golden("ascii", "column=1&decimal=point", b"12,5", 12.0),
    Golden("ascii", "millis=1&column=2", b"12345,512,N", 512.0, "N"),
    Golden("ascii", "millis=1&column=2", b"12345,12,5,N", NAN, None, None, ERROR),
    Golden("ascii", "", b"12345,125.4,N", 125.4, "N"),
    Golden("ascii", "decimal=comma", b"1.234,5 N", 1234.5, "N"),
    Golden("ascii", "decimal=comma", b"1.234 N", NAN, None, None, ERROR),
    Golden("ascii", "decimal=comma", b"1.23,5 N", NAN, None, None, ERROR),
    Golden("ascii", "decimal=comma", b"12345;12,5 N;7;", 12.5, "N"),
    Golden("ascii", "", b"F: 12.5 N T: 3", NAN, None, None, ERROR),
    Golden("aed-standard", "decimal=comma", b"ST,GS,+0001.234kg", NAN, None, None, ERROR),
    Golden("ascii", "", b"1,2,3", NAN, None, None, ERROR),
    Golden("ascii", "", b"HX711 Demo", NAN, None, None, ERROR),
    Golden("ascii", "", b"12.3\x004", NAN, None, None, ERROR),
    Golden("ascii", "", b"nan", NAN, None, None, ERROR),
    Golden("ascii", "", b"1_000", NAN, None, None, ERROR),
    Golden("mt-sics", "", b"S S     100.00 g", 100.0, "g", True),
    Golden("mt-sics", "", b"S D     100.03 g", 100.03, "g", False, UNSTABLE),
    Golden("mt-sics", "", b"S D    -100.03 kg", -100.03, "kg", False, UNSTABLE),
    Golden("mt-sics", "", b"S I", NAN, None, None, ERROR),
    Golden("mt-sics", "", b"S +", NAN, None, None, OVER),
    Golden("mt-sics", "", b"S -", NAN, None, None, UNDER),
    Golden("mt-sics", "", b"SI+", NAN, None, None, OVER),
    Golden("mt-sics", "", b"SI-", NAN, None, None, UNDER),
    Golden("mt-sics", "", b"ES", NAN, None, None, ERROR),
    Golden("mt-sics", "", b"ET", NAN, None, None, ERROR),
    Golden("mt-sics", "", b"EL", NAN, None, None, ERROR),
    Golden("aed-standard", "", b"ST,+00123.45  g", 123.45, "g", True),
    Golden("aed-standard", "", b"ST,GS,+0001.234kg", 1.234, "kg", True),
    Golden("aed-standard", "", b"US,NT,-000018.3kg", -18.3, "kg", False, UNSTABLE | NET),
    Golden("aed-standard", "", b"QT,+00012345PC", NAN, None, None, ERROR),
    Golden("aed-standard", "", b"OL,+9999999.9  g", NAN, None, None, OVER),
    Golden("aed-standard", "", b"UL,-9999999.9  g", NAN, None, None, UNDER),
    Golden("aed-standard", "", b"TL,+0000000.0  g", NAN, None, None, ERROR),
    Golden("aed-standard", "", b"ST,TR,+0001.234kg", NAN, None, None, ERROR),
    Golden("aed-standard", "", b"ST,GS,+    .   kg", NAN, None, None, OVER),
    Golden("aed-standard", "", b"01ST,GS,+0001.234kg", 1.234, "kg", True),
    Golden("aed-standard", "", b"ST,HI,+0001.234kg", 1.234, "kg", True),
    Golden("aed-standard", "", b"ST,+00123.45   ", 123.45, None, True),
    Golden("aed-standard", "", b"ST,GS,+0001,234kg", NAN, None, None, ERROR),
    Golden("aed-standard", "decimal=comma", b"ST,GS,+0001,234kg", 1.234, "kg", True),
    Golden("aed-standard", "digits=8", b"ST,GS,+0001.234kg", 1.234, "kg", True),
    Golden("aed-standard", "digits=8", b"ST,GS,+001.234kg", NAN, None, None, ERROR),
    Golden("mark10", "", b"-18.78 lbF", -18.78, "lbF"),
    Golden("mark10", "", b"4.285 N", 4.285, "N"),
    Golden("mark10", "", b"4.285", 4.285),
    Golden("mark10", "", b"*10", NAN, None, None, ERROR),
    Golden("mark10", "", b"*22", NAN, None, None, ERROR),
    Golden("hbm-aed", "", b"+0500000", 500000.0),
    Golden("hbm-aed", "nominal=200", b"+0500000", 100.0),
    Golden("hbm-aed", "nominal=200", b" -500000", NAN, None, None, ERROR),
    Golden("hbm-aed", "decimals=2", b"-0012345", -123.45),
    Golden("hbm-aed", "nominal=200", b"+0500000,31,008", 100.0, None, True),
    Golden("hbm-aed", "nominal=200", b"+0500000,31,000", 100.0, None, False, UNSTABLE),
    Golden("hbm-aed", "nominal=200", b"+0999999,31,001", NAN, None, None, OVER),
    Golden("hbm-aed", "nominal=200", b"+0999999,31,002", NAN, None, None, OVER),
    Golden("hbm-aed", "nominal=200", b"-0999999,31,004", NAN, None, None, UNDER),
    Golden("hbm-aed", "nominal=200", b"+0500000,008", 100.0, None, True),
    Golden("hbm-aed", "nominal=200", b"?", NAN, None, None, ERROR),
    Golden("lines", "preset=ohaus", b"   123.45 g ?", 123.45, "g", False, UNSTABLE),
    Golden("lines", "preset=ohaus", b"   123.45 g", 123.45, "g", True),
    Golden("lines", "preset=loadstar", b"12345", 12.345, "lbf"),
    Golden("lines", "preset=dillon", b"  12.5 kN", 12.5, "kN"),
    Golden("lines", "preset=sartorius", b"N     +   12.345 kg ", 12.345, "kg"),
    Golden("lines", "preset=sartorius", b"+   12.345 g  ", 12.345, "g"),
    Golden("lines", "preset=sartorius", b"         H      ", NAN, None, None, OVER),
    Golden("lines", "preset=sartorius", b"      Err 054   ", NAN, None, None, ERROR),
]


@pytest.mark.parametrize("golden", GOLDEN, ids=lambda g: f"{g.protocol} {g.settings} {g.line!r}")
def test_golden_line(golden: Golden) -> None:
    reading = read_line(golden.protocol, golden.line, golden.settings)
    assert reading is not None
    assert reading.value == pytest.approx(golden.value, nan_ok=True)
    assert (reading.stable, reading.flags) == (golden.stable, golden.flags)
    if golden.unit or not math.isnan(golden.value):
        assert reading.unit == golden.unit
    assert reading.raw == golden.line


@pytest.mark.parametrize(
    ("protocol", "line"),
    [
        ("mt-sics", b"Z A"),
        ("mt-sics", b"T S     12.00 g"),
        ("mt-sics", b'I4 A "0123456789"'),
        ("hbm-aed", b"0"),
    ],
)
def test_answers_to_commands_are_no_readings(protocol: str, line: bytes) -> None:
    assert read_line(protocol, line) is None


@pytest.mark.parametrize(("answer", "value"), [(b"1021.15", 21.15), (b"0011.70", -11.70)])
def test_sauter(answer: bytes, value: float) -> None:
    sauter = parser("sauter")
    assert sauter.feed(answer[:3]) == [] and sauter.feed(answer[3:]) == []
    (reading,) = sauter.silence()
    assert reading.value == pytest.approx(value) and reading.raw == answer
    assert sauter.silence() == []


@pytest.mark.parametrize("answer", [b"021.15", b"1021.151", b"2021.15", b"1......", b"10211.5\r"])
def test_sauter_refuses_what_is_not_an_answer(answer: bytes) -> None:
    sauter = parser("sauter")
    sauter.feed(answer)
    (reading,) = sauter.silence()
    assert math.isnan(reading.value) and reading.flags is ERROR


def test_a_lost_byte_does_not_shift_the_next_sauter_answer() -> None:
    sauter = parser("sauter")
    sauter.feed(b"021.15")
    assert math.isnan(sauter.silence()[0].value)
    sauter.feed(b"1021.15")
    assert sauter.silence()[0].value == pytest.approx(21.15)


def test_rinstrum_frames_end_with_etx() -> None:
    rinstrum = parser("lines", "preset=rinstrum")
    rinstrum.feed(b"\x03")
    readings = rinstrum.feed(b"\x02-0001234G\x03\x02+0001234M\x03\x02+9999999O\x03\x02 0000012N\x03")
    assert [r.value for r in readings[:2]] == [-1234.0, 1234.0]
    assert readings[1].flags is UNSTABLE and readings[2].flags is OVER and readings[3].flags is NET
    assert math.isnan(readings[2].value) and readings[3].value == 12


def test_device_milliseconds() -> None:
    reading = read_line("ascii", b"12345,0.512,kg", "millis=1")
    assert reading is not None and reading.device_ms == 12345.0
