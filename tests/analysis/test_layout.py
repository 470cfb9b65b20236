"""The grid of specimen and plates by value: rows and columns on one lattice, and what touches a plate."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.field import Block, Roi, ZoiGrid
from analysis.optics import PlateLayout, without_plates

GRID = ZoiGrid.cover(Roi(100, 200, 160, 160), 32, 16)  # 9 x 9 ZOIs
GRID_WIDE = ZoiGrid.cover(Roi(100, 200, 16 * 30 + 32, 16 * 30 + 32), 32, 16)


def test_plates_above_and_below_widen_the_grid_by_whole_steps() -> None:
    """Rows of ZOIs start at 40 + 16 k: those wholly on the upper plate up to 104, on the lower one from 408 on."""
    layout = PlateLayout.of(GRID, {"top": (100.0, 40.0, 160.0, 100.0), "low": (99.0, 400.0, 49.0, 90.0)})
    assert layout.whole.roi == Roi(100, 40, 160, 26 * 16 + 32)
    assert layout.here == Block(slice(10, 19), slice(0, 9))
    assert layout.plates["top"] == Block(slice(0, 5), slice(0, 9))
    assert layout.plates["low"] == Block(slice(23, 27), slice(0, 2))
    assert layout.whole.n_active == 81 + 45 + 8


def test_plates_to_the_left_and_right_widen_it_too() -> None:
    layout = PlateLayout.of(GRID, {"left": (36.0, 200.0, 50.0, 48.0), "right": (276.0, 216.0, 48.0, 48.0)})
    assert layout.whole.roi == Roi(36, 200, 16 * 16 + 32, 160)
    assert layout.here == Block(slice(0, 9), slice(4, 13))
    assert layout.plates["left"] == Block(slice(0, 2), slice(0, 2))
    assert layout.plates["right"] == Block(slice(1, 3), slice(15, 17))


@pytest.mark.parametrize(("width", "room"), [(48.0, True), (47.0, False)])
def test_two_zois_a_side_make_a_plate(width: float, room: bool) -> None:
    for box in ((276.0, 200.0, width, 160.0), (276.0, 200.0, 160.0, width)):
        if room:
            assert min(PlateLayout.of(GRID, {"p": box}).plates["p"].of(GRID_WIDE).shape) == 2
        else:
            with pytest.raises(
                ValueError, match=r"plate p of .* has no room for 2 x 2 ZOIs of 32 px, 16 px apart"
            ):
                PlateLayout.of(GRID, {"p": box})


def test_without_a_zoi_beside_the_plates_nothing_is_measured() -> None:
    nothing = GRID.subset(active=np.zeros(GRID.shape, bool))
    with pytest.raises(ValueError, match="the plates cover the whole region to measure"):
        PlateLayout.of(nothing, {"p": (276.0, 200.0, 48.0, 160.0)})


@pytest.mark.parametrize(
    ("box", "rows", "columns"),
    [
        ((0.0, 0.0, 132.0, 232.0), 2, 2),  # up to column 131 and row 231; the third ZOI begins there
        ((0.0, 0.0, 133.0, 233.0), 3, 3),
        ((131.0, 231.0, 500.0, 500.0), -9, -9),  # the last pixel of the first ZOI
        ((132.0, 232.0, 500.0, 500.0), -8, -8),
    ],
)
def test_a_zoi_with_a_pixel_on_a_plate_is_left_out(
    box: tuple[float, float, float, float], rows: int, columns: int
) -> None:
    touched = np.zeros(GRID.shape, bool)
    touched[
        slice(rows) if rows > 0 else slice(rows, None),
        slice(columns) if columns > 0 else slice(columns, None),
    ] = True
    np.testing.assert_array_equal(without_plates(GRID, {"p": box}).active, ~touched)
