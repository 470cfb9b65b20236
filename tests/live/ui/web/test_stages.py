"""Each stage of the page in a real browser: what a finger, a mouse and an eye meet there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from acquire.text.quantity import Amount
from tests.live.ui.web.browser import Page
from tests.live.ui.web.conftest import CAMERA, OPTIONS, Begin, Start, another, measuring, opened, started
from tests.live.ui.web.legibility import LETTERS, LINES, LOCALES, contrast, fits, readable

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


ASKED = """() => [document.querySelector(".armed") !== null, document.body.classList.contains("pausing")]"""
# Armed and pressed again at once: no timer runs in between.
TOO_EARLY = """() => { const button = document.querySelector("[data-part=setup] [data-line=quit]");
    for (let k = 0; k < 4; k++) button.click();
    return [button.className, button.textContent]; }"""


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
    assert page.stage() == "setup" and page.armed(), "held: armed, and no more"
    page.page.keyboard.press("Escape")
    assert not page.armed(), "Escape disarms"
    page.page.dblclick("#start")
    page.page.wait_for_timeout(700)
    assert page.stage() == "setup" and page.armed(), "a double click is not a confirmation"
    page.page.click("#start")
    page.until(lambda: page.stage() == "run", "it runs")
    page.page.keyboard.press("q")
    page.page.click("[data-part=run] .main")
    asked, pausing = page.page.evaluate(ASKED)
    assert not (asked and pausing), "the commands pause for a second"
    page.page.keyboard.press("Escape")
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")
    held(page, "q", 0.8)
    assert page.stage() == "run" and page.armed(), "held: armed, and no more"
    other = opened(browser, page.address)
    other.until(lambda: other.stage() == "run", "another page")
    other.press("q")
    other.page.wait_for_timeout(900)
    assert page.stage() == other.stage() == "run", "two pages do not confirm one another"
    page.until(lambda: not page.armed(), "four seconds disarm")
    page.press("q")
    page.confirm()
    page.until(lambda: page.stage() == "after", "it ends")
    other.until(lambda: other.stage() == "after" and not other.armed(), "no button is armed any more")
    held(page, "s", 1.5)
    assert page.stage() == "after", "the keys of start, record and next differ"
    page.press("n")
    page.until(lambda: page.stage() == "setup", "the next specimen")
    held(page, "n", 1.2)
    assert page.stage() == "setup" and not page.errors


def test_a_confirmation_takes_half_a_second(start: Start) -> None:
    page = start()
    page.page.wait_for_timeout(1100)
    classes, words = page.page.evaluate(TOO_EARLY)
    assert "armed" in classes and "Press again: End phasedic" in words
    assert page.stage() == "setup" and page.armed(), "too early"
    assert page.text("answer").startswith("End phasedic? No test is running."), "said why"
    page.confirm()
    page.until(lambda: page.stage() == "gone", "it has ended")


def test_the_load_cell_in_the_set_up(start: Start) -> None:
    page = start()
    page.until(lambda: any(map(str.isdigit, page.text("setupforce"))), "the force is live")
    assert re.fullmatch(r"[+−]?\d+(\.\d+)?N", page.page.text_content("#setupforcetile .value"))
    page.page.click("#step-camera > summary")
    page.until(lambda: "1.0" in page.text("forcenoise") or "0.9" in page.text("forcenoise"), "its noise")
    page.page.click("#step-camera [data-do=tare]")
    page.until(lambda: "zero" in page.text("zero") or "still" in page.text("answer"), "tared, or why not")
    page.page.keyboard.press("c")
    page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "a verdict")
    assert "Load cell" in page.text("verdicts")
    page.page.click("#step-camera > summary")
    page.page.fill("#loadaddress", "/dev/nothing?protocol=ascii")
    page.page.press("#loadaddress", "Enter")
    page.until(lambda: "there is no such port" in page.text("loadtrouble"), "the reason")
    page.page.keyboard.press("c")
    page.until(lambda: page.text("verdict") == "NO-GO", "a missing cell is NO-GO")
    assert "load cell" in page.text("reason")
    button = page.page.locator("#start")
    assert "Start without GO" in str(button.text_content()) and "doubtful" in button.get_attribute("class")
    page.press("s")
    assert "load cell" in page.text("answer")
    page.confirm()
    page.until(lambda: page.page.is_visible("#failed"), "a failed start leads back")
    assert page.stage() == "setup" and "there is no such port" in page.text("whyfailed")
    size = page.page.evaluate(
        "() => parseFloat(getComputedStyle(document.getElementById('whyfailed')).fontSize)"
    )
    assert size >= 18, "large"


def test_devices_by_hand(start: Start) -> None:
    page = start(load="none:")
    page.page.click("#step-camera > summary")
    page.until(lambda: page.page.locator("#cameras option[value='sim:hole']").count() == 1, "the list")
    page.page.fill("#rate", "7")
    page.page.press("#rate", "Tab")
    page.until(lambda: ", 7 1/s" in page.text("camera"), "another rate, and nothing restarts")
    page.page.select_option("#cameras", "sim:hole")
    page.until(lambda: "640 × 512" in page.text("camera"), "another camera")
    page.page.fill("#cameraaddress", "/dev/video99")
    page.page.press("#cameraaddress", "Enter")
    page.until(lambda: "no" in str(page.page.get_attribute("#answer", "class")), "it is refused")
    assert len(page.text("answer")) > 10 and "defect" not in page.text("answer")
    page.until(lambda: page.page.input_value("#cameraaddress") == "sim:hole", "the camera stays")
    assert page.text("setupforce") == "none"
    page.page.select_option("#loads", "sim:")
    page.until(lambda: any(map(str.isdigit, page.text("setupforce"))), "a load cell from the list")
    assert not page.errors


def test_gauges(start: Start) -> None:
    page = start()
    page.page.wait_for_timeout(400)
    page.page.keyboard.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "placed where there are none")
    page.press("g")
    assert page.armed() and "replaced" in page.text("answer"), "asked before they are replaced"
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
        .map(e => getComputedStyle(e).stroke + getComputedStyle(e).strokeDasharray)).size"""
    assert page.page.evaluate(colours) == 12
    scrolls = "() => { const e = document.querySelector('.steps'); return e.scrollHeight > e.clientHeight; }"
    assert page.page.evaluate(scrolls), "a long list scrolls, what follows stays"
    page.page.locator("#board").scroll_into_view_if_needed()
    started(page)
    page.until(lambda: page.page.locator("#others li .key").count() == 14, "the keys of the curves")
    assert not page.errors


