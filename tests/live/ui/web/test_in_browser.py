"""From an unconfigured rig to a report by mouse and keyboard, in a real browser."""

from __future__ import annotations

import itertools
import re
import webbrowser
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from live.commands.attended import page_opened
from live.config.loading import load_config
from live.results.run_folder import open_run
from live.setup.pictures import read_mask
from live.ui.terminal.screen import TerminalScreen
from live.ui.web.authorization import RequestCheck
from live.ui.web.page_controller import PageController
from tests.live.ui.waiting import until
from tests.live.ui.web.browser import Page, Program
from tests.live.ui.web.conftest import Begin, opened

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]
WIDTH, HEIGHT = 480, 384
CAMERA = f"sim:uniform?width={WIDTH}&height={HEIGHT}&fps=15&seconds=42&hold=16&end=1&buffers=64"
# The words of the state bar and the answer to a command may take the room they need: nothing else moves.
WATCH_LAYOUT = """() => { window.moved = [];
    const element = (one) => one.node?.nodeType === 1 ? one.node : one.node?.parentElement;
    const told = (one) => [element(one)?.id || element(one)?.className,
        ...[one.previousRect, one.currentRect].map(r => `${r.x} ${r.y} ${r.height}`)].join(" ");
    let pressed = -1e9; // what is pressed may act later than the browser's half a second on a busy machine
    for (const kind of ["keydown", "pointerdown"]) addEventListener(kind, () => { pressed = performance.now(); }, true);
    new PerformanceObserver(list => window.moved.push(...list.getEntries().filter(e => e.startTime > pressed + 3000
        && e.sources.some(one => !element(one)?.closest("#state, .top"))).map(e => [e.value, ...e.sources.map(told)])))
    .observe({ type: "layout-shift" }); }"""


