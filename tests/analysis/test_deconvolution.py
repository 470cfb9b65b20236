"""Maps with part of the window's blur taken off."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import Roi, ZoiGrid
from analysis.deconvolution import deconvolved

GRID = ZoiGrid.cover(Roi(0, 0, 400, 300), size=36, step=4)
SIGMA = 36 / 6


def wave(period: float) -> np.ndarray:
    return np.broadcast_to(np.sin(2 * np.pi * GRID.x / period), GRID.shape)


def amplitude(values: np.ndarray, period: float) -> float:
    inner = np.s_[20:-20, 20:-20]
    shape = wave(period)[inner]
    return float(np.sum(values[inner] * shape) / np.sum(shape**2))


@pytest.mark.parametrize("steps", [0, 1, 3, 6])
def test_each_step_gives_back_what_the_theory_says(steps: int) -> None:
    period = 60.0
    kept = np.exp(-2 * np.pi**2 * SIGMA**2 / period**2)
    found = deconvolved(kept * wave(period), GRID, steps)
    assert amplitude(found, period) == pytest.approx(1 - (1 - kept) ** (steps + 1), abs=0.01)


def test_gaps_stay_gaps_and_constants_stay_constant() -> None:
    values = np.full(GRID.shape, 0.01)
    values[10:14, 20:30] = np.nan
    found = deconvolved(values, GRID, 3)
    assert np.array_equal(np.isnan(found), np.isnan(values))
    assert np.nanmax(np.abs(found - 0.01)) < 1e-12


def test_what_cannot_be_deconvolved_is_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        deconvolved(np.zeros((3, 3)), GRID)
    coarse = ZoiGrid.cover(Roi(0, 0, 400, 300), 32, 16)
    with pytest.raises(ValueError, match="too far apart"):
        deconvolved(np.zeros(coarse.shape), coarse)
    with pytest.raises(ValueError, match="negative"):
        deconvolved(np.zeros(GRID.shape), GRID, -1)