def test_a_run(start: Start) -> None:
    page = start()
    page.page.keyboard.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "gauges")
    started(page)
    page.until(lambda: page.text("axialsigma").startswith("± "), "a sigma")
    number = page.text("axialsigma").removeprefix("± ").removesuffix(" µm/m")
    assert len(number.replace(".", "").lstrip("0")) == 1, "one digit while it is live"
    page.until(
        lambda: page.text("elongation") != "–" and "·10" in page.text("strainrate"), "elongation, rate"
    )
    legend = page.page.locator("#maplegend")
    page.page.select_option("#range", "symmetric")
    marks = legend.locator(".marks:not(.up) span")
    page.until(lambda: marks.nth(0).text_content() == f"−{marks.nth(2).text_content()}", "symmetric")
    page.page.select_option("#range", "fixed")
    page.page.fill("#limit", "5000")
    page.page.press("#limit", "Tab")
    page.until(lambda: marks.nth(2).text_content() == "5\u202f000", "fixed")
    assert legend.locator(".histogram.up rect").count() == 24
    box = page.page.locator("#gaugemap").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(*middle)
    page.page.mouse.move(middle[0] + 3, middle[1])
    page.until(
        lambda: re.search(r"px: −?\d+", page.text("readout")) is not None, "the value under the pointer"
    )
    page.page.mouse.wheel(0, -200)
    assert "scale" in page.page.evaluate("() => document.querySelector('#run .zoomed').style.transform")
    page.page.select_option("#component", "status")
    page.until(lambda: "measured" in legend.locator(".statuses").inner_text(), "a legend of the statuses")
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
    tiles = page.page.locator("#tiles .tile")
    words = [str(tiles.nth(k).text_content()) for k in range(tiles.count())]
    assert len(words) == 4 and any(
        re.match(r"Rm≥ [\d.]+MPaat leastthe test ended before", text) for text in words
    ), words
    rows = page.page.locator("#results .row:not(.words):not(:has(.small))")
    heights = [rows.nth(k).bounding_box()["height"] for k in range(rows.count())]
    assert max(heights, default=0) < 34, "a figure and its interval are one line"
    assert page.page.locator("#gaugeresults li").count() == 3 and "µm/m" in page.text("gaugeresults")
    assert page.text("believed"), "whether they can be believed"
    assert "every frame is accounted for" in page.text("ledger")
    page.until(
        lambda: page.page.evaluate("() => document.getElementById('peakmap').naturalWidth") > 0, "a map"
    )
    page.until(lambda: page.page.locator("#curve3 canvas").count() == 1, "the curve")
    page.press("m")
    page.until(lambda: page.stage() == "setup", "the same specimen again")
    page.page.click("#step-specimen > summary")
    page.until(lambda: page.page.input_value('[data-set="metadata.specimen"]') == "specimen-1", "its name")
    assert not page.errors


