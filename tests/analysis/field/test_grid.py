"""Where ZOIs lie, which are active, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from analysis import Roi, ZoiGrid


def test_zois_are_left_and_top_aligned_and_lie_inside() -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 100, 70), size=32, step=16)
    assert grid.shape == (3, 5)
    assert grid.x[0] == 10 + 15.5 and grid.y[0] == 20 + 15.5
    assert grid.first_x[-1] + 32 <= 110 and grid.first_y[-1] + 32 <= 90


def test_odd_sizes_have_their_centre_on_a_pixel() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 33, 33), size=33, step=1)
    assert grid.shape == (1, 1) and grid.x[0] == 16.0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((Roi(0, 0, 30, 100), 32, 8), "does not fit"),
        ((Roi(0, 0, 100, 100), 32, 0), "step"),
        ((Roi(0, 0, 100, 100), 2, 8), "size"),
    ],
)
def test_impossible_grids_are_refused(arguments: tuple, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        ZoiGrid.cover(*arguments)


@pytest.mark.parametrize("roi", [(-1, 0, 10, 10), (0, -1, 10, 10), (0, 0, 0, 10), (0, 0, 10, -5)])
def test_impossible_regions_are_refused(roi: tuple) -> None:
    with pytest.raises(ValueError, match="region of interest"):
        Roi(*roi)


def test_mask_counts_window_weight_not_pixels() -> None:
    mask = np.ones((64, 64), bool)
    mask[:, :3] = False  # the flank of the Gaussian: 9 % of the pixels, under 1 % of the weight
    grid = ZoiGrid.cover(Roi(0, 0, 64, 64), 32, 32, mask)
    assert grid.active.all()
    assert not ZoiGrid.cover(Roi(0, 0, 64, 64), 32, 32, mask, window="uniform").active[:, 0].any()
    mask[:, :10] = False
    assert not ZoiGrid.cover(Roi(0, 0, 64, 64), 32, 32, mask).active[:, 0].any()


def test_mask_must_reach_over_the_region() -> None:
    with pytest.raises(ValueError, match="mask"):
        ZoiGrid.cover(Roi(0, 0, 64, 64), 32, 32, np.ones((60, 64), bool))


def test_subset_keeps_shape_and_only_takes_away() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 100, 100), 20, 20)
    half = grid.subset(every=2)
    assert half.shape == grid.shape and half.n_active == 9
    some = half.subset(active=np.eye(5, dtype=bool))
    assert some.n_active == 3
    with pytest.raises(ValueError, match="shape"):
        grid.subset(active=np.ones((2, 2), bool))


def test_description_survives_json() -> None:
    grid = ZoiGrid.cover(Roi(3, 4, 100, 90), 21, 7).subset(every=2)
    again = ZoiGrid.from_dict(json.loads(json.dumps(grid.to_dict())), grid.active)
    assert np.array_equal(again.active, grid.active)
    assert np.array_equal(again.x, grid.x) and np.array_equal(again.y, grid.y)
