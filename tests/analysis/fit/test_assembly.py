"""Residual and covariances against the same sums in plain numpy."""

from __future__ import annotations

import numpy as np

from analysis.fit.assembly import RUN, scale, weigh


def test_a_zoi_is_weighed_by_the_noise_of_both_images() -> None:
    measured = np.array([True, False, True])
    left, freedom, gain = np.array([8.0, 1.0, 3.0]), np.array([2.0, 1.0, 4.0]), np.array([0.5, 1.0, 0.01])
    reference, current = np.array([4.0, 1.0, 2.0]), np.array([3.0, 1.0, 1.0])
    residual, first, whole = np.empty((3, 3), np.float32)
    weigh(measured, left, freedom, gain, reference, current, residual, first, whole)
    assert np.allclose(residual, [4 / (1 + 3), 0.5, 0.75 / (2e-4 + 1)])
    assert np.array_equal(first, [4, np.nan, 2], equal_nan=True)
    # In grey levels of the reference, by a gain of 0.1 at least.
    assert np.allclose(whole, [4 + 3 / 0.25, np.nan, 2 + 1 / 0.01], equal_nan=True)


def test_unit_covariances_are_scaled_whatever_their_number() -> None:
    rng = np.random.default_rng(0)
    for count in (1, RUN, RUN + 5):
        unit = rng.normal(size=(21, count)).astype(np.float32)
        first, whole = rng.random((2, count)).astype(np.float32)
        whole[0] = np.nan
        out = np.empty((2, 21, count), np.float32)
        scale(unit, first, whole, out[0], out[1])
        assert np.array_equal(out[0], unit * first)
        assert np.array_equal(out[1], unit * whole, equal_nan=True)