def distance_to_path(points: list[list[float]]) -> np.ndarray:
    """Distance of each pixel to a path of the mouse, by brute force: many points on each segment."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    nearest = np.hypot(x - points[0][0], y - points[0][1])
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        for part in np.linspace(0, 1, 60):
            nearest = np.minimum(nearest, np.hypot(x - x0 - part * (x1 - x0), y - y0 - part * (y1 - y0)))
    return nearest


def test_from_nothing_to_a_report(browser: Any, tmp_path: Path, begin: Begin) -> None:
    words = ["page", "--camera", CAMERA, "--load", "sim:", "--no-view", "--no-rrd", "--page-port", "0"]
    program = begin(*words)
    page = opened(browser, program.address)
    set_up(page, tmp_path)
    columns, rows = run(page, program)
    with open_run(tmp_path / "runs" / "specimen-1") as of:
        assert of.strain.grid.shape == (rows, columns), "the map has a pixel a point"
    after(page, tmp_path)
    assert program.end() == 0, program.output
    here = program.address.partition("/?")[0]
    assert page.requested and all(url.startswith((here, "data:")) for url in page.requested), (
        "requests another host"
    )
    assert not [one for one in page.errors if "ERR_" not in one], page.errors


def test_a_browser_comes_to_the_page_by_the_file_that_it_is_given(
    browser: Any, begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = begin("page", "--camera", CAMERA, "--load", "sim:", "--no-view", "--no-rrd", "--page-port", "0")
    given: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: given.append(address) or True)
    monkeypatch.setenv("DISPLAY", ":99")
    screen, controller = TerminalScreen(quiet=True), SimpleNamespace(address=program.address)
    with page_opened(cast(PageController, controller), screen):
        until(lambda: given)
        page = opened(browser, given[0])
        page.until(lambda: bool(page.text("region")), "the specimen is found")
    assert page.page.url == program.address.partition("?")[0]


def set_up(page: Page, folder: Path) -> None:
    page.until(lambda: "specimen" in page.text("region"), "the specimen is found")
    page.page.keyboard.press("1")
    page.drag((60.0, 50.0), (420.0, 330.0))
    page.until(lambda: "as drawn" in page.text("region"), "the rectangle is taken")
    page.page.keyboard.press("4")
    page.drag((60.0, 60.0), (100.0, 60.0), (100.0, 100.0))
    page.page.keyboard.press("5")
    gauges = page.page.locator("#gauges li")  # each is taken before the next: they are listed in that order
    page.drag((240.0, 100.0), (240.0, 290.0))
    page.until(lambda: gauges.count() == 1, "the first gauge")
    page.page.keyboard.press("6")
    page.drag((160.0, 150.0), (320.0, 250.0))
    page.until(lambda: gauges.count() == 2, "the second gauge")
    page.page.keyboard.press("8")
    page.click((300.0, 200.0))
    page.until(lambda: gauges.count() == 3, "the third gauge")
    page.page.fill("#gauges li:nth-child(3) input", "middle")
    page.page.press("#gauges li:nth-child(3) input", "Enter")
    page.page.click("#step-specimen > summary")
    for key, value in (("specimen.width_mm", "20"), ("specimen.thickness_mm", "2")):
        page.page.fill(f'[data-set="{key}"]', value)
        page.page.press(f'[data-set="{key}"]', "Tab")
    page.until(lambda: page.posted[-1].get("key") == "specimen.thickness_mm", "the section is sent")
    page.page.evaluate("() => document.activeElement.blur()")
    page.page.keyboard.press("0")
    page.click((100.0, 200.0), (300.0, 200.0))
    page.page.fill("#scale input", "10")
    page.page.press("#scale input", "Enter")
    page.until(lambda: "px/mm" in page.text("scale"), "the scale is taken")
    page.page.keyboard.press("w")
    page.until(lambda: "· saved" in page.text("file"), "it is saved")
    check_saved(page, folder)
    for _ in range(4):  # a busy machine may lose frames of a check
        page.press("c")
        page.until(lambda: page.text("verdict") not in ("GO", "NO-GO"), "it checks")
        page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "a verdict")
        if page.text("verdict") == "GO":
            break
    assert page.text("verdict") == "GO" and page.page.locator("#table tr").count() > 3


def check_saved(page: Page, folder: Path) -> None:
    config = load_config(folder / "rig.toml", {})
    assert config.camera.address == CAMERA and config.specimen.area_m2 == pytest.approx(40e-6)
    x, y, w, h = config.measure.roi
    assert np.allclose((x, y, x + w - 1, y + h - 1), (60, 50, 420, 330), atol=1)
    assert set(config.gauges) == {"axial", "transverse", "middle"}
    assert config.scale.px_per_mm == pytest.approx(20, rel=0.01)
    axial, across, middle = (config.gauges[name] for name in ("axial", "transverse", "middle"))
    assert np.allclose([axial["start"], axial["end"]], [(240, 100), (240, 290)], atol=1)
    assert np.allclose(across["box"], (160, 150, 160, 100), atol=1)
    assert np.allclose(middle["at"], (300, 200), atol=1)
    strokes = [one["strokes"][0] for one in page.posted if one.get("do") == "draw"]
    erased = next(one for one in strokes if one["tool"] == "eraser")
    mask = read_mask(config.measure.mask, WIDTH, HEIGHT)
    painted = np.zeros((HEIGHT, WIDTH), bool)
    painted[y : y + h, x : x + w] = True
    far = distance_to_path(erased["points"])
    painted &= far > erased["radius"]
    sure = np.abs(far - erased["radius"]) > 0.02  # the brute force is exact to a hundredth of a px
    assert mask is not None and np.array_equal(mask[sure], painted[sure])
    assert np.allclose(erased["points"][0], (60, 60), atol=1) and np.allclose(
        erased["points"][-1], (100, 100), atol=1
    )


def run(page: Page, program: Program) -> list[int]:
    """Returns width and height of a map, as it came."""
    page.press("s")
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")
    page.page.wait_for_timeout(1500)
    page.page.evaluate(WATCH_LAYOUT)
    assert_a_page_without_the_token_is_refused(page, program)
    page.page.keyboard.press("t")
    page.until(lambda: page.armed() or "tared" in page.text("answer"), "asked, or tared")
    if page.armed():  # in mid-test, unless the noise is just zero
        page.confirm()
    done = ("N is zero now", "not tared: the load is not still")
    page.until(lambda: any(words in page.text("answer") for words in done), "what the load cell did")
    page.page.keyboard.press("n")
    page.page.keyboard.type("grip slipped")
    page.page.keyboard.press("Enter")
    page.until(lambda: "grip slipped" in page.text("events"), "the note is an event")
    page.page.keyboard.press("p")
    page.confirm()
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "paused", "paused")
    page.page.wait_for_timeout(350)  # sooner it is a bounce
    page.page.keyboard.press("p")
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "measuring again")
    page.page.select_option("#component", "e1")
    size = "() => [document.getElementById('map').naturalWidth, document.getElementById('map').naturalHeight]"
    page.until(lambda: page.page.evaluate(size)[0] > 1, "a map")
    columns_and_rows: list[int] = page.page.evaluate(size)
    with program.frozen():
        page.until(lambda: page.page.is_visible("#nolink"), "NO LINK")
    page.until(lambda: not page.page.is_visible("#nolink"), "the link is back")
    page.until(lambda: page.stage() == "after", "the test is over")
    moved = page.page.evaluate("() => window.moved")
    assert sum(value for value, *_ in moved) < 0.01, f"the layout moved: {sorted(moved)[-12:]}"
    return columns_and_rows


def assert_a_page_without_the_token_is_refused(page: Page, program: Program) -> None:
    context = page.page.context.browser.new_context()
    other = context.new_page()
    answer = other.goto(program.address.partition("?")[0])
    assert answer.status == 403
    context.close()


def after(page: Page, folder: Path) -> None:
    page.until(lambda: page.page.get_attribute("#report", "aria-disabled") == "false", "the report is made")
    modulus, interval = (
        page.page.inner_text(f"#tiles .tile:first-child {part}") for part in (".value", ".sigma")
    )
    number, unit = modulus.split()
    assert unit == "GPa" and 66 < float(number) < 74, modulus
    assert re.fullmatch(r"95 %\s*± [\d.]+", interval), "the interval below it"
    answer = page.page.context.request.get(page.page.url.rstrip("/") + "/report")
    assert answer.status == 200 and "sandbox" in answer.headers["content-security-policy"]
    assert "<html" in answer.text() and (folder / "runs" / "specimen-1" / "report.html").exists()
    page.press("n")
    page.until(lambda: page.stage() == "setup", "the next specimen is set up")
    page.until(lambda: page.page.input_value('[data-set="metadata.specimen"]') == "specimen-2", "counted up")
    page.until(lambda: "as drawn" in page.text("region"), "the same region")
    page.until(lambda: not page.page.locator("body.pausing").count(), "the pause is over")
    page.page.click("[data-part=setup] [data-line=quit]")
    page.confirm()
    page.until(lambda: page.stage() == "gone", "it has ended")


def test_a_page_that_is_killed_changes_nothing(browser: Any, begin: Begin) -> None:
    words = ["run", "--page", "--camera", CAMERA, "--load", "sim:", "--no-view", "--no-rrd", "--out", "out"]
    program = begin(*words)
    page = opened(browser, program.address, color_scheme="dark")
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")
    assert page.page.get_attribute("html", "data-theme") == "dark"
    page.page.context.close()
    page = opened(browser, program.address, color_scheme="light")
    page.until(
        lambda: page.stage() == "run" and any(map(str.isdigit, page.text("force"))), "another sees it too"
    )
    assert page.page.get_attribute("html", "data-theme") == "light"
    page.press("q")
    assert page.stage() == "run", "what ends the test is asked for"
    page.confirm()
    page.until(lambda: page.page.evaluate("() => document.body.classList.contains('ended')"), "it ends")
    assert page.stage() == "after" and "every frame is accounted for" in page.text("ledger"), (
        "what came out stays on the page"
    )
    assert program.end() == 0, program.output
    assert "every frame is accounted for" in program.output and "STOPPED" not in program.output


def test_another_site_gets_nothing(browser: Any, begin: Begin) -> None:
    """A page of another origin: its request carries no cookie, and is refused whatever it says."""
    program = begin("page", "--camera", CAMERA, "--page-port", "0")
    page = opened(browser, program.address)
    page.until(lambda: page.stage() == "setup", "it is there")
    port = int(program.address.partition("/?")[0].rpartition(":")[2])
    guard = RequestCheck(port, "x")
    context = page.page.context
    other = context.new_page()
    other.route("http://evil.example/", lambda route: route.fulfill(body="<p>", content_type="text/html"))
    other.goto("http://evil.example/")
    tried = other.evaluate(
        """origin => Promise.all(["no-cors", "cors"].map(mode => fetch(origin + "/order", { method: "POST", mode,
            credentials: "include", headers: { "Content-Type": mode === "cors" ? "application/json" : "text/plain" },
            body: JSON.stringify({ line: "quit" }) }).then(r => r.type, e => "refused")))""",
        guard.origin,
    )
    assert tried[1] == "refused" and tried[0] in ("refused", "opaque")
    other.close()
    page.page.wait_for_timeout(500)
    assert page.stage() == "setup" and program.process.poll() is None
    page.until(lambda: not page.page.locator("body.pausing").count(), "the pause is over")
    page.page.click("[data-part=setup] [data-line=quit]")
    page.confirm()
    page.until(lambda: page.stage() == "gone", "its own page ends it")
    assert program.end() == 0
