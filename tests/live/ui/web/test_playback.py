"""A recorded session, played back through the page: chosen from the lists, and all figures of one instant."""

from __future__ import annotations

from pathlib import Path

import pytest

from live.cli import main
from tests.live.ui.web.browser import Page
from tests.live.ui.web.conftest import CAMERA, OPTIONS, Start

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]
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
    recorded = [
        "--camera",
        CAMERA.format(seconds=12) + "&lockstep=yes",
        "--load",
        "sim:",
        "--out",
        "runs/bar",
    ]
    assert main(["run", *recorded, *OPTIONS[:-2]]) == 0
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
        assert "delay" not in {one["label"] for one in state["facts"]}, "a recording is not late"
    return len({one["points"][1] for one in states})
