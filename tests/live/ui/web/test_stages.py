"""Each stage of the page in a real browser: what a finger, a mouse and an eye meet there."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from live.setup.compiling import compile_ahead
from tests.live.ui.web.browser import FLAGS, Page, Program, chromium

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]
CAMERA = "sim:uniform?width=256&height=192&fps=15&hold=4&end=1&buffers=64&seconds={seconds}"
OPTIONS = ["--zoi", "32", "--section", "20,2", "--scale", "0.1", "--no-view", "--no-rrd", "--page-port", "0"]
Start = Callable[..., Page]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    path = chromium()
    compile_ahead(("uint16", "float32"))
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        opened = driver.chromium.launch(
            executable_path=path, headless=True, chromium_sandbox=False, args=FLAGS
        )
        yield opened
        opened.close()


@pytest.fixture
def start(browser: Any, tmp_path: Path) -> Iterator[Start]:
    """Starts ``phasedic page`` and opens it; whatever happens, it does not run on."""
    programs: list[Program] = []

    def begin(seconds: int = 300, load: str = "sim:", locale: str = "en-US") -> Page:
        camera = CAMERA.format(seconds=seconds)
        programs.append(Program(tmp_path, "page", "--camera", camera, "--load", load, *OPTIONS))
        return another(browser, programs[-1].address, locale)

    yield begin
    for program in programs:
        program.kill()
    assert "Traceback" not in (tmp_path / "err.txt").read_text()


def another(browser: Any, address: str, locale: str = "en-US") -> Page:
    """A page at the address, in a context of its own."""
    page = Page(browser.new_context(viewport={"width": 1280, "height": 800}, locale=locale).new_page())
    page.address = address
    page.page.goto(address)
    page.until(lambda: bool(page.text("region")), "the specimen is found")
    return page


def started(page: Page) -> None:
    """From the set-up, without a check, into the measuring test."""
    page.press("s")
    page.confirm()
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")


def held(page: Page, key: str, seconds: float) -> None:
    """A key that is held: the first press, then repeats."""
    for _ in range(round(seconds / 0.05)):
        page.page.keyboard.down(key)
        page.page.wait_for_timeout(50)
    page.page.keyboard.up(key)


def test_a_finger_that_rests_or_bounces_does_nothing(browser: Any, start: Start) -> None:
    page = start()
    page.until(lambda: not page.page.locator("body.pausing").count(), "the pause is over")
    held(page, "s", 1.5)
    assert page.stage() == "setup" and page.page.is_visible("#ask"), "held: asked, and no more"
    page.page.click("#no")
    page.page.dblclick("#start")
    page.page.wait_for_timeout(700)
    assert page.stage() == "setup" and page.page.is_visible("#ask"), "a double click is not a confirmation"
    page.page.click("#yes")
    page.until(lambda: page.stage() == "run", "it runs")
    page.page.keyboard.press("q")
    page.page.click("#run .main")
    assert not page.page.is_visible("#ask"), "the commands pause for a second"
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")
    held(page, "q", 0.8)
    assert page.stage() == "run" and page.page.is_visible("#ask"), "held: asked, and no more"
    other = Page(browser.new_context(viewport={"width": 1280, "height": 800}, locale="en-US").new_page())
    other.page.goto(page.address)
    other.until(lambda: other.stage() == "run", "another page")
    other.press("q")
    other.page.wait_for_timeout(900)
    assert page.stage() == other.stage() == "run", "two pages do not confirm one another"
    page.page.click("#yes")
    page.until(lambda: page.stage() == "after", "it ends")
    other.until(
        lambda: other.stage() == "after" and not other.page.is_visible("#ask"), "the question is gone"
    )
    held(page, "s", 1.5)
    assert page.stage() == "after", "the keys of start, record and next differ"
    page.press("n")
    page.until(lambda: page.stage() == "setup", "the next specimen")
    held(page, "n", 1.2)
    assert page.stage() == "setup" and not page.errors


def test_a_confirmation_takes_half_a_second(start: Start) -> None:
    page = start()
    page.page.wait_for_timeout(1100)
    page.page.click("#setup [data-line=quit]")
    assert page.page.is_disabled("#yes") and page.page.is_disabled("#no")
    page.page.keyboard.press("y")
    page.page.keyboard.press("Enter")
    assert page.stage() == "setup" and page.page.is_visible("#ask"), "too early"
    trigger, confirm = page.page.locator("#setup [data-line=quit]"), page.page.locator("#yes")
    a, b = trigger.bounding_box(), confirm.bounding_box()
    assert a["x"] + a["width"] < b["x"] or a["y"] > b["y"] + b["height"], "at another place"
    page.until(lambda: page.page.is_enabled("#yes"), "it can be answered")
    page.page.click("#yes")
    page.until(lambda: page.stage() == "gone", "it has ended")


def test_the_load_cell_in_the_set_up(start: Start) -> None:
    page = start()
    page.until(lambda: "N" in page.text("setupforce"), "the force is live")
    assert re.fullmatch(r"[+−]\d+(\.\d+)? N", page.text("setupforce"))
    page.page.click("#tab-devices")
    page.until(lambda: "1.0" in page.text("forcenoise") or "0.9" in page.text("forcenoise"), "its noise")
    page.page.click("#panel-devices [data-do=tare]")
    page.until(lambda: "zero" in page.text("zero") or "still" in page.text("answer"), "tared, or why not")
    page.page.keyboard.press("c")
    page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "a verdict")
    assert "load cell" in page.text("lines")
    page.page.click("#tab-devices")
    page.page.fill("#loadaddress", "/dev/nothing?protocol=ascii")
    page.page.press("#loadaddress", "Enter")
    page.until(lambda: "there is no such port" in page.text("loadtrouble"), "the reason")
    page.page.keyboard.press("c")
    page.until(lambda: page.text("verdict") == "NO-GO", "a missing cell is NO-GO")
    assert "load cell" in page.text("reason")
    button = page.page.locator("#start")
    assert "Start without GO" in str(button.text_content()) and "doubtful" in button.get_attribute("class")
    page.press("s")
    assert "load cell" in page.text("because")
    page.confirm()
    page.until(lambda: page.page.is_visible("#failed"), "a failed start leads back")
    assert page.stage() == "setup" and "there is no such port" in page.text("whyfailed")
    size = page.page.evaluate(
        "() => parseFloat(getComputedStyle(document.getElementById('whyfailed')).fontSize)"
    )
    assert size >= 18, "large"


def test_devices_by_hand(start: Start) -> None:
    page = start(load="none:")
    page.page.click("#tab-devices")
    page.until(lambda: page.page.locator("#cameras option[value='sim:hole']").count() == 1, "the list")
    page.page.fill("#rate", "7")
    page.page.press("#rate", "Tab")
    page.until(lambda: ", 7 fps" in page.text("camera"), "another rate, and nothing restarts")
    page.page.select_option("#cameras", "sim:hole")
    page.until(lambda: "640 × 512" in page.text("camera"), "another camera")
    for address in ("sim:?width=wide", "files:/no/such/folder", "nonsense:1", "/dev/video99"):
        page.page.fill("#cameraaddress", address)
        page.page.press("#cameraaddress", "Enter")
        page.until(lambda: "no" in str(page.page.get_attribute("#answer", "class")), f"{address} is refused")
        assert len(page.text("answer")) > 10 and "defect" not in page.text("answer")
        page.until(lambda: page.page.input_value("#cameraaddress") == "sim:hole", "the camera stays")
        page.page.evaluate("() => { document.getElementById('answer').className = ''; }")
        page.page.wait_for_timeout(350)  # sooner another Enter is a bounce
    assert page.text("setupforce") == "none"
    page.page.select_option("#loads", "sim:")
    page.until(lambda: " N" in page.text("setupforce"), "a load cell from the list")
    page.page.click("#tab-specimen")
    for key, value in (("material", "S235"), ("operator", "A. Smith"), ("note", "second batch")):
        page.page.fill(f'[data-set="metadata.{key}"]', value)
        page.page.press(f'[data-set="metadata.{key}"]', "Tab")
    page.until(lambda: page.posted[-1].get("key") == "metadata.note", "sent")
    assert not page.errors


def test_gauges(start: Start) -> None:
    page = start()
    page.page.wait_for_timeout(400)
    page.page.keyboard.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "placed where there are none")
    page.press("g")
    assert "replaced" in page.text("because"), "asked before they are replaced"
    page.page.keyboard.press("Escape")
    page.page.click("[data-tool=circle]")
    page.drag((120.0, 90.0), (150.0, 90.0))
    page.until(lambda: page.page.locator("#gauges li").count() == 4, "a circle")
    page.page.click("[data-tool=strip]")
    page.drag((60.0, 40.0), (190.0, 150.0))
    page.until(lambda: page.page.locator("#gauges li").count() == 5, "a strip")
    page.page.keyboard.press("z")
    page.until(lambda: page.page.locator("#gauges li").count() == 4, "undone")
    page.page.click("[data-tool=zoi]")
    for k in range(10):
        page.click((80.0 + 7 * k, 65.0))
        page.until(lambda k=k: page.page.locator("#gauges li").count() == 5 + k, "a point")  # type: ignore[misc]
    overlap = """() => { const boxes = [...document.querySelectorAll("#drawing .gaugename")].map(e => e.getBBox());
        return boxes.some((a, i) => boxes.some((b, k) => k > i && a.x < b.x + b.width && b.x < a.x + a.width
            && a.y < b.y + b.height * .8 && b.y < a.y + a.height * .8)); }"""
    assert not page.page.evaluate(overlap), "names lie on one another"
    colours = """() => new Set([...document.querySelectorAll("#gauges .key")].slice(0, 12)
        .map(e => e.style.background)).size"""
    assert page.page.evaluate(colours) == 12
    scrolls = "() => { const e = document.getElementById('gauges'); return e.scrollHeight > e.clientHeight; }"
    assert page.page.evaluate(scrolls) and page.page.is_visible("#board"), (
        "the list scrolls, what follows stays"
    )
    started(page)
    page.until(lambda: page.page.locator("#names li").count() == 14, "a legend beside the curve")
    assert not page.errors


def test_a_run(start: Start) -> None:
    page = start()
    page.page.keyboard.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "gauges")
    started(page)
    assert page.text("rec") == "REC"
    page.press("x")
    page.confirm()
    page.until(lambda: page.text("rec") == "NOT RECORDING", "always written")
    page.press("e")
    page.until(lambda: page.text("rec") == "REC", "recorded again")
    page.until(lambda: page.text("axialsigma").startswith("± "), "a sigma")
    number = page.text("axialsigma").removeprefix("± ").removesuffix(" µm/m")
    assert len(number.replace(".", "").lstrip("0")) == 2, "two digits"
    page.until(
        lambda: "mm" in page.text("elongation") and "1/s" in page.text("strainrate"), "elongation, rate"
    )
    page.page.select_option("#strainunit", "%")
    page.until(lambda: page.text("axialsigma").endswith("%"), "one unit for figures")
    page.until(lambda: page.text("high").endswith("%") and "%" in page.text("others"), "map and gauges too")
    page.page.select_option("#strainunit", "µm/m")
    page.page.select_option("#range", "symmetric")
    page.until(lambda: page.text("low") == "−" + page.text("high").split()[0], "symmetric")
    page.page.select_option("#range", "fixed")
    page.page.fill("#limit", "5000")
    page.page.press("#limit", "Tab")
    page.until(lambda: page.text("high") == "5000 µm/m", "fixed")
    assert page.page.locator("#histogram rect").count() == 24
    box = page.page.locator("#gaugemap").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(*middle)
    page.page.mouse.move(middle[0] + 3, middle[1])
    page.until(
        lambda: re.search(r"px: [+−]\d+", page.text("readout")) is not None, "the value under the pointer"
    )
    page.page.mouse.wheel(0, -200)
    assert "scale" in page.page.evaluate("() => document.querySelector('#run .zoomed').style.transform")
    page.page.select_option("#component", "status")
    page.until(lambda: "measured" in page.text("statuses"), "a legend of the statuses")
    curve = page.page.locator("#curve1 .u-over").bounding_box()
    page.page.mouse.move(curve["x"] + curve["width"] / 2, curve["y"] + curve["height"] / 2)
    page.until(lambda: "MPa" in str(page.page.text_content("#run .curves .at")), "the curve is read out")
    assert not page.errors


def test_after_a_test(start: Start) -> None:
    page = start(seconds=16)
    page.page.keyboard.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "gauges")
    started(page)
    page.until(lambda: page.stage() == "after", "it is over")
    page.until(lambda: page.page.get_attribute("#report", "aria-disabled") == "false", "the report is made")
    rows = page.page.locator("#results tr")
    words = [str(rows.nth(k).text_content()) for k in range(rows.count())]
    assert any(re.match(r"Rm[\d.]+ MPa± [\d.]+", text) for text in words), words
    heights = {round(rows.nth(k).bounding_box()["height"]) for k in range(1, rows.count())}
    assert max(heights) < 40, "one line each"
    assert page.page.locator("#gaugeresults tr").count() == 4 and "µm/m" in page.text("gaugeresults")
    assert "adds up" in page.text("ledger")
    page.until(
        lambda: page.page.evaluate("() => document.getElementById('peakmap').naturalWidth") > 0, "a map"
    )
    page.until(lambda: page.page.locator("#curve3 canvas").count() == 1, "the curve")
    with page.page.context.expect_page() as report:
        page.page.click("#report")
    report.value.wait_for_load_state()
    assert "html" in report.value.content() and report.value.url.endswith("/report")
    report.value.close()
    page.press("m")
    page.until(lambda: page.stage() == "setup", "the same specimen again")
    page.page.click("#tab-specimen")
    page.until(lambda: page.page.input_value('[data-set="metadata.specimen"]') == "specimen-1", "its name")
    assert not page.errors


SIZES = ((1280, 800), (1024, 768), (390, 800))
OUTSIDE = """() => [...document.querySelectorAll("header, .stage, .stage > *, footer > *")].filter(e => {
    const b = e.getBoundingClientRect(), scrolls = e.closest("#after") && innerWidth < 700;
    return b.width && !scrolls && (b.left < -1 || b.top < -1 || b.right > innerWidth + 1
        || b.bottom > innerHeight + 1); }).map(e => `${e.tagName} ${e.id} ${e.className}`)"""
TEXTS = "button, dd, dt, .numbers output, #word, #rec, #stages li"
CUT = f"""() => [...document.querySelectorAll("{TEXTS}")].filter(e => e.getBoundingClientRect().width
    && e.scrollWidth > e.clientWidth + 2).map(e => `${{e.tagName}} ${{e.id}} ${{e.textContent}}`)"""


def fits(page: Page, stage: str) -> None:
    """At three sizes nothing lies outside the window, and no text is cut off."""
    for width, height in SIZES:
        page.page.set_viewport_size({"width": width, "height": height})
        page.page.wait_for_timeout(300)
        assert page.page.evaluate(OUTSIDE) == [], f"{stage} at {width}"
        assert page.page.evaluate(CUT) == [], f"{stage} at {width}"
    page.page.set_viewport_size({"width": 1280, "height": 800})


@pytest.mark.parametrize("locale", ["en-US", "de-DE", "fr-FR"])
def test_the_whole_way(locale: str, start: Start) -> None:
    """Set-up, check, gauges, start, record, end, result and report; every text in the language."""
    page = start(locale=locale)
    page.page.keyboard.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "gauges")
    for tab in ("devices", "picture", "specimen", "check"):
        page.page.click(f"#tab-{tab}")
        fits(page, tab)
    page.page.keyboard.press("c")
    page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "a verdict")
    fits(page, "check")
    page.page.keyboard.press("s")
    if page.text("verdict") == "NO-GO":
        page.confirm()
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")
    fits(page, "run")
    page.page.set_viewport_size({"width": 390, "height": 800})
    assert (
        page.page.is_visible("#force")
        and page.page.is_visible("#curve1")
        and page.page.is_visible("#run .main")
    )
    page.page.set_viewport_size({"width": 1280, "height": 800})
    page.press("x")
    page.confirm()
    page.until(lambda: page.page.get_attribute("#rec", "class") == "off", "not recorded")
    page.press("e")
    page.until(lambda: page.page.get_attribute("#rec", "class") == "on", "recorded")
    page.page.select_option("#component", "status")
    page.press("q")
    page.confirm()
    page.until(lambda: page.stage() == "after", "it ends")
    page.until(lambda: page.page.get_attribute("#report", "aria-disabled") == "false", "the report is made")
    fits(page, "after")
    assert page.page.evaluate("() => [...untranslated]") == []
    assert page.page.get_attribute("html", "lang") == locale[:2] and not page.errors
