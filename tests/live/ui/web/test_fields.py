"""Fields for numbers: what a text is read as, what is refused, and what is kept."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from tests.live.ui.web.made_page import MadePage

pytestmark = pytest.mark.slow

CASES: list[tuple[str, str, float | None]] = [
    ("20.5", "mm", 20.5), ("20,5", "mm", 20.5), (" 20 ", "mm", 20.0), ("", "mm", None), ("  ", "mm", None),
    ("+3", "mm", 3.0), ("-3", "", -3.0), ("−3", "", -3.0), (".5", "mm", 0.5), (",5", "mm", 0.5), ("5.", "mm", 5.0),
    ("1e-3", "", 1e-3), ("2E3", "", 2000.0), ("1,5e3", "", 1500.0), ("0", "mm", 0.0),
    # Groups: by spaces, apostrophes, or the mark that is not the decimal one.
    ("1 234", "mm", 1234.0), ("1\u202f234,5", "mm", 1234.5), ("1\u00a0234.5", "mm", 1234.5), ("1'234.5", "mm", 1234.5),
    ("1’234", "mm", 1234.0), ("1,234.5", "mm", 1234.5), ("1.234,5", "mm", 1234.5), ("1.234.567", "", 1234567.0),
    ("1,234,567", "", 1234567.0), ("12 345 678,9", "", 12345678.9),
    # One mark is a decimal mark.
    ("1,234", "mm", 1.234), ("1.234", "mm", 1.234),
    # Units.
    ("20 mm", "mm", 20.0), ("2 cm", "mm", 20.0), ("2cm", "mm", 20.0), ("0,02 m", "mm", 20.0), ("500 µm", "mm", 0.5),
    ("500 μm", "mm", 0.5), ("500um", "mm", 0.5), ("0.8 in", "mm", 20.32), ('1"', "mm", 25.4), ("2 CM", "mm", 20.0),
    ("1 234,5 µm", "mm", 1.2345), ("30 Hz", "1/s", 30.0), ("30 fps", "1/s", 30.0), ("30/s", "1/s", 30.0),
    ("0.3 %", "µm/m", 3000.0), ("300 µm/m", "%", 0.03), ("7", "%", 7.0),
    # Refused.
    *((text, "mm", math.nan) for text in (
        "abc", "1.5o", "l5", "20,5,5", "1,2,3", "1,23,456", "12,34.5", "1.2.3", "2 5", "1 2345", "20 kg", "2 N", "--3",
        "+-3", "3-", "1e", "e3", "1e999", "NaN", "Infinity", "0x10", "½", "5²", "20 %", "2 x 3", "2*3", "20;5", ".",
        ",", "-", "1 000 00", "2 M", "mm", "20 mm mm",
    )),
    ("20 mm", "", math.nan), ("20 µm/m", "mm", math.nan), ("3 Hz", "mm", math.nan),
]  # fmt: skip
READ = """async cases => { const { readNumber } = await import("/static/fields.js");
    return cases.map(([text, unit]) => readNumber(text, unit)).map((v) => Number.isNaN(v) ? "refused" : v); }"""
WIDTH = '[data-set="specimen.width_mm"]'
SAYS = f"() => document.querySelector('{WIDTH}').closest('.field').querySelector('.says').textContent"


@pytest.fixture(scope="module")
def plain(browser: Any) -> Iterator[MadePage]:
    made = MadePage(browser)
    yield made
    made.page.context.close()


@pytest.fixture
def page(browser: Any) -> Iterator[MadePage]:
    made = MadePage(browser)
    made.set_up()
    made.step("specimen")
    made.sent()
    yield made
    assert not made.errors
    made.page.context.close()


def test_what_a_text_is_read_as(plain: MadePage) -> None:
    found = plain.page.evaluate(READ, [case[:2] for case in CASES])
    wanted = ["refused" if value is not None and math.isnan(value) else value for *_, value in CASES]
    assert dict(zip([case[:2] for case in CASES], found, strict=True)) == dict(
        zip([case[:2] for case in CASES], wanted, strict=True)
    )


def enter(page: MadePage, text: str, key: str = "Tab") -> list[dict[str, Any]]:
    page.page.fill(WIDTH, text)
    page.page.press(WIDTH, key)
    return page.sent()


@pytest.mark.parametrize(
    ("text", "value", "says"),
    [
        ("25", 25, ""),
        ("25.50", 25.5, ""),
        ("20,5", 20.5, "“20,5” read as 20.5 mm"),
        ("2.5 cm", 25, "“2.5 cm” read as 25 mm"),
        ("0.8 in", 20.32, "“0.8 in” read as 20.32 mm"),
        ("1,234", 1.234, "“1,234” read as 1.234 mm"),
        ("1 250", 1250, "“1 250” read as 1250 mm"),
    ],
)
def test_what_differs_from_the_text_is_said(page: MadePage, text: str, value: float, says: str) -> None:
    assert enter(page, text) == [{"side": "", "do": "set", "key": "specimen.width_mm", "value": value}]
    assert page.page.evaluate(SAYS) == says and page.page.input_value(WIDTH) == f"{value:g}"


@pytest.mark.parametrize("text", ["abc", "1.5o", "20 kg"])
def test_what_is_no_number_changes_nothing_and_says_what_is_kept(page: MadePage, text: str) -> None:
    assert enter(page, text) == []
    says = f"“{text}” is not a length; 20 mm is kept"
    page.set_up(picture=2)
    assert page.page.evaluate(SAYS) == says and page.page.input_value(WIDTH) == text
    assert page.page.get_attribute(WIDTH, "aria-invalid") == "true"
    page.page.focus(WIDTH)
    page.page.keyboard.press("Escape")
    assert page.page.input_value(WIDTH) == "20" and page.page.evaluate(SAYS) == "" and page.sent() == []
    assert enter(page, text) == []
    page.set_up(specimen={**SPECIMEN, "width_mm": 12.0})
    assert page.page.input_value(WIDTH) == "12", "another page has changed it"


SPECIMEN = {"width_mm": 20.0, "thickness_mm": 1.5, "diameter_mm": None, "gauge_length_mm": None, "axis": "auto",
            "area_mm2": 30.0}  # fmt: skip


def test_a_refusal_of_the_program_is_shown_and_an_empty_text_clears(page: MadePage) -> None:
    page.answer("width_mm is a number from 0.001 to 100000")
    assert enter(page, "0")[0]["value"] == 0
    says = "width_mm is a number from 0.001 to 100000: 20 mm is kept"
    page.until(lambda: page.page.evaluate(SAYS) == says, "the program's words")
    assert [one["value"] for one in enter(page, "")] == [""]
    page.set_up(specimen={**SPECIMEN, "width_mm": None, "area_mm2": None})
    assert page.page.input_value(WIDTH) == "" and page.text("section") == "no section: forces, no stresses"


def test_arrows_the_wheel_and_an_unchanged_text_change_nothing(page: MadePage) -> None:
    page.page.focus(WIDTH)
    for key in ("ArrowUp", "ArrowDown", "PageUp"):
        page.page.keyboard.press(key)
    page.page.hover(WIDTH)
    page.page.mouse.wheel(0, 100)
    page.page.keyboard.press("Tab")
    assert page.page.input_value(WIDTH) == "20" and page.sent() == []
    assert enter(page, "20.0") == [] and page.text("section") == "Section 30.00 mm²"


def test_every_field_for_a_number_is_of_one_kind(page: MadePage) -> None:
    kinds = page.page.evaluate(
        "() => [...document.querySelectorAll('[data-number], #rate, #limit')].map((one) => [one.type, one.inputMode])"
    )
    assert kinds == [["text", "decimal"]] * 6
    assert not page.page.locator("input[type=number]").count()
    page.step("camera")
    page.page.fill("#rate", "12,5 Hz")
    page.page.press("#rate", "Enter")
    assert page.sent()[-1] == {"side": "", "do": "option", "key": "fps", "value": 12.5}
    page.page.fill("#rate", "fast")
    page.page.press("#rate", "Tab")
    assert page.sent() == []


def test_a_decimal_comma_in_german(browser: Any) -> None:
    made = MadePage(browser, "de-DE")
    made.set_up(specimen={**SPECIMEN, "width_mm": 20.5})
    made.step("specimen")
    assert made.page.input_value(WIDTH) == "20,5"
    made.sent()
    assert enter(made, "20,25")[0]["value"] == 20.25 and made.page.evaluate(SAYS) == ""
    assert enter(made, "1.234")[0]["value"] == 1.234
    assert made.page.evaluate(SAYS) == "„1.234“ gelesen als 1,234 mm"
    made.page.context.close()


def test_the_forms_of_scale_and_board_read_numbers_and_can_be_left(page: MadePage) -> None:
    page.step("gauges")
    page.page.keyboard.press("b")
    assert "inner corners" in page.text("hint")
    for name, text in (("columns", "8"), ("rows", "6,5"), ("square", "0.6 cm")):
        page.page.fill(f"#scale [name={name}]", text)
    page.page.click("#scale button:has-text('Apply')")
    assert page.sent() == [] and "“6,5” is not a whole number" in page.text("scale")
    page.page.fill("#scale [name=rows]", "6")
    page.page.fill("#scale [name=marker]", "abc")
    page.page.click("#scale button:has-text('Apply')")
    assert page.sent() == [], "a marker that is no number is no board without markers"
    page.page.fill("#scale [name=marker]", "")
    page.answer("no board is seen")
    page.page.click("#scale button:has-text('Apply')")
    assert page.sent() == [
        {"side": "", "do": "board", "dictionary": "4X4_50", "columns": 8, "rows": 6, "square": 6, "marker": 0}
    ]
    assert page.page.input_value("#scale [name=columns]") == "8", "a refused form stays"
    page.page.click("#scale button:has-text('Cancel')")
    assert not page.page.locator("#scale form").count()
    page.page.click("#board")
    page.page.keyboard.press("Escape")
    assert not page.page.locator("#scale form").count() and page.sent() == []


def test_why_a_start_was_refused_stands_until_what_it_depends_on_changes(page: MadePage) -> None:
    page.set_up(region=None, go=True)
    page.until(lambda: not page.page.locator("body.pausing").count(), "a press is taken")
    page.answer("no region is found yet")
    page.page.click("#start")
    page.until(lambda: page.text("answer") == "no region is found yet", "it is refused")
    page.set_up(region=None, go=True, picture=7)
    assert page.text("answer") == "no region is found yet"
    page.set_up(go=True)
    page.until(lambda: not page.text("answer"), "its reason is gone")
    assert page.page.get_attribute("#answer", "class") == ""


def test_a_setting_of_the_kind_of_camera_is_written_into_its_address(page: MadePage) -> None:
    page.set_up(address="sim:woven?fps=20&hole=30")
    page.step("camera")
    page.page.click("#camerakind > summary")
    field = page.page.locator("#camerasettings input[aria-label^='hole ']")
    assert (field.input_value(), field.get_attribute("placeholder")) == ("30", "60.0")
    page.sent()
    for text, address in (("45", "sim:woven?fps=20&hole=45"), ("", "sim:woven?fps=20")):
        field.fill(text)
        field.blur()
        sent: list[dict[str, Any]] = []
        page.until(lambda sent=sent: bool(sent.extend(page.sent()) or sent), "it is sent")  # type: ignore[misc]
        assert [(one["do"], one["value"]) for one in sent] == [("address", address)]
    page.answer("not possible")
    field.fill("no")
    field.blur()
    page.until(lambda: field.input_value() == "30", "what is refused is not kept")
    page.set_up(address="session:run.h5")
    assert page.page.is_hidden("#camerakind"), "it has none"


LOAD = {"name": "a cell", "trouble": "", "force_N": 1.0, "noise_N": 0.5, "rate": 80.0, "zero_N": 0.0}


def test_a_setting_of_the_load_cell_and_of_its_protocol_is_written_into_its_address(page: MadePage) -> None:
    address = "/dev/ttyUSB0?protocol=lines&pattern=(?P<value>\\d+)&sign=+1"
    page.set_up(load=LOAD | {"address": address})
    page.step("camera")
    page.page.click("#loadkind > summary")
    settings = page.page.locator("#loadsettings")
    assert settings.locator("input[aria-label^='sign ']").input_value() == "+1"
    assert settings.locator("input[aria-label^='pattern ']").input_value() == "(?P<value>\\d+)"
    assert not settings.locator("input[aria-label^='column ']").count(), "that is of another protocol"
    page.sent()
    field = settings.locator("input[aria-label^='capacity ']")
    field.fill("500")
    field.blur()
    sent: list[dict[str, Any]] = []
    page.until(lambda: bool(sent.extend(page.sent()) or sent), "it is sent")  # type: ignore[func-returns-value]
    assert [(one["do"], one["value"]) for one in sent] == [("load", f"{address}&capacity=500")]
    page.set_up(load=LOAD | {"address": "none:"})
    assert page.page.is_hidden("#loadkind"), "it has none"
