"""Quantities for people: the table of cases that the page is held to as well, units, ASCII, and JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.text import Message
from acquire.text.message import from_json
from acquire.text.quantity import GAP, IN_ASCII, LIVE_DIGITS, UNITS, Amount, number, unit_of, with_sigma
from live.words.language import said

CASES: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[1] / "quantity_cases.json").read_text("utf-8")
)


def quantity_of(case: dict[str, Any]) -> Amount:
    """The quantity of a case; null is not known."""
    numbers = {key: math.nan if case.get(key) is None else float(case[key]) for key in ("value", "sigma")}
    return Amount(case["kind"], **numbers, digits=case.get("digits", 1), unit=case.get("unit", ""))


@pytest.mark.parametrize("case", CASES, ids=[str(case["en"]) for case in CASES])
def test_a_quantity_is_printed_as_in_the_table(case: dict[str, Any]) -> None:
    for language in {"en", "de", "fr"} & case.keys():
        assert str(quantity_of(case).printed(language)) == case[language]


def test_without_such_letters_it_is_printed_in_ascii() -> None:
    assert str(Amount("strain", -0.0047043, 4.7e-7)).translate(IN_ASCII) == "-4704.3 +- 0.5 um/m"
    assert all(str(quantity_of(case)).translate(IN_ASCII).isascii() for case in CASES)


@given(st.floats(-1e12, 1e12), st.integers(-3, 6))
def test_a_number_reads_back_to_its_last_place(value: float, decimals: int) -> None:
    text = number(value, decimals)
    back = float(text.replace(GAP, "").replace("−", "-"))
    assert abs(back - value) <= 0.5 * 10.0**-decimals * (1 + 1e-9) + abs(value) * 1e-15
    assert not (text.startswith("−") and back == 0)


@given(
    st.sampled_from(sorted(UNITS)),
    st.floats(-1e300, 1e300) | st.just(math.inf),
    st.floats(),
    st.integers(1, 3),
)
def test_any_number_is_printed(kind: str, value: float, sigma: float, digits: int) -> None:
    printed = str(Amount(kind, value, sigma, digits))
    assert len(printed) < 120
    assert float(number(value).replace(GAP, "").replace("−", "-").replace("–", "0")) == pytest.approx(
        value if math.isfinite(value) else 0, rel=5.1e-4, abs=0.5
    )


@given(st.sampled_from(sorted(UNITS)), st.floats(-1e11, 1e11), st.floats(1e-9, 1e9))
def test_a_live_figure_has_few_digits_and_tells_its_sigma(kind: str, value: float, sigma: float) -> None:
    one = unit_of(kind, value).one
    text, half = with_sigma(value / one, sigma / one, 1)
    whole, _, part = text.lstrip("−").partition(".")
    assert not part or len(whole.replace(GAP, "")) + len(part) <= LIVE_DIGITS
    shown = float(half.removeprefix("< ").replace(GAP, ""))
    assert shown >= sigma / one / 2 if half.startswith("<") else 0.5 <= shown * one / sigma <= 2.0


def test_a_quantity_in_a_message_is_data_on_the_wire_and_words_in_a_language() -> None:
    message = Message("strain drifts by {drift} from left to right", Amount("strain", -0.001234, math.nan))
    assert message == "strain drifts by −1\u202f234 µm/m from left to right"
    back = from_json(json.loads(json.dumps(message.to_json()), object_hook=from_json))
    assert back == message and isinstance(back.values["drift"], Amount)
    known = Message("{name} {value}", "a.b", Amount("stress", 70e9, 0.1e9, 2))
    assert said(known, "de") == "a.b 70,00 ± 0,10 GPa"
