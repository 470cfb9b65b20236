"""The page under fingers, at six sizes; and its menu: words or codes, and in a narrow window language and theme."""

from __future__ import annotations

from typing import Any

import pytest

from live.results.maps.painting import FIELD_MAPS
from tests.live.ui.web.browser import Page
from tests.live.ui.web.legibility import LOCALES, fits
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
Points = list[tuple[float, float]]
# Scale of a picture, and how far it is moved, in px of the screen.
MOVED = """id => { const m = new DOMMatrix(getComputedStyle(document.getElementById(id).closest(".zoomed")).transform);
    return [m.a, m.e, m.f]; }"""
CAMERA = {"name": "a camera", "width": 256, "height": 192, "bits": 8, "fps": 15.0, "sliders": []}
SHOWS = {"set-up": show_setup, "run": show_run, "after": show_after}


class Fingers:
    """Fingers on the screen of a page."""

    def __init__(self, page: Page) -> None:
        self._session = page.page.context.new_cdp_session(page.page)

    def move(self, *ways: Points) -> None:
        """One finger for each way, all at once."""
        for k, kind in enumerate(["touchStart", *["touchMove"] * (len(ways[0]) - 1)]):
            points = [{"x": way[k][0], "y": way[k][1], "id": i} for i, way in enumerate(ways)]
            self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        self._session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def middle(page: Page, id_: str) -> tuple[float, float]:
    box = page.page.locator(f"#{id_}").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.mark.parametrize("locale", LOCALES)
def test_all_can_be_seen_and_pressed_with_a_finger(browser: Any, locale: str) -> None:
    with opened(browser, locale=locale, has_touch=True) as page:
        page.until(lambda: page.page.get_attribute("html", "lang") == locale[:2], "its language")
        for stage, show in SHOWS.items():
            show(page)
            fits(page, f"{stage} by touch")


@pytest.mark.parametrize(("show", "id_"), [(show_run, "gaugemap"), (show_setup, "drawing")])
def test_two_fingers_zoom_and_one_moves(browser: Any, show: Any, id_: str) -> None:
    with opened(browser, has_touch=True) as page:
        show(page, **({"camera": CAMERA} if show is show_setup else {}))
        fingers, (x, y) = Fingers(page), middle(page, id_)
        spread = [(x - 20 * k, y) for k in (1, 2, 3, 4)], [(x + 20 * k, y) for k in (1, 2, 3, 4)]
        fingers.move(*spread)
        scale, right, down = page.page.evaluate(MOVED, id_)
        assert scale == pytest.approx(4.0, rel=0.02), "as far as the fingers are apart"
        fingers.move([(x, y), (x + 15, y + 5), (x + 30, y + 10)])
        assert page.page.evaluate(MOVED, id_) == pytest.approx([scale, right + 30, down + 10], abs=1)
        fingers.move(*([*way][::-1] for way in spread))
        assert page.page.evaluate(MOVED, id_) == pytest.approx([1.0, 0.0, 0.0], abs=0.05)
        assert not page.errors and not [one for one in page.posted if one.get("do") in ("draw", "gauge")]


def test_a_finger_on_a_picture_that_is_not_zoomed_scrolls_the_page(browser: Any) -> None:
    with opened(browser, has_touch=True, viewport={"width": 390, "height": 844}) as page:
        show_run(page)
        page.page.locator("#gaugemap").scroll_into_view_if_needed()
        x, y = middle(page, "gaugemap")
        before = page.page.evaluate("scrollY")
        Fingers(page).move([(x, y - 30 * k) for k in range(8)])
        page.until(lambda: page.page.evaluate("scrollY") > before + 50, "it has scrolled")
        assert page.page.evaluate(MOVED, "gaugemap") == [1, 0, 0]


def test_a_tap_reads_the_map(browser: Any) -> None:
    value = {"value": 0.2, "sigma": 1e-4, "status": "valid"}

    def answer(page: Any) -> None:
        page.route("**/value?*", lambda route: route.fulfill(json=value))

    with opened(browser, answer, has_touch=True) as page:
        show_run(page)
        Fingers(page).move([middle(page, "gaugemap")])
        page.until(lambda: "200" in page.text("readout"), "it is read, and stays")
        assert page.text("readout").startswith("x 1") and "µm/m" in page.text("readout")


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
        page.until(lambda: listed.all_text_contents()[:2] == PLAIN[1::-1], "the load goes across the picture")
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
