"""The estimator by phases alone: the same answers, blind to brightness, with its own uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from tests.analysis.speckle import picture

GRID = ZoiGrid.cover(Roi(16, 16, 208, 168), size=32, step=20)
PHASE = KernelSettings(estimator="phase")


def test_phases_alone_find_shift_and_strain() -> None:
    kernel = PhaseKernel(picture(), GRID, PHASE)
    field = kernel.measure(picture(u=0.3, v=-0.2, du_dx=0.002))
    assert field.ok.all()
    assert np.mean(field.u) == pytest.approx(0.3 + 0.002 * (np.mean(GRID.x) - 119.5), abs=2e-4)
    assert np.mean(field.du_dx) == pytest.approx(0.002, abs=2e-5)
    assert np.mean(field.dv_dy) == pytest.approx(0, abs=2e-5)


def test_contrast_and_brightness_do_not_enter() -> None:
    kernel = PhaseKernel(picture(), GRID, PHASE)
    plain = kernel.measure(picture(u=0.3).astype(np.float32))
    dim = kernel.measure(picture(u=0.3).astype(np.float32) * 0.6 + 500)
    assert np.max(np.abs(plain.u - dim.u)) < 5e-4


def test_predicted_uncertainty_is_the_scatter() -> None:
    kernel = PhaseKernel(picture(0.01, 1), GRID, PHASE, noise=41.0)
    values = np.stack([kernel.measure(picture(0.01, s), noise=41.0).u for s in range(2, 12)])
    predicted = np.mean(kernel.measure(picture(0.01, 2), noise=41.0).sigma("u", "current"))
    assert np.sqrt(np.mean(values.var(axis=0, ddof=1))) == pytest.approx(predicted, rel=0.1)


def test_only_order_one() -> None:
    with pytest.raises(ValueError, match="order 1"):
        KernelSettings(estimator="phase", order=2)
