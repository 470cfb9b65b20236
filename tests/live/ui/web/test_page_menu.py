"""The menu: words for the operator or codes for the expert, and in a narrow window language and theme."""

from __future__ import annotations

from typing import Any

import pytest

from live.results.maps.field_maps import FIELD_MAPS
from tests.live.ui.web.made_up import (
    STAGE,
    WHAT,
    figure,
    opened,
    run_state,
    show,
    show_after,
    show_run,
    show_setup,
)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]
PLAIN = ["Strain across the load", "Strain along the load", "Shear strain"]


def test_codes_are_words_unless_the_expert_asks(browser: Any) -> None:
    stage = STAGE | {"what": WHAT | {"along": "eyy"}, "components": [*FIELD_MAPS]}
    axial = run_state()["axial"] | {"name": "eyy"}
    with opened(browser) as page:
        show_run(page, stage, axial=axial)
        listed = page.page.locator("#component option")
        assert listed.all_text_contents()[:3] == PLAIN
        assert listed.all_text_contents()[-1] == "State of the points"
        assert page.page.text_content("#maplegend .title").startswith("Strain along the load, ")
        assert page.text("axialof").startswith("region") and "3\u202f000 / 3\u202f000 points" in page.text(
            "strip"
        )
        page.page.click("#menu")
        page.page.check("#expert")
        assert listed.all_text_contents() == [*FIELD_MAPS]
        assert page.page.text_content("#maplegend .title").startswith("eyy, ")
        assert page.text("axialof") == "eyy" and "3\u202f000 / 3\u202f000 ZOIs" in page.text("strip")
        show_setup(page)
        page.step("check")
        assert page.page.is_visible("#points"), "the sizes of the ZOIs"
        page.page.reload()
        page.page.wait_for_selector("#language")
        assert page.page.is_checked("#expert"), "kept in the browser"
        page.page.evaluate("() => localStorage.setItem('expert', '0')")
        page.page.reload()
        page.page.wait_for_selector("#language")
        show_run(page, stage | {"what": WHAT | {"along": "exx"}})
        assert listed.all_text_contents()[:2] == PLAIN[1::-1], "the load goes across the picture"
        show_setup(page)
        page.step("check")
        assert page.page.is_hidden("#points") and not page.errors


def test_in_a_narrow_window_the_menu_has_language_and_theme(browser: Any) -> None:
    with opened(browser) as page:
        show_run(page)
        page.page.set_viewport_size({"width": 390, "height": 844})
        assert page.page.is_hidden("#language") and page.page.is_hidden("#theme")
        page.page.click("#menu")
        assert page.page.is_visible("#language") and page.page.is_visible("#expert")
        for box in map(page.page.locator, ("#menu", "#more .box", "#theme", "#more .switch")):
            at = box.bounding_box()
            assert at["height"] >= 44 and at["x"] >= 0 and at["x"] + at["width"] <= 390, (
                "a finger can press it"
            )
        page.page.select_option("#language", "de")
        page.until(lambda: page.page.get_attribute("html", "lang") == "de", "German")
        theme = page.page.get_attribute("html", "data-theme")
        page.page.click("#theme")
        assert page.page.get_attribute("html", "data-theme") != theme
        page.page.keyboard.press("Escape")
        assert page.page.is_hidden("#language")
        page.page.click("#menu")
        page.page.mouse.click(30, 600)
        assert page.page.is_hidden("#language"), "it closes where anything else is pressed"


def test_the_range_of_the_load_cell_is_in_the_tile_of_the_force(browser: Any) -> None:
    limit = {"value": 1e4, "share": 0.80353, "near": False, "beyond": False, "ends": False, "range": True}
    with opened(browser) as page:
        live = run_state()["figures"]
        show_run(page, figures=live | {"force": figure(8035.3, 0.9, limit=limit)})
        assert page.page.inner_text("#forcetile .to span") == "80 % of the range, 10 000 N"
        assert page.page.get_attribute("#forcetile .fill", "width") == "80.353%"
        assert "look" not in page.page.get_attribute("#forcetile", "class")
        near = limit | {"share": 0.95, "near": True}
        show(page, "run", "showRun", run_state(figures=live | {"force": figure(9500.0, 0.9, limit=near)}))
        assert "look" in page.page.get_attribute("#forcetile", "class")
        assert page.text("alarm") == "Force: 95 % of the range"


# Whether a curve has the colour of the variable --cK, in so many pixels.
DRAWN = """([curve, k]) => { const canvas = document.querySelector(`#${curve} canvas`);
    const wanted = getComputedStyle(document.documentElement).getPropertyValue(`--c${k}`).trim();
    const [r, g, b] = [1, 3, 5].map(i => parseInt(wanted.slice(i, i + 2), 16)); let n = 0;
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    for (let i = 0; i < data.length; i += 4) n += data[i] === r && data[i + 1] === g && data[i + 2] === b;
    return n; }"""


def test_a_gauge_has_the_colour_that_is_stored_with_it(browser: Any) -> None:
    gauge = run_state()["gauges"][0] | {"colour": 4}
    with opened(browser, colours=[4]) as page:
        show_run(page, gauges=[gauge])
        assert "c5" in page.page.get_attribute("#others .key", "class").split()
        page.until(lambda: page.page.locator("#curve2 canvas").count() == 1, "the curve")
        page.until(lambda: page.page.evaluate(DRAWN, ["curve2", 5]) > 20, "ochre")
        assert page.page.evaluate(DRAWN, ["curve2", 1]) == 0, "not the colour of its place"
        show_after(page, gauges=[gauge])
        assert "c5" in page.page.get_attribute("#gaugeresults .key", "class").split()
