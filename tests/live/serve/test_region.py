"""What is drawn with the mouse becomes exactly those pixels."""

from __future__ import annotations

import numpy as np
import pytest

from acquire.errors import ConfigError
from live.serve.region import Drawn

SHAPE = (60, 80)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)


def drawn(*strokes: dict[str, object], start: bool = False) -> Drawn:
    found = Drawn(np.full(SHAPE, start), "as given")
    found.draw(strokes)
    return found


def test_a_rectangle_from_any_corner() -> None:
    for points in ([[10.4, 20.2], [30.6, 40.0]], [[30.6, 20.2], [10.4, 40.0]]):
        found = drawn({"tool": "rectangle", "points": points})
        assert np.array_equal(found.mask, (X >= 10.4) & (X <= 30.6) & (Y >= 20.2) & (Y <= 40.0))
        assert found.box == (11, 21, 20, 20) and found.is_box and found.words == "as drawn"


def test_a_rectangle_is_the_region_alone_unless_it_is_added() -> None:
    first = {"tool": "rectangle", "points": [[0, 0], [9, 9]]}
    other = {"tool": "rectangle", "points": [[20, 20], [29, 29]]}
    assert drawn(first, other).box == (20, 20, 10, 10)
    both = drawn(first, other | {"add": True})
    assert both.box == (0, 0, 30, 30) and not both.is_box and both.mask.sum() == 200


def test_a_polygon() -> None:
    found = drawn({"tool": "polygon", "points": [[10, 10], [50, 10], [10, 50]]})
    inside = (X > 10) & (Y > 10) & (X + Y < 60)
    edge = (np.abs(X - 10) < 1) | (np.abs(Y - 10) < 1) | (np.abs(X + Y - 60) < 1)
    assert np.array_equal(found.mask[~edge], inside[~edge])


def test_brush_and_eraser() -> None:
    way = {"points": [[20, 30], [60, 30]], "radius": 5}
    painted = drawn({"tool": "brush", **way})
    near = np.hypot(X - np.clip(X, 20, 60), Y - 30) <= 5
    assert np.array_equal(painted.mask, near)
    assert np.array_equal(drawn({"tool": "eraser", **way}, start=True).mask, ~near)


def test_outside_the_picture_nothing_is_drawn() -> None:
    found = drawn({"tool": "rectangle", "points": [[-100, -100], [-50, -50]]})
    assert found.box is None and not found.is_box
    assert drawn({"tool": "brush", "points": [[-3, 10]], "radius": 5}).box == (0, 6, 3, 9)


def test_undo_goes_back_to_what_was_given() -> None:
    found = drawn({"tool": "rectangle", "points": [[0, 0], [9, 9]]}, start=True)
    found.undo()
    found.undo()
    assert found.mask.all() and found.words == "as given"


@pytest.mark.parametrize(
    "stroke",
    [
        {},
        {"tool": "axe", "points": [[1, 1], [2, 2]]},
        {"tool": "rectangle", "points": [[1, 1]]},
        {"tool": "rectangle", "points": "ab"},
        {"tool": "rectangle", "points": [[1, 1], [2, float("nan")]]},
        {"tool": "rectangle", "points": [[1, 1], [2, 1e300]]},
        {"tool": "rectangle", "points": [[1, 1], [True, 2]]},
        {"tool": "polygon", "points": [[1, 1], [2, 2]]},
        {"tool": "brush", "points": [[1, 1]], "radius": 0},
        {"tool": "brush", "points": [[1, 1]], "radius": "5"},
        {"tool": "brush", "points": [[1, 1]] * 5001},
    ],
)
def test_what_is_no_stroke_changes_nothing(stroke: dict[str, object]) -> None:
    found = drawn({"tool": "rectangle", "points": [[0, 0], [9, 9]]})
    with pytest.raises(ConfigError):
        found.draw([{"tool": "rectangle", "points": [[20, 20], [29, 29]]}, stroke])
    assert found.box == (0, 0, 10, 10)
