"""The same number in all notations of the world: read rightly or not at all."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.acquire.protocols.conversation import read_line


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
    if ours and notation.thousands == "" and "column" not in settings and "8388," not in line:
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
