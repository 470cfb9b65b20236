"""What a movement of the pointer changes during set-up, and what it does not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.live.ui.web.made_page import MadePage

pytestmark = pytest.mark.slow
TOUCH = """([kind, id, x, y]) => { const svg = document.getElementById("drawing"), m = svg.getScreenCTM();
    const p = new DOMPoint(x, y).matrixTransform(m), at = { clientX: p.x, clientY: p.y };
    const target = kind === "pointerdown" ? document.elementFromPoint(p.x, p.y) : svg;
    target.dispatchEvent(new PointerEvent(kind, { bubbles: true, cancelable: true, pointerId: id, button: 0,
      pointerType: "touch", isPrimary: id === 1, ...at })); }"""
ZOOM = "() => Number(/scale\\(([\\d.]+)\\)/.exec(document.querySelector('#setup .zoomed').style.transform)?.[1] ?? 1)"
NO_CAPTURE = "() => { document.getElementById('drawing').setPointerCapture = () => {}; }"


@pytest.fixture
def page(browser: Any) -> Iterator[MadePage]:
    made = MadePage(browser)
    made.set_up()
    yield made
    assert not made.errors
    made.page.context.close()


def on_screen(page: MadePage, px: float) -> float:
    """So many px of the screen, in px of the picture."""
    return px / float(page.page.evaluate("() => document.getElementById('drawing').getScreenCTM().a"))


def strokes(page: MadePage) -> list[dict[str, Any]]:
    return [one["strokes"][0] for one in page.sent()]


def test_the_tool_at_first_is_move_and_it_draws_nothing(page: MadePage) -> None:
    assert page.page.get_attribute("[data-tool=move]", "aria-pressed") == "true"
    page.drag((300, 200), (500, 400))
    page.click((400, 300))
    assert page.sent() == []
    page.page.keyboard.press("1")
    page.set_up(picture=2)
    page.drag((300, 200), (500, 400))
    assert [one["tool"] for one in strokes(page)] == ["rectangle"]
    page.emit("stage", {"stage": "setup", "n": 2, "words": "", "alone": False, "components": [], "kinds": []})
    assert page.page.get_attribute("[data-tool=move]", "aria-pressed") == "true", "for each specimen"


@pytest.mark.parametrize("tool", ["rectangle", "brush", "eraser", "line", "area"])
def test_a_click_and_a_short_stroke_change_nothing(page: MadePage, tool: str) -> None:
    page.page.click(f"[data-tool={tool}]")
    page.click((400, 300))
    for px, count in ((3, 0), (8 if tool == "rectangle" else 11, 0), (14, 1)):
        far, down = on_screen(page, px), on_screen(page, px if tool == "rectangle" else 0)
        page.drag((400, 300), (400 + far, 300 + down))
        assert len(page.sent()) == count, px
        assert (page.text("hint") == "Too short a stroke: nothing has changed.") == (px < 12)
    assert not page.page.locator("#drawing .sketch *").count()


def test_a_region_has_a_width_and_a_height(page: MadePage) -> None:
    page.page.keyboard.press("1")
    page.drag((300, 200), (500, 200 + on_screen(page, 8)))
    assert page.sent() == []


def test_a_handle_is_moved_by_a_stroke_that_is_long_enough(page: MadePage) -> None:
    page.drag((200, 100), (200 + on_screen(page, 4), 100))
    assert page.sent() == []
    page.drag((200, 100), (200 + on_screen(page, 30), 100))
    (sent,) = page.sent()
    assert sent["name"] == "axial" and sent["points"][1] == [200, 300]
    assert sent["points"][0] == pytest.approx([200 + on_screen(page, 30), 100], abs=1)
    page.set_up(picture=2)
    near = on_screen(page, 17)  # a finger has 44 px
    page.drag((200 + near, 300), (260, 340))
    (sent,) = page.sent()
    assert sent["points"][1] == pytest.approx([260, 340], abs=1)


def test_a_second_pointer_cancels(page: MadePage) -> None:
    page.page.evaluate(NO_CAPTURE)
    page.page.keyboard.press("1")

    def touch(kind: str, pointer: int, x: float, y: float) -> None:
        page.page.evaluate(TOUCH, [kind, pointer, x, y])

    touch("pointerdown", 1, 300, 200)
    touch("pointermove", 1, 400, 300)
    touch("pointerdown", 2, 500, 400)
    touch("pointermove", 1, 320, 220)
    touch("pointermove", 2, 560, 460)
    touch("pointerup", 1, 320, 220)
    touch("pointerup", 2, 560, 460)
    assert page.sent() == [] and not page.page.locator("#drawing .sketch *").count()
    touch("pointerdown", 1, 300, 200)
    touch("pointermove", 1, 400, 300)
    touch("pointercancel", 1, 400, 300)
    assert page.sent() == []
    page.page.click("[data-tool=zoi]")
    for pointer, x in ((1, 300), (2, 500)):
        touch("pointerdown", pointer, x, 300)
    for pointer, x in ((2, 500), (1, 300)):
        touch("pointerup", pointer, x, 300)
    assert page.sent() == [], "a pinch places no point"
    touch("pointerdown", 1, 300, 200)
    touch("pointerup", 1, 300, 200)
    (sent,) = page.sent()
    assert sent["points"] == [pytest.approx([300, 200], abs=0.5)]


def test_undo_and_redo_by_buttons_and_keys(page: MadePage) -> None:
    undo, redo = page.page.locator("[data-do=undo]"), page.page.locator("[data-do=redo]")
    assert undo.is_enabled() and redo.is_disabled()
    page.page.keyboard.press("y")
    assert page.sent() == []
    page.page.keyboard.press("z")
    page.set_up(can=["redo"])
    assert undo.is_disabled() and redo.is_enabled()
    page.page.keyboard.press("y")
    redo.click()
    for keys in ("Control+z", "Control+Shift+Z", "Control+y"):
        page.page.keyboard.press(keys)
    assert [one["do"] for one in page.sent()] == ["undo", "redo", "redo", "undo", "redo", "redo"]
    page.step("specimen")
    page.page.focus('[data-set="metadata.material"]')
    page.page.keyboard.type("zyz")
    page.page.keyboard.press("Control+z")
    assert page.sent() == [], "typed"


def test_the_length_of_a_scale_is_typed_and_picks_no_tools(page: MadePage) -> None:
    page.page.keyboard.press("0")
    page.click((100, 200), (300, 200))
    page.page.keyboard.type("12,5")
    assert page.page.get_attribute("[data-tool=scale]", "aria-pressed") == "true"
    page.page.keyboard.press("Enter")
    (sent,) = page.sent()
    assert sent["do"] == "scale" and sent["mm"] == 12.5
    assert sent["points"] == [pytest.approx([100, 200], abs=0.6), pytest.approx([300, 200], abs=0.6)]
    page.until(lambda: not page.page.locator("#scale form").count(), "the form is over")
    for leave in (
        lambda: page.page.keyboard.press("Escape"),
        lambda: page.page.click("#scale button:has-text('Cancel')"),
    ):
        page.click((100, 200), (300, 200))
        assert page.page.locator("#scale form").count() and page.page.locator("#drawing .drawn").count()
        leave()
        assert not page.page.locator("#scale form, #drawing .drawn").count() and page.sent() == []
    page.click((100, 200), (100 + on_screen(page, 5), 200))
    assert not page.page.locator("#scale form").count()


def test_escape_leaves_a_field_as_it_was(page: MadePage) -> None:
    page.page.fill("#gauges input", "another")
    page.page.press("#gauges input", "Escape")
    page.step("specimen")
    page.page.fill('[data-set="metadata.specimen"]', "bar-9")
    page.page.press('[data-set="metadata.specimen"]', "Escape")
    assert page.page.input_value("#gauges input") == "axial"
    assert page.page.input_value('[data-set="metadata.specimen"]') == "bar-6" and page.sent() == []


def test_a_gauge_has_the_colour_that_is_stored_with_it(page: MadePage) -> None:
    line = page.page.locator("#drawing polyline.gauge")
    third = line.get_attribute("stroke")
    key = page.page.evaluate("() => document.querySelector('#gauges .key').style.background")
    page.set_up(
        gauges={"renamed": {"kind": "zoi", "colour": 2, "handles": [[9, 9]], "outline": [[[9, 9], [20, 20]]]}}
    )
    assert page.page.locator("#drawing polyline.gauge").get_attribute("stroke") == third
    assert page.page.evaluate("() => document.querySelector('#gauges .key').style.background") == key
    page.set_up(
        gauges={"renamed": {"kind": "zoi", "colour": 1, "handles": [[9, 9]], "outline": [[[9, 9], [20, 20]]]}}
    )
    assert page.page.locator("#drawing polyline.gauge").get_attribute("stroke") != third


def test_a_wheel_zooms_by_its_size_and_not_sideways(page: MadePage) -> None:
    page.page.mouse.move(*page.on_screen([(320, 240)])[0])
    zooms = []
    for across, down in ((0, -100), (0, -4), (60, -10), (60, 0), (0, -900), (0, 100)):
        page.page.mouse.wheel(across, down)
        page.page.wait_for_timeout(60)
        zooms.append(page.page.evaluate(ZOOM))
    assert zooms[0] == pytest.approx(1.25)
    assert zooms[1] == pytest.approx(1.25 * 1.25**0.04, rel=1e-3), "a trackpad moves by a few px"
    assert zooms[2] == zooms[3] == zooms[1], "sideways"
    assert zooms[4] == pytest.approx(1.25 * zooms[1], rel=1e-3) and zooms[5] == pytest.approx(
        zooms[1], rel=1e-3
    )


def test_a_hand_over_the_keys_does_not_pause(page: MadePage) -> None:
    page.emit(
        "stage", {"stage": "run", "n": 2, "words": "", "alone": False, "components": ["exx"], "kinds": []}
    )
    page.page.wait_for_timeout(1200)
    for key in "opP[":
        page.page.keyboard.press(key)
    assert not [one for one in page.sent() if one.get("line") == "pause"]
