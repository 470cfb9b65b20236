"""A renewed reference: results stay those of the original grid, uncertainty included."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import PhaseKernel, Roi, Status, ZoiGrid
from tests.analysis.speckle import SHAPE, picture

GRID = ZoiGrid.cover(Roi(36, 36, 168, 128), size=32, step=24)
NOISE = 0.01
SIGMA = NOISE * 4095
HALF = {"u": 2.3, "v": -1.2, "du_dx": 0.03, "dv_dy": -0.01, "du_dy": -0.02, "dv_dx": 0.02}
WHOLE = {"u": 4.1, "v": -2.2, "du_dx": 0.06, "dv_dy": -0.02, "du_dy": -0.04, "dv_dx": 0.04}


def true_u(grid: ZoiGrid, m: dict) -> np.ndarray:
    x, y = np.meshgrid(grid.x - (SHAPE[1] - 1) / 2, grid.y - (SHAPE[0] - 1) / 2)
    return m["u"] + m["du_dx"] * x + m["du_dy"] * y


def test_results_are_composed_on_the_original_grid() -> None:
    kernel = PhaseKernel(picture(), GRID)
    first = kernel.measure(picture(**HALF))
    renewed = kernel.renewed(picture(**HALF), first)
    for start in (None, first):
        field = renewed.measure(picture(**WHOLE), start=start)
        assert field.ok.all()
        assert np.max(np.abs(field.u - true_u(GRID, WHOLE))) < 2e-3
        for name in ("du_dx", "du_dy", "dv_dx", "dv_dy"):
            assert np.mean(getattr(field, name)) == pytest.approx(WHOLE[name], abs=2e-5)
    same = renewed.measure(picture(**HALF))
    assert np.max(np.abs(same.u - first.u)) < 1e-3


def test_uncertainty_accumulates_as_the_scatter_does() -> None:
    errors, sigmas = [], []
    for seed in range(12):
        kernel = PhaseKernel(picture(NOISE, 3 * seed), GRID, noise=SIGMA)
        middle = picture(NOISE, 3 * seed + 1, **HALF)
        first = kernel.measure(middle, noise=SIGMA)
        field = kernel.renewed(middle, first).measure(picture(NOISE, 3 * seed + 2, **WHOLE), noise=SIGMA)
        errors.append(field.u - true_u(GRID, WHOLE))
        sigmas.append(field.sigma_u)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt(np.mean(np.square(sigmas))), rel=0.1)


def test_a_zoi_that_was_lost_stays_lost() -> None:
    kernel = PhaseKernel(picture(), GRID)
    covered = picture(**HALF).copy()
    covered[:90, :90] = 2000
    first = kernel.measure(covered)
    assert first.status[0, 0] != Status.OK and first.n_valid > 0
    field = kernel.renewed(picture(**HALF), first).measure(picture(**WHOLE))
    assert np.array_equal(field.ok, first.ok)
    assert np.isnan(field.u[0, 0])


def test_impossible_renewals_are_refused() -> None:
    kernel = PhaseKernel(picture(), GRID)
    field = kernel.measure(picture())
    with pytest.raises(ValueError, match="shape"):
        kernel.renewed(picture()[:100], field)
    blank = kernel.measure(np.full(SHAPE, 7, np.uint8))
    with pytest.raises(ValueError, match="valid ZOI"):
        kernel.renewed(picture(), blank)
