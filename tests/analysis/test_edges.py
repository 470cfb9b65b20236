"""Pictures with an edge or a corner in place of a pattern: no ZOI has a value, and those beside keep theirs."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from analysis.kernel.prepared import PatternError
from tests.accuracy.edges import box, valid_on_box
from tests.accuracy.truth import Speckle, pixels

GRID = ZoiGrid.cover(Roi(8, 8, 304, 304), 32, 8)


@pytest.mark.parametrize("noise", [0.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("blur", [0.0, 1.5])
def test_nothing_but_a_black_box_has_no_value(noise: float, blur: float) -> None:
    for motion in (0.0, 3.3):
        assert valid_on_box(GRID, noise, blur, motion) == 0


def test_a_pattern_beside_a_box_keeps_its_values() -> None:
    level = 255 * Speckle(2.0, 1).at(*pixels((320, 320)))
    level[100:240, 80:220] = 10
    first, second = (np.rint(level + np.random.default_rng(k).normal(0, 1, level.shape)) for k in (1, 2))
    field = PhaseKernel(first.clip(0, 255).astype(np.uint8), GRID).measure(
        second.clip(0, 255).astype(np.uint8)
    )
    x, y = np.meshgrid(GRID.x, GRID.y)
    apart = (np.abs(x - 149.5) > 70 + 8) | (np.abs(y - 169.5) > 70 + 8)
    assert field.ok[apart].all()
    within = (np.abs(x - 149.5) < 70 - 12) & (np.abs(y - 169.5) < 70 - 12)
    assert not field.ok[within].any()


def test_what_only_the_filter_spread_into_a_zoi_is_no_pattern() -> None:
    """Beside a sharp edge without noise the filtered picture swings where the picture itself is even."""
    picture = box(0.0, 0.0)
    y, x = 224, 200  # the corner is 20 px to the right and 16 px below
    assert np.ptp(picture[y - 16 : y + 16, x - 16 : x + 16]) == 0
    grid = ZoiGrid.cover(Roi(x - 16, y - 16, 32, 32), 32, 8)
    with pytest.raises(PatternError):
        PhaseKernel(np.rint(picture).astype(np.uint8), grid)


@pytest.mark.parametrize("size", [12, 16, 20, 24])
@pytest.mark.parametrize("order", [1, 2])
def test_small_zois_on_a_sharp_box_are_right_or_have_no_value(size: int, order: Literal[1, 2]) -> None:
    """Beside an edge, only what the filter made has a gradient along it."""
    grid = ZoiGrid.cover(Roi(8, 8, 304, 304), size, 6)
    kernel = PhaseKernel(np.rint(box(0.0, 0.0)).astype(np.uint8), grid, KernelSettings(order=order))
    for motion in (0.0, 3.3):
        field = kernel.measure(np.rint(box(motion, 0.0)).astype(np.uint8))
        off = np.hypot(field.u - motion, field.v - motion / 2)
        assert not (field.ok & (off > 0.1)).any()
