"""The page under fingers: all of it at six sizes, and the picture moved, zoomed and read by touch."""

from __future__ import annotations

from typing import Any

import pytest

from tests.live.ui.web.browser import Page
from tests.live.ui.web.legibility import LOCALES, fits
from tests.live.ui.web.made_up import opened, show_after, show_run, show_setup

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