def test_the_whole_way_in_three_languages(browser: Any, start: Start) -> None:
    """Set-up, check, gauges, start, record, end, result and report, at three sizes; every text in its language."""
    page = start()
    pages = [page, *(another(browser, page.address, locale) for locale in LOCALES[1:])]
    page.page.keyboard.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "gauges")
    for tab in ("camera", "specimen", "gauges", "check"):
        if tab == "check":
            page.page.keyboard.press("c")
            page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "a verdict")
        for one in pages:
            one.page.click(f"#step-{tab} > summary")
            fits(one, tab)
        readable(page, tab)
    page.page.keyboard.press("s")
    if page.text("verdict") == "NO-GO":
        page.confirm()
    measuring(page)
    for one in pages:
        one.until(lambda one=one: one.text("axialsigma").startswith("±"), "figures")  # type: ignore[misc]
        fits(one, "run")
        one.page.set_viewport_size({"width": 390, "height": 800})
        assert all(one.page.is_visible(what) for what in ("#force", "#curve1", "[data-part=run] .main"))
        one.page.set_viewport_size({"width": 1280, "height": 800})
    readable(page, "run")
    page.press("x")
    page.until(page.armed, "a button is armed")
    readable(page, "armed")
    if not page.armed():  # four seconds are over
        page.press("x")
    page.confirm()
    page.until(lambda: page.page.get_attribute("#state .rec", "class") == "rec off", "not recorded")
    page.press("e")
    page.until(lambda: page.page.get_attribute("#state .rec", "class") == "rec on", "recorded")
    page.page.select_option("#component", "status")
    page.press("q")
    page.confirm()
    for one, locale in zip(pages, LOCALES, strict=True):
        one.until(lambda one=one: one.stage() == "after", "it ends")  # type: ignore[misc]
        one.until(
            lambda one=one: one.page.get_attribute("#report", "aria-disabled") == "false",  # type: ignore[misc]
            "the report is made",
        )
        fits(one, "after")
        assert one.page.evaluate("() => [...untranslated]") == []
        assert one.page.get_attribute("html", "lang") == locale[:2] and not one.errors
    readable(page, "after")


SHOW_RESULT = """async result => { const { showAfter } = await import("/static/after.js");
    document.body.dataset.stage = "after"; await showAfter(result); }"""
UNEVEN = "the strain varies by 12 % over the region"
FIGURES = [
    {"name": "E", "text": Amount("stress", 71e9, 10e9, 2).to_json(), "remark": UNEVEN},
    {"name": "E by chord", "text": None, "why": "no chord: 3 points from 0.05 to 0.25 %, and 5 are needed"},
    {"name": "nu", "text": Amount("", 0.33035, 0.00083, 2).to_json(), "remark": UNEVEN},
    {"name": "strain of E and nu", "text": "eyy of the region", "words": True},
    {"name": "interval of E", "text": "scatter; no limits of error are stated", "words": True},
]


def test_remarks_and_words_of_a_result_fit(browser: Any, start: Start) -> None:
    page = start()
    for one in (page, *(another(browser, page.address, locale) for locale in LOCALES[1:])):
        made = {
            "figures": FIGURES,
            "gauges": [],
            "troubles": [],
            "words": "",
            "folder": "runs/bar",
            "ledger": "",
        }
        one.page.evaluate(SHOW_RESULT, {**made, "report": True})
        fits(one, "after")
        assert one.page.inner_text("#results li:first-child b") == "71 GPa ± 10"
        assert not one.errors


def test_a_refusal_in_german_and_the_colours_of_gauges(start: Start) -> None:
    page = start(locale="de-DE", load="none:")
    page.page.click("#step-camera > summary")
    page.page.fill("#cameraaddress", "files:/no/such/folder")
    page.page.press("#cameraaddress", "Enter")
    page.until(lambda: "dort ist kein Bild" in page.text("answer"), "the refusal in German")
    for letters in page.page.evaluate(LETTERS):
        assert contrast(letters, [255, 255, 255]) >= 4.5, letters
    for _ in ("light", "dark"):
        panel, *lines = page.page.evaluate(LINES)
        assert len(lines) == 6 and min(contrast(line, panel) for line in lines) >= 3, lines
        page.page.click("#theme")
    assert page.page.evaluate("() => [...untranslated]") == []


