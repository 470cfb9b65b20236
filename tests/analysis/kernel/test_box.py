"""Of a deformed image no more is made ready than the ZOIs can reach; no value depends on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, Status, StrainField, ZoiGrid
from analysis.kernel.reference import Reference
from tests.analysis.speckle import picture

GRID = ZoiGrid.cover(Roi(90, 60, 64, 64), size=32, step=16)


def measured(settings: KernelSettings, motion: dict[str, float], start: StrainField | None) -> StrainField:
    kernel = PhaseKernel(picture(), GRID, settings, noise=1.0)
    return kernel.measure(picture(**motion), start=start, noise=1.0)


@pytest.mark.parametrize(
    "settings", [KernelSettings(), KernelSettings(order=2), KernelSettings(estimator="phase")]
)
@pytest.mark.parametrize("motion", [{}, {"u": 3.0, "dv_dy": 0.02}, {"u": 25.0, "v": -18.0}, {"u": 70.0}])
def test_the_same_as_with_the_whole_image(
    settings: KernelSettings, motion: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the motion is beyond what the start made one expect, or leads out of the picture."""
    still = StrainField.from_values(GRID, {})
    own = measured(settings, motion, still)
    monkeypatch.setattr(Reference, "reached", lambda self, guess: self.whole)
    whole = measured(settings, motion, still)
    assert np.array_equal(own.status, whole.status)
    assert np.array_equal(own.parameters, whole.parameters, equal_nan=True)
    assert np.array_equal(own.covariance, whole.covariance, equal_nan=True)


def test_a_small_region_reaches_a_part_of_the_image() -> None:
    kernel = PhaseKernel(picture(), GRID, noise=1.0)
    box = kernel.reference.reached(np.zeros((len(kernel.reference.index), 6)))
    assert (box.bottom - box.top) * (box.right - box.left) < 0.5 * picture().size
    assert (
        kernel.reference.reached(np.full((len(kernel.reference.index), 6), np.nan)) == kernel.reference.whole
    )


def test_zois_far_apart_ask_for_their_own_pixels() -> None:
    """The distance of the ZOIs that are measured, not of the grid they were taken from, tells what to fetch."""
    grid = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=8)
    some = np.zeros(grid.shape, bool)
    some[::2, ::3] = True
    kernel = PhaseKernel(picture(), replace(grid, active=some), noise=1.0)
    assert kernel.reference.spacing == 24
    assert (kernel.measure(picture(), noise=1.0).status[some] == Status.OK).all()
