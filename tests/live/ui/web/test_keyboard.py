"""The whole way through the page with the keyboard alone; and a recorded session, played back through it."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquire.text.message import from_json
from live.cli import main
from tests.live.ui.web.browser import Page
from tests.live.ui.web.conftest import CAMERA, OPTIONS, Start, measuring

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]
FOCUSED = """selector => { const e = document.activeElement, style = getComputedStyle(e.closest(".box") ?? e);
    const seen = e === document.body || e.matches("main") || style.outlineStyle !== "none" || e.matches(".handle");
    return [e.matches(selector), seen, `${e.tagName} ${e.id} ${e.className}`]; }"""


def tab_to(page: Page, selector: str) -> None:
    """Press Tab until an element has the focus; every one on the way shows that it has it."""
    for _ in range(150):
        found, seen, name = page.page.evaluate(FOCUSED, selector)
        assert seen, f"the focus on {name} is not visible"
        if found:
            return
        page.page.keyboard.press("Tab")
    raise AssertionError(f"Tab does not reach {selector}")


def keys(page: Page, *pressed: tuple[str, int]) -> None:
    """Press keys so often each."""
    for key, count in pressed:
        for _ in range(count):
            page.page.keyboard.press(key)


def set_point(page: Page) -> None:
    """Space, when that is no bounce."""
    page.page.wait_for_timeout(350)
    page.page.keyboard.press(" ")


def last_posted(page: Page, what: str) -> dict[str, object]:
    """The last request of a kind, as soon as there is one."""
    page.until(lambda: any(one.get("do") == what for one in page.posted), f"a request {what}")
    return [one for one in page.posted if one.get("do") == what][-1]


def draw(page: Page) -> None:
    """A rectangle and an extensometer; the cross begins in the middle of 256 x 192 px."""
    page.press("1")
    tab_to(page, "#drawing")
    assert "Space" in page.text("hint")
    keys(page, ("Shift+ArrowLeft", 8), ("Shift+ArrowUp", 6))
    assert page.page.locator("#drawing .cross").count() == 1
    set_point(page)
    keys(page, ("Shift+ArrowRight", 16), ("Shift+ArrowDown", 12), ("ArrowDown", 3))
    set_point(page)
    page.until(lambda: "as drawn" in page.text("region"), "the rectangle is taken")
    (stroke,) = last_posted(page, "draw")["strokes"]  # type: ignore[misc]
    assert stroke["points"] == [[48, 36], [208, 159]]
    page.press("5")
    keys(page, ("Shift+ArrowLeft", 8), ("Shift+ArrowUp", 10), ("ArrowUp", 9))
    set_point(page)
    keys(page, ("Shift+ArrowDown", 9))
    set_point(page)
    page.until(lambda: page.page.locator("#gauges li").count() == 1, "an extensometer")
    assert last_posted(page, "gauge")["points"] == [[128, 50], [128, 140]]
    page.page.keyboard.press("Tab")
    tab_to(page, ".handle")
    page.page.keyboard.press("ArrowUp")
    page.until(lambda: last_posted(page, "gauge")["points"] == [[128, 49], [128, 140]], "a handle is moved")


def fill_in(page: Page) -> None:
    """Steps by Alt and a digit, a text, and a load cell from the list, which opens with Enter and not before."""
    page.page.keyboard.press("Alt+2")
    tab_to(page, "#step-specimen .fold > summary")
    page.press("Enter")
    tab_to(page, '[data-set="metadata.operator"]')
    page.page.keyboard.type("A. Smith")
    page.page.keyboard.press("Tab")
    page.until(lambda: last_posted(page, "set")["value"] == "A. Smith", "the operator")
    while not page.page.evaluate(FOCUSED, "#step-camera > summary")[0]:
        page.page.keyboard.press("Shift+Tab")
    page.press("Enter")
    page.until(
        lambda: page.page.locator("#loads option[value='none:']").count() == 1, "the list of load cells"
    )
    tab_to(page, "#loads")
    page.page.keyboard.press("ArrowDown")
    page.page.wait_for_timeout(300)
    assert page.page.input_value("#loads") == "none:" and not [
        p for p in page.posted if p.get("do") == "load"
    ]
    page.page.keyboard.press("ArrowUp")
    page.page.keyboard.press("Enter")
    page.until(lambda: last_posted(page, "load")["value"] == "sim:", "chosen with Enter")
    page.page.keyboard.press("Tab")


def again(page: Page, key: str) -> None:
    """The same key once more, when the button that it pressed is armed and it counts."""
    page.until(page.armed, "a button is armed")
    page.page.wait_for_timeout(300)
    page.press(key)


def test_the_whole_way_by_keyboard(start: Start) -> None:
    page = start(reduced_motion="reduce")
    moving = "() => document.getAnimations().length"
    draw(page)
    fill_in(page)
    page.page.evaluate("() => document.activeElement.blur()")
    page.press("c")
    page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "a verdict")
    page.press("s")
    if page.text("verdict") == "NO-GO":
        again(page, "s")
    measuring(page)
    assert page.page.evaluate("() => document.activeElement.id") == "run", "the focus follows the stage"
    page.until(lambda: page.text("axialsigma").startswith("±"), "figures")
    tab_to(page, "#gaugemap")
    page.page.keyboard.press("ArrowLeft")
    page.until(lambda: "x 127, y 96 px: " in page.text("readout"), "the value at the cross")
    page.press("+")
    assert "scale(1.25)" in page.page.evaluate("() => document.querySelector('#run .zoomed').style.transform")
    tab_to(page, "#curve1")
    page.page.keyboard.press("ArrowLeft")
    page.until(lambda: "MPa" in str(page.page.text_content("#run .curves .at")), "a point is read out")
    page.press("n")
    page.page.keyboard.type("by hand")
    page.page.keyboard.press("Enter")
    page.until(lambda: "by hand" in page.text("events"), "a note")
    page.press("x")
    page.until(page.armed, "a button is armed")
    assert page.page.evaluate(moving) == 0, "no motion where less of it is asked for"
    again(page, "x")
    page.until(lambda: page.text("rec") == "NOT RECORDING", "stopped")
    page.press("e")
    page.until(lambda: page.text("rec") == "REC", "recorded again")
    page.press("q")
    again(page, "q")
    page.until(lambda: page.stage() == "after", "it ends")
    page.until(lambda: page.page.get_attribute("#report", "aria-disabled") == "false", "the report is made")
    tab_to(page, "#report")
    with page.page.context.expect_page() as report:
        page.press("Enter")
    report.value.close()
    page.press("n")
    page.until(lambda: page.stage() == "setup", "the next specimen")
    tab_to(page, "[data-part=setup] [data-line=quit]")
    page.press("Enter")
    again(page, "Enter")
    page.until(lambda: page.stage() == "gone", "it has ended")
    assert not page.errors


# All states that the page receives; and after the run the points of its curves.
LISTEN = """() => { window.states = []; new EventSource("/events").addEventListener("run",
    event => window.states.push(JSON.parse(event.data))); }"""
POINTS = "async () => (await fetch('/points?edition=0&count=0')).json()"


def choose(page: Page, select: str, address: str) -> None:
    page.until(
        lambda: page.page.locator(f"#{select} option[value='{address}']").count() == 1, f"{address} is listed"
    )
    with page.page.expect_response("**/setup") as opened:
        page.page.select_option(f"#{select}", address)
    assert not opened.value.json()["refused"]


def test_a_recording_shows_force_strain_and_curve_of_one_instant(
    start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    camera = CAMERA.format(seconds=12) + "&lockstep=yes"
    assert main(["run", "--camera", camera, "--load", "sim:", "--out", "runs/bar", *OPTIONS[:-2]]) == 0
    page = start(load="none:")
    page.page.click("#step-camera > summary")
    for select in ("cameras", "loads"):
        choose(page, select, "session:runs/bar/session.h5")
    page.page.keyboard.press("c")
    page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "a verdict on the first frames")
    page.page.evaluate(LISTEN)
    page.press("s")
    if page.text("verdict") == "NO-GO":
        page.confirm()
    page.until(lambda: page.stage() == "after", "the recording is over")
    assert check_every_instant(page) >= 3
    assert "every frame is accounted for" in page.text("ledger") and not page.errors


def check_every_instant(page: Page) -> int:
    """Each state shows force, stress, strain and latency of the last point that the curve had then; their number."""
    rows = page.page.evaluate(POINTS)["rows"]
    states = [one for one in page.page.evaluate("() => window.states") if one["points"][1] and "axial" in one]
    states = [one for one in states if one["figures"]["stress"]["state"] != "ended"]
    for state in states:
        _, stress, axial, *_ = rows[state["points"][1] - 1]
        assert state["figures"]["stress"]["value"] == pytest.approx(stress, rel=1e-6)
        assert state["figures"]["force"]["value"] == pytest.approx(stress * 40e-6, rel=1e-6)
        assert state["figures"]["axial"]["value"] == pytest.approx(axial, rel=1e-6, abs=1e-12)
        assert "delay" not in {str(from_json(one["label"])) for one in state["facts"]}, (
            "a recording is not late"
        )
    return len({one["points"][1] for one in states})