def test_the_front_fails_and_the_back_goes_on(browser: Any, begin: Begin) -> None:
    camera = CAMERA.format(seconds=60)
    cameras = ["--camera", f"{camera}&faults=gone@6", "--back", f"{camera}&side=back&seed=3"]
    page = opened(browser, begin("run", "--page", *cameras, "--load", "sim:", *OPTIONS[:-2]).address)
    page.until(lambda: page.page.locator("#runviews .bad").count() == 1, "the front has failed")
    page.until(lambda: page.text("axialof").endswith(", back"), "the figures of the back")
    assert page.text("word") == "measuring" and "mean" not in page.text("sides")
    page.press("q")
    page.confirm()
    page.until(lambda: page.stage() == "after", "the result")
    assert "front: " in page.text("troubles") and not page.errors


def test_three_cameras_from_the_set_up_to_the_maps(browser: Any, begin: Begin, tmp_path: Path) -> None:
    camera, names = CAMERA.format(seconds=60), ["first", "second", "third"]
    others = [word for seed in (3, 5) for word in ("--beside", f"{camera}&seed={seed}")]
    page = another(browser, begin("page", "--camera", camera, *others, "--load", "sim:", *OPTIONS).address)
    page.until(lambda: page.page.locator("#setupviews [data-view]").count() == 3, "a card of each")
    page.page.click("#setupviews [data-view=third]")
    page.until(lambda: "rig-third.toml" in page.text("file"), "the third is set up")
    picture, card = (page.page.locator(one).bounding_box() for one in ("#frame", "#setupviews"))
    assert picture["y"] + picture["height"] <= card["y"], "the cards are below the picture"
    started(page)
    for name in names:
        page.until(
            lambda name=name: bool(page.page.locator(f"#runviews img[src*='side={name}']").count()), name
        )
    page.page.click("#runviews [data-view=third]")
    page.until(lambda: "side=third" in (page.page.get_attribute("#map", "src") or ""), "the third map")
    page.until(lambda: page.page.locator("#sides li").count() >= 3, "what each does")
    page.until(lambda: "Rm, third" in page.text("sides"), "a figure of the third")
    page.press("q")
    page.confirm()
    page.until(lambda: page.stage() == "after", "the result")
    page.page.click("#peakside button:nth-child(3)")
    page.until(lambda: "side=third" in page.page.get_attribute("#peakmap", "src"), "the third map")
    assert not page.errors and page.page.evaluate("() => [...untranslated]") == []
    assert {path.parent.name for path in tmp_path.glob("runs/*/*/strain.h5")} == {*names}


def test_front_and_back_of_a_test_with_two_cameras(browser: Any, begin: Begin, tmp_path: Path) -> None:
    camera = f"{CAMERA.format(seconds=60)}&bending=5&stand_off_mm=500&settle_mm=0.1"
    cameras = ["--camera", camera, "--back", f"{camera}&side=back&seed=3"]
    page = another(browser, begin("page", *cameras, "--load", "sim:", *OPTIONS).address)
    page.until(lambda: page.page.locator("#setupviews [data-view]").count() == 2, "a card of each")
    page.page.click("#setupviews [data-view=back]")
    page.until(lambda: "rig-back.toml" in page.text("file"), "the back is set up")
    started(page)
    rows: list[str] = []  # read at one moment: on a busy machine the mean may be old a moment later

    def joint() -> bool:
        rows[:] = page.page.locator("#sides li").all_text_contents()
        return any("front minus mean" in row for row in rows)

    page.until(joint, "mean and bending of both")
    assert rows[0].startswith("mean: axial")
    assert [row.endswith("lost 0") for row in rows if row.startswith(("front1", "back1"))] == [True, True]
    page.until(lambda: "Rm" in page.text("sides"), "a strength, which a test of a few bursts has not")
    page.press("q")
    page.confirm()
    page.until(lambda: page.stage() == "after", "the result")
    page.until(lambda: "Rm, both" in page.page.inner_text("#after"), "the figures of both")
    assert not page.errors
    assert {path.parent.name for path in tmp_path.glob("runs/*/*/strain.h5")} == {"front", "back"}
