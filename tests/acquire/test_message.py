"""Messages: English text, template and values, nested, joined, as JSON, and pickled."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

from acquire.text import Message
from acquire.text.message import about, filled, formatted, from_json, joined, kept, taken
from acquire.text.quantity import Amount


def test_it_is_its_english_text() -> None:
    text = Message("no picture for {waited:.1f} s; {what}", waited=2.13, what="still waiting")
    assert text == "no picture for 2.1 s; still waiting" and isinstance(text, str)
    assert text.template == "no picture for {waited:.1f} s; {what}"
    assert text.values == {"waited": 2.13, "what": "still waiting"}


def test_a_field_without_a_value_is_an_error() -> None:
    with pytest.raises(KeyError, match="gone"):
        Message("{gone}")


def test_values_stand_in_the_order_of_the_fields() -> None:
    text = Message("{name}: {n} of {all}, {n:.1f}", "a", 2, all=3)
    assert text == "a: 2 of 3, 2.0" and text.values == {"name": "a", "n": 2, "all": 3}
    for wrong in ((1,), (1, 2, 3)):
        with pytest.raises(ValueError, match="zip"):
            Message("{a} {b}", *wrong)


@pytest.mark.parametrize(
    ("value", "spec", "text"),
    [
        (6350.4, ".3g", "6\u202f350"), (-12345.67, ".1f", "−12\u202f345.7"), (-0.04, ".1f", "0.0"),
        (np.float32(-1.5), ".3g", "−1.5"), (float("nan"), ".1f", "–"), (-1.5, "g", "-1.5"), (54321, "", "54321"),
        (-1e6, "g", "-1000000"),
    ],
)  # fmt: skip
def test_numbers_are_printed_as_quantities_but_for_what_may_be_typed_again(
    value: float, spec: str, text: str
) -> None:
    assert formatted(value, spec) == text


def test_braces_of_the_text_and_of_a_value_stay() -> None:
    assert Message("{{a}} {b}", b="{c}") == "{a} {c}"


def test_it_goes_through_json_and_pickle_with_its_values() -> None:
    text = about("/dev/video0", Message("{n} frames lost", n=np.int64(3)))
    for again in (
        from_json(text.to_json()),
        json.loads(json.dumps(text.to_json()), object_hook=from_json),
        pickle.loads(pickle.dumps(text)),
    ):
        assert isinstance(again, Message)
        assert (again, again.template) == ("/dev/video0: 3 frames lost", "{name}: {what}")
        assert again.values["what"].values == {"n": 3}
    assert from_json({"say": 1}) == {"say": 1}


def test_what_json_does_not_know_is_its_text() -> None:
    assert Message("{error}", error=OSError("gone")).to_json() == {
        "say": "{error}",
        "with": {"error": {"say": "gone", "with": {}}},
    }


def test_parts_stay_messages() -> None:
    text = Message("a {n}", n=1) + "; " + Message("b")
    assert text == "a 1; b" and isinstance(text, Message)
    assert "x: " + Message("b") == "x: b"
    assert joined(", ", ["a", "", "b"]) == "a, b" and joined(", ", []) == ""
    assert Message("a") * True == "a" and Message("a") * False == ""


def test_it_is_filled_by_whoever_shows_it() -> None:
    shown = filled("{a:.1f} und {b}", {"a": 1.25, "b": "c"}, lambda value, spec: f"<{value}|{spec}>")
    assert shown == "<1.25|.1f> und <c|>"


def test_a_file_has_the_english_words_and_the_message() -> None:
    text = about("cell", Message("{force} for {waited:.1f} s", Amount("force", 12.0), 2.5))
    stored = json.loads(json.dumps(kept(text)))
    again = taken(stored)
    assert stored["text"] == again == "cell: 12.0 N for 2.5 s"
    assert isinstance(again, Message) and str(again.values["what"].values["force"]) == "12.0 N"
    assert kept("plain") == {"text": "plain"} and not isinstance(taken({"text": "plain"}), Message)
    assert isinstance(taken(json.loads(json.dumps(kept(Message("plain"))))), Message)


def doubled(depth: int) -> dict[str, object]:
    inner: dict[str, object] = {"say": "{a}{a}", "with": {"a": "xx"}}
    for _ in range(depth):
        inner = {"say": "{a}{a}", "with": {"a": inner}}
    return inner


@pytest.mark.parametrize(
    "message",
    [
        {"say": "other words", "with": {}},
        {"say": "{a:999999999}", "with": {"a": "x"}},
        {"say": "{a:.999999999f}", "with": {"a": 1.5}},
        {"say": "{gone}", "with": {}},
        {"say": 7, "with": {}},
        {"say": "{a}", "with": [1]},
        {"say": "{a}", "with": {"a": Amount("strain", 1.0).to_json() | {"digits": 10**9}}},
        {"say": "{a}", "with": {"a": Amount("strain", 1.0).to_json() | {"kind": "no kind"}}},
        doubled(60),
        doubled(100_000 // 200),
        None,
        "words",
    ],
)
def test_a_message_of_a_file_that_says_something_else_is_not_taken(message: object) -> None:
    assert type(taken({"text": "the words", "message": message})) is str
    assert taken({"text": "the words", "message": message}) == "the words"
