"""Each figure of each stage by its value, in a browser, from made-up states."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquire.text import Message
from live.config.loading import load_config
from live.ui.web.page_controller import PageController
from live.ui.web.setup.config_draft import ConfigDraft
from tests.live.ui.web.browser import Page
from tests.live.ui.web.legibility import LOCALES, SIZES, fits, readable
from tests.live.ui.web.made_up import (
    MAP,
    STAGE,
    WHAT,
    facts,
    figure,
    number,
    opened,
    quantity,
    run_state,
    show,
    show_after,
    show_run,
    show_setup,
    tile,
)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


def unit_of_strains(page: Page, unit: str) -> None:
    page.page.evaluate("""unit => { const select = document.getElementById("strainunit");
        select.value = unit; select.dispatchEvent(new Event("change")); }""", unit)  # fmt: skip


def near(value: float, wanted: float) -> bool:
    """As shown: at least four digits of it."""
    return value == pytest.approx(wanted, rel=3e-4)


def check_tiles(page: Page) -> None:
    show_run(page)
    for unit in ("µm/m", "%"):
        unit_of_strains(page, unit)
        assert page.text("axialunit") == unit
        assert near(tile(page, "force"), 8035.3) and near(tile(page, "stress"), 267.84e6)
        assert near(tile(page, "axial"), 19.988e-2)
        sigma = page.text("axialsigma").removeprefix("± ")
        assert quantity(sigma) == pytest.approx(2e-5)
        assert near(quantity(page.page.inner_text("#others b").split(" ±")[0] + f" {unit}"), -7.703e-2)
    assert near(quantity(page.text("forceof").removeprefix("highest ")), 8044.7)
    assert "30.00 mm²" in page.text("stressof")
    assert page.text("elongation") == "6.33 ± 0.02" and page.text("strainrate") == "(3.1 ± 0.2)·10⁻³"


def check_machine(page: Page) -> None:
    show_run(page)
    small = {
        text.split(" ", 1)[1]: text.split(" ", 1)[0]
        for text in page.page.locator("#strip > span").all_inner_texts()
        if not text.startswith(("44", "16"))
    }
    assert small["lost"] == "5", "what was not recorded is lost too"
    assert (small["frames/s"], small["recorded"]) == ("10", "876")
    assert "matters" in page.page.get_attribute("#strip > span:has-text('lost')", "class")
    assert page.page.locator("#strip .matters").count() == 1, "quiet until it counts"
    shown = page.page.inner_text("#strip")
    assert "44 ms" in shown and "16 h" in shown and "cycle" not in shown
    show_run(page, facts=facts(cycle=1234.0))
    assert page.page.inner_text("#strip > span:has-text('cycle')") == "1\u202f234 cycle"


def read_out(page: Page, curve: str) -> list[str]:
    """What is read at the last point of a curve."""
    page.until(lambda: page.page.locator(f"#{curve} canvas").count() == 1, "the curve")
    page.page.focus(f"#{curve}")
    page.page.keyboard.press("ArrowRight")
    at = page.page.locator(f"figure:has(#{curve}) .at")
    page.until(lambda: bool(at.inner_text()), "it is read out")
    return str(at.inner_text()).rsplit(": ", 1)[1].split(" · ")


def check_curves(page: Page) -> None:
    for unit, factor in (("µm/m", 1e-6), ("%", 1e-2)):
        show_run(page)
        unit_of_strains(page, unit)
        strain, stress = read_out(page, "curve1")
        assert near(number(strain) * factor, 19.988e-2) and near(quantity(stress), 267.84e6)
        seconds, gauge = read_out(page, "curve2")
        assert near(number(seconds), 2.0) and near(quantity(gauge), 19.994e-2)
    assert "%" in page.page.inner_text("figure:has(#curve1) .axis")


def marks(page: Page, legend: str) -> list[float]:
    """The marks of a colour bar from low to high; those beside an upright bar say the same."""
    beside = page.page.locator(f"#{legend} .marks.up span").all_text_contents()
    along = page.page.locator(f"#{legend} .marks:not(.up) span").all_text_contents()
    assert along == beside[::-1]
    return [number(text) for text in along]


def check_maps(page: Page) -> None:
    show_run(page)
    for legend in ("maplegend", "peaklegend"):
        if legend == "peaklegend":
            show_after(page)
        for unit, factor in (("%", 1e-2), ("µm/m", 1e-6)):
            unit_of_strains(page, unit)
            assert page.page.locator(f"#{legend} .title").text_content().endswith(unit)
            low, middle, high = (mark * factor for mark in marks(page, legend))
            assert near(low, 0.185) and near(middle, 0.2) and near(high, 0.215)
            bars = page.page.locator(f"#{legend} .histogram:not(.up) rect")
            assert [float(bars.nth(k).get_attribute("height")) for k in (0, 23)] == [0, 10]


def check_maps_of_the_whole_test(page: Page) -> None:
    names = ["compliance", "leaves_at_stress"]
    slope, leaves = (
        MAP | {"picture": f"/picture?after=1&layer={name}", "s": 85.0, "of": name, "strain": False, **more}
        for name, more in zip(
            names,
            ({"unit": "µm/m/MPa", "low": 13.9, "high": 14.7}, {"unit": "MPa", "low": 110.0, "high": 140.0}),
            strict=True,
        )
    )
    stage = STAGE | {"components": ["eyy", *names]}
    show_run(page, stage, picture=slope | {"of": "compliance"})
    assert page.page.locator("#component option").count() == 3
    assert page.page.input_value("#component") == "compliance"
    page.page.route(
        "**/value?*", lambda route: route.fulfill(json={"value": 14.2, "sigma": 0.25, "status": ""})
    )
    page.page.hover("#gaugemap")
    page.until(lambda: "µm/m/MPa" in page.text("readout"), "the value")
    assert "14.2 ± 0.3 µm/m/MPa" in page.text("readout"), "with its sigma"
    show_after(
        page,
        last=MAP | {"picture": "/picture?after=1", "s": 88.0},
        whole=names,
        compliance=slope,
        leaves_at_stress=leaves,
    )
    listed = page.page.locator("#peaktime select")
    assert listed.locator("option").count() == 4
    for name, title, ends in (
        ("compliance", "Strain over stress, µm/m/MPa", (13.9, 14.7)),
        ("leaves_at_stress", "Line ends at this stress, MPa", (110.0, 140.0)),
    ):
        listed.select_option(name)
        assert page.page.text_content("#peaklegend .title") == title
        low, _, high = marks(page, "peaklegend")
        assert near(low, ends[0]) and near(high, ends[1])
        assert page.page.get_attribute("#peakmap", "src").endswith(f"layer={name}")
        assert page.text("peakwords") == title.split(", ")[0], "of no instant"
    listed.select_option("peak")
    assert "01:25" in page.text("peakwords")
    unit_of_strains(page, "%")
    assert near(marks(page, "peaklegend")[0], 18.5)


def check_setup(page: Page) -> None:
    show_setup(page)
    assert near(number(page.text("setupforce")), -12.3) and quantity(page.text("forcenoise")[2:]) == 0.5
    assert near(number(page.text("sharpness")), 0.36) and page.text("sharpof").startswith("90 %")
    assert page.text("saturated") == "1.23 %"
    assert near(number(page.text("sigma")) * 1e-6, 75e-6) and page.text("sigmaunit") == "µm/m"
    assert "30.00 mm²" in page.text("section") and "20 × 1.5 mm" in page.text("specimensum")
    scale = re.search(r"([\d.]+) px/mm ± ([\d.]+) %", page.text("scale"))
    assert scale and near(float(scale[1]), 24.0)
    assert float(scale[2]) == pytest.approx(100 * 2e-5 * 24.0, abs=0.006), "of mm/px, as a share"
    cells = page.page.locator("#table td").all_text_contents()
    assert near(number(cells[1]), 80 / 24) or cells[1] == "3.33", "VSG in mm: px over px/mm"
    assert [number(cell) for cell in cells[2:]] == [150, 75]
    show_setup(page, scale={"px_per_mm": None, "sigma": None})
    assert page.page.locator("#table td").all_text_contents()[1] == "80", "VSG in px"


def check_after(page: Page) -> None:
    show_after(page)
    tiles = page.page.locator("#tiles .tile")
    values = [tiles.nth(k).locator(".value").inner_text().split("\n") for k in range(2)]
    assert [[one.strip() for one in value if one.strip()] for value in values] == [
        ["69.905", "GPa"],
        ["268.16", "MPa"],
    ]
    assert "0.057" in tiles.nth(0).inner_text() and "18.90 %" in page.text("results")
    unit_of_strains(page, "%")
    assert near(quantity(str(page.page.text_content("#gaugeresults b")).split(" ±")[0] + " %"), -7.703e-2)
    assert page.text("believed") == "E, Rm can be believed." and "01:25" in page.text("peakwords")
    strain, stress = read_out(page, "curve3")
    assert near(number(strain) * 1e-2, 19.988e-2) and near(quantity(stress), 267.84e6)


CHECKS = [
    check_tiles, check_machine, check_curves, check_maps, check_maps_of_the_whole_test, check_setup, check_after,
]  # fmt: skip


@pytest.mark.parametrize("check", CHECKS)
def test_figures_by_value(browser: Any, check: Callable[[Page], None]) -> None:
    with opened(browser) as page:
        check(page)
        assert not page.errors


def test_a_figure_that_is_not_live_is_not_shown_as_one(browser: Any) -> None:
    with opened(browser) as page:
        old = figure(None, state="old", last=7796.9, age_s=24.0)
        stress = figure(None, state="unknown", last=None, age_s=None, why="")
        figures = run_state()["figures"] | {"force": old, "stress": stress}
        show_run(page, figures=figures, troubles=["load cell: no force for 24 s"])
        assert "stale" in page.page.get_attribute("#forcetile", "class")
        assert near(tile(page, "force"), 7796.9) and page.text("forcesigma") == "last value at 01:04"
        assert page.page.inner_text("#forcetile .age") == "24 s old" and page.text("stress") == "–"
        assert page.text("word") == "Load cell silent" and page.page.is_visible("#silence")
        assert "alarm" in page.page.get_attribute("#state", "class")
        assert "stale" not in page.page.get_attribute("#axialtile", "class"), "the strain is live"
        figures = run_state()["figures"] | {"force": figure(None, state="overload", last=9.0, age_s=0.0)}
        show_run(page, figures=figures)
        assert page.text("force") == "OVERLOAD" and "bad" in page.page.get_attribute("#forcetile", "class")
        show_run(page)
        # At once: the page itself knows that there is a link.
        lost = """async () => { const { linkLost } = await import("/static/run.js"); linkLost(6);
            const found = [...document.querySelectorAll(".figures .age")].map(one => one.innerText);
            const force = document.getElementById("force").textContent; linkLost(0);
            return [found, force, document.querySelectorAll(".figures .tile.stale").length]; }"""
        ages, force, stale = page.page.evaluate(lost)
        assert ages == ["6 s old"] * 3 and near(number(force), 8035.3) and stale == 0, (
            "without a link all are old"
        )


def test_a_limit_is_in_tile_bar_and_curve(browser: Any) -> None:
    limit = {"value": 0.22, "share": 0.9085, "near": True, "beyond": False, "ends": True}
    with opened(browser) as page:
        figures = run_state()["figures"] | {"axial": figure(19.988e-2, 2e-5, limit=limit)}
        show_run(page, figures=figures)
        unit_of_strains(page, "%")
        assert page.page.inner_text("#axialtile .to span") == "91 % of the limit, 22 %"
        assert page.page.get_attribute("#axialtile .fill", "width") == "90.85%"
        assert "look" in page.page.get_attribute("#axialtile", "class") and "near" in page.page.get_attribute(
            "#state", "class"
        )
        assert "91 % of the limit" in page.text("alarm") and "ends by itself" in page.text("alarmmore")
        figures["axial"]["limit"] = limit | {"share": 1.02, "near": False, "beyond": True}
        show(page, "run", "showRun", run_state(figures=figures))
        assert "bad" in page.page.get_attribute("#axialtile", "class")
        drawn = "async () => { const c = document.querySelector('#curve1 canvas'); return c?.toDataURL().length; }"
        page.until(lambda: page.page.locator("#curve1 canvas").count() == 1, "the curve")
        page.page.wait_for_timeout(100)
        with_limit = page.page.evaluate(drawn)
        show_run(page)
        page.until(lambda: page.page.evaluate(drawn) != with_limit, "the limit is in the curve")


def test_the_specimen_before_and_the_one_in_hand(browser: Any) -> None:
    before = {"specimen": "bar-5", "stress": True, "strain": [0.0, 0.1, 0.2], "load": [0.0, 2e8, 2.6e8]}
    with opened(browser) as page:
        show_run(page, STAGE | {"before": before})
        page.until(lambda: "bar-5, the one before" in page.text("whose"), "its curve has a name")
        show_run(page, STAGE | {"before": before | {"stress": False}})
        page.until(lambda: page.text("whose") == "", "forces are not drawn behind stresses")
        show_setup(page, specimen=WHAT | {"axis": "auto", "gauge_length_mm": None, "area_mm2": None})
        assert "no section" in page.text("section")


def test_the_map_lies_over_its_points(browser: Any) -> None:
    box = """id => { const q = document.getElementById(id).getBoundingClientRect();
        return [q.x, q.y, q.width, q.height]; }"""
    with opened(browser) as page:

        def placed() -> bool:
            """Shown again and again, as states come: none is loaded while the picture before is under way."""
            show_run(page, picture=MAP | {"cells": [32, 48, 128, 96]})
            x, y, width, height = page.page.evaluate(box, "gaugemap")
            wanted = [x + width / 8, y + height / 4, width / 2, height / 2]
            return bool(page.page.evaluate(box, "map") == pytest.approx(wanted, abs=0.5))

        page.until(placed, "where the server says")


def test_the_opacity_of_the_map_stays_with_the_browser(browser: Any) -> None:
    with opened(browser) as page:
        show_run(page)
        opacity = "() => getComputedStyle(document.getElementById('map')).opacity"
        assert page.page.evaluate(opacity) == "0.74"
        page.page.fill("#opacity", "0")
        assert page.page.evaluate(opacity) == "0" and page.page.evaluate("() => localStorage.opacity") == "0"
        page.page.reload()
        page.page.wait_for_selector("#language")
        page.until(lambda: page.page.evaluate(opacity) == "0", "kept")


def test_three_cameras_in_a_test(browser: Any) -> None:
    """A card of each, the map of the chosen one, and the figures of the first that goes on."""
    names = ["first", "second", "third"]
    sides = {"strains": [], "figures": [{"side": "third", "name": "E", "text": "70.0 GPa"}], "cameras": [
        {"side": side, "failed": False, "valid": 900 + k, "zois": 1000, "skipped": 4, "lost": k}
        for k, side in enumerate(names)]}  # fmt: skip

    def measured(k: int, **more: Any) -> dict[str, Any]:
        axial = figure((k + 1) * 1e-3, 2e-6)
        figures = {"force": figure(8035.3, 0.9), "stress": figure(267.84e6, 3e4), "axial": axial}
        axial = {"name": "eyy", "value": (k + 1) * 1e-3, "sigma": 2e-6, "assumed": ""}
        return run_state(side=names[k], figures=figures, axial=axial, valid=900 + k, zois=1000, **more)

    with opened(browser) as page:
        unit_of_strains(page, "µm/m")
        show(page, "run", "beginRun", STAGE | {"cameras": names})
        for k in (2, 0, 1):
            more = {"picture": MAP | {"low": 0.1 * (k + 1), "high": 0.1 * (k + 2), "n": 5 + k}}
            show(page, "run", "showRun", measured(k, sides=sides if k == 0 else None, **more))
        cards = page.page.locator("#runviews [data-view]")
        found = [text.partition("±")[0].split("\n") for text in cards.all_inner_texts()]
        assert [name for name, _ in found] == names
        assert [number(value) for _, value in found] == [1000, 2000, 3000]
        assert page.page.locator("#runviews [aria-pressed=true]").get_attribute("data-view") == "first"
        assert tile(page, "axial") == pytest.approx(1e-3) and "first" in page.text("axialof")
        unit_of_strains(page, "%")
        assert marks(page, "maplegend")[0] == pytest.approx(10.0)
        page.page.click("#runviews [data-view=third]")
        assert marks(page, "maplegend")[0] == pytest.approx(30.0)
        assert "side=third" in page.page.get_attribute("#map", "src")
        rows = page.page.locator("#sides li").all_text_contents()
        assert [number(row.split("lost")[1]) for row in rows[:3]] == [0, 1, 2] and "E, third70.0 GPa" in rows
        show(page, "run", "showRun", measured(0, sides=sides) | {"state": "ended"})
        show(page, "run", "showRun", measured(2))
        assert "first" in page.text("axialof"), "the second has not said yet that it goes on"
        show(page, "run", "showRun", measured(1))
        assert tile(page, "axial") == pytest.approx(2e-3) and "second" in page.text("axialof")
        show(page, "run", "showRun", measured(1) | {"state": "ended"})
        show(page, "run", "showRun", measured(2))
        assert tile(page, "axial") == pytest.approx(3e-3) and "third" in page.text("axialof")
        show(page, "run", "beginRun", STAGE | {"cameras": ["front", "back"]})
        show(page, "run", "showRun", measured(2))
        assert cards.count() == 0, "a camera of the test before"


def test_two_cameras_after_a_test(browser: Any) -> None:
    peak = MAP | {"picture": "/picture?side=back&after=1", "low": 0.1, "s": 85.0}
    sides = [
        {"side": side, "atpeak": "at the highest force", "peak": one}
        for side, one in (("front", MAP), ("back", peak))
    ]
    with opened(browser) as page:
        show_after(page, cameras=sides)
        unit_of_strains(page, "%")
        assert marks(page, "peaklegend")[0] == pytest.approx(18.5)
        page.page.click("#peakside button:nth-child(2)")
        assert marks(page, "peaklegend")[0] == pytest.approx(10.0)
        assert "side=back" in page.page.get_attribute("#peakmap", "src")


def test_without_a_camera_the_list_of_devices_is_there(browser: Any, tmp_path: Path) -> None:
    draft = ConfigDraft(load_config(None, {}), tmp_path / "rig.toml", {})
    with PageController(draft, port=0) as controller:
        thread = threading.Thread(target=controller.set_up, daemon=True)
        thread.start()
        page = Page(browser.new_context(viewport={"width": 1280, "height": 800}, locale="en-US").new_page())
        page.goto(controller.address)
        page.until(lambda: page.page.is_visible("#cameras"), "the step of the camera is open")
        listed = page.page.locator("#cameras option[value='sim:hole']")
        page.until(lambda: listed.count() == 1, "what there is")
        assert page.page.is_visible("#nocamera") and "no camera is chosen" in page.text("trouble")
        page.page.click("#step-specimen > summary")
        page.page.fill('[data-set="specimen.width_mm"]', "20,5")
        page.page.press('[data-set="specimen.width_mm"]', "Tab")
        page.until(lambda: draft.config.specimen.width_mm == 20.5, "the rest can be set up")
        assert not page.errors
        controller.quit()
        thread.join()
        page.page.context.close()


def test_what_fails_stays_to_be_seen(browser: Any) -> None:
    """A check that says NO-GO, and a camera with a fault: their steps, and a verdict with what to do."""
    line = {"what": "load cell", "value": "silent", "good": False, "advice": "look at its cable",
            "measured": True}  # fmt: skip
    with opened(browser) as page:
        for step in ("gauges", "check", "camera"):
            show_setup(page, go=False, lines=[line], trouble="no picture for 3 s")
            page.page.click(f"#step-{step} > summary")
            steps = page.page.locator(".step > summary:visible")
            assert steps.count() == 4 and page.text("verdict") == "NO-GO"
        assert page.text("reason") == "load cell: silent" and "doubtful" in page.page.get_attribute(
            "#start", "class"
        )
        page.page.click("#step-check > summary")
        assert page.page.inner_text("#verdicts .verdict.bad p") == "Load cell: silent. Look at its cable"
        assert page.page.inner_text("#step-camera .chip") == "look"


def test_whatever_the_figures_become_they_stay_in_their_places(browser: Any) -> None:
    live = run_state()["figures"]
    old = figure(None, state="old", last=7796.9, age_s=24.0)
    changes: list[dict[str, Any]] = [
        {"figures": live | {"force": old}, "troubles": ["load cell: no force for 24 s"]},
        {"figures": live | {"force": figure(None, state="overload", last=9.0, age_s=0.0)}},
        {"figures": live | {"force": figure(0.4), "axial": figure(-1.2345e-3, sigma=1e-7)}},
        {"state": "reference", "figures": {}, "gauges": []},
        {"part": "of 83 % of the area", "strain_rate": None, "elongation": None, "facts": facts(1.2)},
    ]
    with opened(browser) as page:
        show_run(page)
        boxes = "() => [...document.querySelectorAll('.figures > :not([hidden])')].map(one => one.offsetTop)"
        usual = page.page.evaluate(boxes)
        assert len(usual) == 5
        for change in changes:
            show_run(page, **change)
            assert page.page.evaluate(boxes) == usual


INSIDE = """() => { const bar = document.getElementById("strip").getBoundingClientRect();
    return [...document.querySelectorAll("#strip .matters")].map(one => one.getBoundingClientRect())
        .map(one => one.top >= bar.top - 1 && one.bottom <= bar.bottom + 1 && one.right <= bar.right + 1); }"""


def test_the_buttons_of_a_run_stay_while_its_files_are_closed(browser: Any) -> None:
    """A test that was recorded and one that was not: neither can be recorded then, and nothing moves."""
    places = """() => [...document.querySelectorAll("[data-part=run] .toolbar button")].map(one => {
        const { x, y, width } = one.getBoundingClientRect(); return [x, y, width]; })"""
    with opened(browser) as page:
        for recording, line in ((True, "stop"), (False, "start")):
            show_run(page, recording=recording)
            button = page.page.locator(f"[data-part=run] [data-line={line}]")
            before = page.page.evaluate(places)
            assert button.is_enabled()
            show(page, "run", "showRun", run_state(state="ended", recording=False))
            assert page.page.evaluate(places) == before
            assert button.is_visible() and button.is_disabled()


@pytest.mark.parametrize("locale", LOCALES)
def test_a_fault_can_be_read_at_every_size(browser: Any, locale: str) -> None:
    names = ("extension", "width", "area")
    why = [Message("no value of {name} for {age:.0f} s", name, 24.4).to_json() for name in names]
    live = run_state()
    old = figure(None, state="old", last=1e-3, age_s=24.4)
    small = facts(1.2, skipped=76, without_force=5)
    with opened(browser, locale=locale) as page:
        page.until(lambda: page.page.get_attribute("html", "lang") == locale[:2], "its language")
        for troubles in (why[:1], why):
            fault = live["figures"] | {"axial": old}
            show_run(page, figures=fault, troubles=troubles, facts=small)
            fits(page, "a fault")
            readable(page, "a fault")
            for width, height in SIZES:
                page.page.set_viewport_size({"width": width, "height": height})
                assert page.page.evaluate(INSIDE) == [True] * 4, (
                    f"{width}: lost, skipped, delay, without a force"
                )
            assert page.page.get_attribute("#state .message", "title").count("24 s") == len(troubles), "whole"
