"""Messages in a browser: numbers in the formats of Python, entries of a language, and English where there are none."""

from __future__ import annotations

from typing import Any

import pytest

from acquire.text import Message
from acquire.text.message import about, formatted
from acquire.text.quantity import Amount
from live.words.language import told
from tests.acquire.test_quantity import CASES, quantity_of
from tests.live.ui.web.made_page import MadePage

pytestmark = pytest.mark.slow

VALUES = (0.0, 1.0, -1.5, 3.14159265, 1234567.0, 0.00012345, 1.5e-7, 99.99, 70e9, -0.04, 12, -3, 0)
FORMATS = ("", "g", ".3g", ".6g", ".0f", ".1f", ".4f", "+.0f", "+.4g", ".0%", ".1%", ".1e")
FILL = """async ([language, message]) => { const { setLanguage, told } = await import("/static/words.js");
    await setLanguage(language); return told(message); }"""
NUMBERS = """async cases => { const { number } = await import("/static/words.js");
    return cases.map(([value, format]) => number(value, format)); }"""

QUANTITIES = """async ([language, cases]) => { const { setLanguage } = await import("/static/words.js");
    const { quantityText } = await import("/static/numbers.js");
    await setLanguage(language); return cases.map(quantityText); }"""


def test_numbers_are_those_of_python(browser: Any) -> None:
    page = MadePage(browser)
    # JSON knows no difference between 1.0 and 1, and JavaScript shows the latter.
    cases = [(value, spec) for value in VALUES for spec in FORMATS if spec or value != int(value)]
    shown = page.page.evaluate(NUMBERS, cases)
    assert shown == [formatted(value, spec) for value, spec in cases]
    whole = [(7, "02"), (255, "04x"), (5, "03d"), (12, "d")]
    assert page.page.evaluate(NUMBERS, whole) == [format(value, spec) for value, spec in whole]


@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_quantities_are_those_of_the_table(browser: Any, language: str) -> None:
    page = MadePage(browser)
    cases = [case for case in CASES if language in case]
    sent = [quantity_of(case).to_json() for case in cases]
    assert page.page.evaluate(QUANTITIES, [language, sent]) == [case[language] for case in cases]


@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_a_message_is_the_same_on_the_page_and_in_a_terminal(browser: Any, language: str) -> None:
    page = MadePage(browser)
    text = about(
        "/dev/video0",
        Message("no picture for {waited:.1f} s; still waiting (trigger, cable, light control?)", 2.13),
    )
    drift = Message(
        "strain drifts by {drift} from left to right, in x and y alike", Amount("strain", -0.0012)
    )
    messages: list[Any] = [
        text,
        drift,
        Message("{{a}} {b}", "<b>{c}</b>"),
        Message("waiting"),
        about("file", Message("waiting")),
        *("file", "Run", "stress", "a name that nobody knows"),
    ]
    for one in messages:
        sent = one.to_json() if isinstance(one, Message) else one
        assert page.page.evaluate(FILL, [language, sent]) == told(one, language)


def test_without_entries_the_page_stays_english(browser: Any) -> None:
    page = MadePage(browser)
    page.page.route("**/words/fr.json", lambda route: route.fulfill(status=404))
    message = Message("measuring is paused").to_json()
    assert page.page.evaluate(FILL, ["fr", message]) == "measuring is paused"
