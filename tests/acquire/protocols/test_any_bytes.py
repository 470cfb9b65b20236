"""Any bytes, cut anywhere: every parser, the line buffer under them, the notations of numbers, and the units."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable
from decimal import Decimal
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Reading, is_mass, is_unit, newtons_per
from acquire.protocols.buffers import LineBuffer
from tests.acquire.protocols.conversation import ALL, any_parser, parser, read_line

SEEDS = [
    b"12.5 N\r\n",
    b"Readings:\r\n",
    b" , ;\t,\r\n",
    b"S S     100.00 g\r\n",
    b"ST,GS,+0001.234kg\r\n",
    b"-18.78 lbF\r\n",
    b"1021.15",
    b"+0500000,31,008\r\n",
    bytes([1, 3, 6, 0, 0, 0, 5, 0, 2]),
    b"\x00\xff\r\r\n",
]
babble = st.one_of(
    st.binary(max_size=400),
    st.lists(st.one_of(st.sampled_from(SEEDS), st.binary(max_size=12)), max_size=30).map(b"".join),
)


def chunks(data: bytes, seed: int) -> list[bytes]:
    """``data`` cut at random places."""
    rng = random.Random(seed)
    cuts = sorted({0, len(data), *(rng.randrange(len(data) + 1) for _ in range(rng.randrange(8)))})
    return [data[a:b] for a, b in itertools.pairwise(cuts)]


def same(a: Reading, b: Reading) -> bool:
    values = a.value == b.value or (math.isnan(a.value) and math.isnan(b.value))
    return values and (a.raw, a.start, a.flags, a.unit) == (b.raw, b.start, b.flags, b.unit)


@pytest.mark.parametrize("name", ALL)
@given(data=babble, seed=st.integers(0, 1000))
def test_chunking_changes_nothing(name: str, data: bytes, seed: int) -> None:
    whole, cut = any_parser(name), any_parser(name)
    at_once = whole.feed(data) + whole.silence()
    in_pieces = [reading for piece in chunks(data, seed) for reading in cut.feed(piece)] + cut.silence()
    assert len(at_once) == len(in_pieces)
    assert all(same(a, b) for a, b in zip(at_once, in_pieces, strict=True))


@pytest.mark.parametrize("name", ALL)
@given(data=babble)
def test_every_reading_is_a_number_or_says_why_not(name: str, data: bytes) -> None:
    made = any_parser(name)
    because = LoadFlag.ERROR | LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD
    for reading in made.feed(data) + made.silence():
        assert math.isfinite(reading.value) != bool(reading.flags & because)
        assert data[reading.start : reading.start + len(reading.raw)] == reading.raw


@pytest.mark.parametrize("name", ALL)
def test_a_megabyte_without_an_end_is_held_in_a_few_hundred_bytes(name: str) -> None:
    made = any_parser(name)
    readings = made.feed(b"\r\n")
    for _ in range(1000):
        readings += made.feed(b"1" * 1000)
    assert sum(len(reading.raw) for reading in readings) <= 512


def test_the_first_partial_line_gives_no_value() -> None:
    made = parser("ascii")
    assert [r.value for r in made.feed(b"3.5 N\r\n12.5 N\r\n")] == [12.5]


def test_a_line_with_more_columns_than_the_others_gives_no_value() -> None:
    made = parser("ascii", "millis=1&column=2")
    made.feed(b"\r\n")
    values = [r.value for r in made.feed(b"10,12.5,N\r\n20,12,5,N\r\n30,12.5,N\r\n")]
    assert values == pytest.approx([12.5, math.nan, 12.5], nan_ok=True)


def test_more_columns_that_stay_are_taken_over() -> None:
    made = parser("ascii", "column=2")
    made.feed(b"\r\n1;2\r\n")
    values = [r.value for r in made.feed(b"1;3;4\r\n" * 150)]
    assert math.isnan(values[99]) and values[-1] == 3.0


def test_after_a_restart_the_line_begun_is_gone() -> None:
    made = parser("ascii")
    made.feed(b"\r\n12")
    made.restart()
    assert [r.value for r in made.feed(b"5 N\r\n7 N\r\n")] == [7.0]


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n", b"\n\r"])
def test_every_line_end(end: bytes) -> None:
    made = parser("ascii")
    made.feed(end)
    assert [r.value for r in made.feed(b"1 N" + end + b"2 N" + end)] == [1.0, 2.0]


decimals = st.decimals(min_value=-9999, max_value=9999, places=3, allow_nan=False, allow_infinity=False)


def _aed(x: float) -> bytes:
    return f"ST,GS,{x:+09.3f}kg".encode()


RENDERERS: list[tuple[str, Callable[[float], bytes], str]] = [
    ("ascii", lambda x: f"{x:.3f} N".encode(), ""),
    ("ascii", lambda x: f"99,{x:.3f},N,1234,21.5,".encode(), "millis=1"),
    ("mt-sics", lambda x: f"S D {x:10.3f} kg".encode(), ""),
    ("aed-standard", _aed, ""),
    ("mark10", lambda x: f"{x:.3f} N".encode(), ""),
    ("hbm-aed", lambda x: f"{round(x * 1000):+08d}".encode(), "decimals=3"),
    ("lines", lambda x: f"{x:10.3f} kg".encode(), "preset=ohaus"),
]


@pytest.mark.parametrize(("name", "render", "settings"), RENDERERS, ids=[f"{r[0]} {r[2]}" for r in RENDERERS])
@given(value=decimals)
def test_what_is_rendered_is_read(
    name: str, render: Callable[[float], bytes], settings: str, value: float
) -> None:
    reading = read_line(name, render(float(value)), settings)
    assert reading is not None
    assert reading.value == pytest.approx(float(value), abs=1e-9)


@given(st.decimals(min_value=-999, max_value=999, places=2, allow_nan=False, allow_infinity=False))
def test_what_sauter_answers_is_read(value: float) -> None:
    made = parser("sauter")
    made.feed(f"{0 if value < 0 else 1}{abs(value):06.2f}".encode())
    assert made.silence()[0].value == pytest.approx(float(value))


def test_lines_with_their_positions() -> None:
    buffer = LineBuffer(drop_first=False)
    assert [(line.data, line.start) for line in buffer.feed(b"ab\r\n\ncd\ref")] == [(b"ab", 0), (b"cd", 5)]
    assert [(line.data, line.start) for line in buffer.feed(b"g\n")] == [(b"efg", 8)]


def test_an_endless_line_comes_out_once_and_cut() -> None:
    buffer = LineBuffer(limit=8, drop_first=False)
    lines = [line for _ in range(100) for line in buffer.feed(b"123456789")]
    assert [(line.data, line.whole) for line in lines] == [(b"12345678", False)]
    assert [(line.data, line.start) for line in buffer.feed(b"\nab\n")] == [(b"ab", 901)]


def test_a_line_of_just_the_limit_is_whole() -> None:
    buffer = LineBuffer(limit=8, drop_first=False)
    assert [line.whole for line in buffer.feed(b"12345678\n")] == [True]


@given(st.binary(max_size=300), st.booleans())
def test_every_line_stands_where_it_says(data: bytes, drop: bool) -> None:
    buffer = LineBuffer(limit=32, drop_first=drop)
    lines = [line for i in range(0, len(data), 7) for line in buffer.feed(data[i : i + 7])]
    for line in lines:
        assert data[line.start : line.start + len(line.data)] == line.data
        assert not {10, 13} & set(line.data)


class Notation(NamedTuple):
    """How a number is written: the decimal mark, and what stands between thousands."""

    point: str
    thousands: str


MARKS = (".,", ". ", ".'", ",.", ", ", ".", ",")
NOTATIONS = [Notation(marks[0], marks[1:]) for marks in MARKS]
LINES = ("{}", "{} N", "{}N", "Reading: {} N", "F={}", "{} N,8388,21.5,", "{};")
SETTINGS = ("", "column=1", "decimal=comma", "decimal=comma&column=1")
numbers = st.decimals(min_value=-(10**8), max_value=10**8, allow_nan=False, allow_infinity=False)


def written(value: Decimal, notation: Notation) -> str:
    """``value`` with its decimals, grouped."""
    text = f"{value:,}"
    marks = {",": notation.thousands, ".": notation.point}
    return "".join(marks.get(letter, letter) for letter in text)


def may_mislead(text: str, notation: Notation, settings: str) -> bool:
    """One lone mark with three digits behind it says both 1.234 and 1234: nobody can tell."""
    read_as = "," if "decimal=comma" in settings else "."
    return notation.thousands == read_as and text.count(read_as) == 1 and notation.point not in text


@pytest.mark.parametrize("settings", SETTINGS)
@given(
    value=numbers,
    places=st.integers(0, 5),
    notation=st.sampled_from(NOTATIONS),
    line=st.sampled_from(LINES),
)
def test_no_notation_is_read_as_another_number(
    settings: str, value: Decimal, places: int, notation: Notation, line: str
) -> None:
    rounded = round(value, places) if places else Decimal(round(value))
    text = written(rounded, notation)
    reading = read_line("ascii", line.format(text).encode(), settings)
    assert reading is not None
    ours = notation.point == ("," if "decimal=comma" in settings else ".")
    if not math.isnan(reading.value) and not may_mislead(text, notation, settings):
        assert reading.value == pytest.approx(float(rounded), abs=1e-9)
    saturated = abs(rounded) in (8388607, 8388608) or "8388," in line  # a converter of 24 bits at its end
    if ours and notation.thousands == "" and "column" not in settings and not saturated:
        assert not math.isnan(reading.value)


@given(value=numbers, places=st.integers(0, 5), notation=st.sampled_from(NOTATIONS), ms=st.integers(0, 10**7))
def test_nor_beside_milliseconds(value: Decimal, places: int, notation: Notation, ms: int) -> None:
    rounded = round(value, places) if places else Decimal(round(value))
    text = written(rounded, notation)
    for settings in ("millis=1", "millis=1&column=2"):
        reading = read_line("ascii", f"{ms},{text},N".encode(), settings)
        assert reading is not None
        if not math.isnan(reading.value) and not may_mislead(text, notation, settings):
            assert reading.value == pytest.approx(float(rounded), abs=1e-9)


FORCES = {
    "N": 1.0, "kN": 1e3, "mN": 1e-3, "kgf": 9.80665, "kp": 9.80665, "gf": 9.80665e-3, "lbf": 4.4482216153,
    "lbF": 4.4482216153, "ozf": 0.2780138509, "klbf": 4448.2216153,
}  # fmt: skip
KILOGRAMS = {
    "kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3, "lb": 0.45359237, "lbs": 0.45359237, "oz": 0.028349523125,
}  # fmt: skip


@pytest.mark.parametrize(("unit", "newtons"), FORCES.items())
def test_forces_in_newtons(unit: str, newtons: float) -> None:
    assert newtons_per(unit) == newtons_per(unit.lower()) == pytest.approx(newtons, rel=1e-9)
    assert is_unit(unit) and not is_mass(unit)


@pytest.mark.parametrize(("unit", "kg"), KILOGRAMS.items())
def test_masses_need_leave_and_weigh_as_under_standard_gravity(unit: str, kg: float) -> None:
    assert newtons_per(unit, mass_reads_force=True) == pytest.approx(9.80665 * kg, rel=1e-9)
    with pytest.raises(ConfigError, match=rf"mass_reads_force=yes .*1 {unit} is then"):
        newtons_per(unit)


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        *((unit, "not known") for unit in ("", "stone", "Pa", "N m")),
        *((unit, "milli or mega") for unit in ("MN", "Mn", "MG", "Mg")),
    ],
)
def test_other_units_are_refused(unit: str, words: str) -> None:
    assert not is_unit(unit) or words != "not known"
    with pytest.raises(ConfigError, match=words):
        newtons_per(unit, mass_reads_force=True)
