"""A rolling shutter is removed by the measured velocity, exactly for rigid motion and with its uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import Roi, StrainField, ZoiGrid
from analysis.optics import ShutterCorrection
from hw_mocks.deformation import Affine
from hw_mocks.optics import RolledShutter

GRID = ZoiGrid.cover(Roi(40, 100, 200, 800), 64, 16)
READOUT, HEIGHT = 0.033, 1001
NAMES = ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")


def seen(t: float, sigma: float = 1e-3) -> StrainField:
    """Strained by 1000 um/m, and moving at 4 px/s to the right and 10 px/s down."""
    place = RolledShutter(lambda at: Affine(4 * at, 10 * at, dv_dy=1e-3, x0=140, y0=500), t, READOUT, HEIGHT)
    x, y = np.meshgrid(GRID.x, GRID.y)
    (u, v), (a, b, c, d) = place.displacement(x, y), place.gradient(x, y)
    return StrainField.from_values(GRID, dict(zip(NAMES, (u, a, b, v, c, d), strict=True)), sigma)


def test_velocity_no_longer_shows_as_strain() -> None:
    correction = ShutterCorrection(READOUT, HEIGHT)
    raw = seen(0.1)
    assert raw.mean("eyy")[0] - 1e-3 == pytest.approx(330e-6, rel=3e-3)
    assert raw.mean("gamma_xy")[0] == pytest.approx(4 * READOUT / 1000, rel=3e-3)
    assert correction.apply(raw, 0.1) is raw  # nothing is known of the velocity yet
    field = correction.apply(seen(0.2), 0.2)
    assert field.mean("eyy")[0] == pytest.approx(1e-3, abs=0.5e-6)
    assert field.mean("gamma_xy")[0] == pytest.approx(0, abs=0.5e-6)
    assert field.mean("v")[0] == pytest.approx(2.0 + 1e-3 * (np.mean(GRID.y) - 500), abs=2e-5)


def test_the_noise_of_the_velocity_is_in_the_strain() -> None:
    correction = ShutterCorrection(READOUT, HEIGHT)
    first, second = seen(0.1, 0.5), seen(0.2, 0.5)
    correction.apply(first, 0.1)
    found = correction.apply(second, 0.2)
    velocity = 2**0.5 * second.mean("v")[1] / 0.1
    expected = np.hypot(second.mean("eyy")[1], velocity * READOUT / 1000)
    assert found.mean("eyy")[1] == pytest.approx(expected, rel=3e-3)
    assert found.mean("eyy")[1] > second.mean("eyy")[1]


def test_the_uncertainty_of_the_readout_time_is_in_the_strain() -> None:
    correction = ShutterCorrection(READOUT, HEIGHT, 0.1 * READOUT)
    first, second = seen(0.1, 1e-9), seen(0.2, 1e-9)
    correction.apply(first, 0.1)
    found = correction.apply(second, 0.2)
    assert found.mean("eyy")[1] == pytest.approx(0.1 * 330e-6, rel=5e-3)
    assert found.mean("gamma_xy")[1] == pytest.approx(0.1 * 4 * READOUT / 1000, rel=5e-3)


def test_a_lost_picture_and_a_time_that_stands_change_nothing() -> None:
    correction = ShutterCorrection(READOUT, HEIGHT)
    correction.apply(seen(0.1), 0.1)
    lost = StrainField.from_values(GRID, {}, status=np.full(GRID.shape, 5))
    assert correction.apply(lost, 0.15) is lost
    again = seen(0.1)
    assert correction.apply(again, 0.1) is again


def uniform(u: float, v: float, /, **sigmas: float) -> StrainField:
    """Moved as a whole and sheared, with gradients of their own."""
    gradients = {"du_dx": 0.02, "du_dy": 0.03, "dv_dx": 0.01, "dv_dy": -0.04}
    return StrainField.from_values(GRID, {"u": u, "v": v, **gradients}, sigmas)


def test_each_value_loses_what_its_velocity_makes_of_the_time_of_its_line() -> None:
    """Of 51 lines in 20 ms the middle one is number 25; a line is late by its place in the picture as it is now."""
    correction, line_s = ShutterCorrection(0.02, 51), 0.02 / 50
    correction.apply(uniform(0.0, 0.0), 0.5)
    found = correction.apply(uniform(2.0, -3.0), 1.0)  # 4 px/s and -6 px/s
    late = line_s * (GRID.y[:, None] - 3.0 - 25.0) + np.zeros(GRID.shape)
    assert found.u == pytest.approx(2.0 - 4 * late, rel=1e-12)
    assert found.v == pytest.approx(-3.0 + 6 * late, rel=1e-12)
    for name, value in (
        ("du_dx", 0.02 - 4 * line_s * 0.01),
        ("du_dy", 0.03 - 4 * line_s * (1 - 0.04)),
        ("dv_dx", 0.01 + 6 * line_s * 0.01),
        ("dv_dy", -0.04 + 6 * line_s * (1 - 0.04)),
    ):
        assert getattr(found, name) == pytest.approx(value, rel=1e-12), name
    rested = uniform(2.0, -3.0)
    assert np.array_equal(correction.apply(rested, 1.5).parameters, rested.parameters), (
        "since the burst before"
    )


def test_the_noise_of_each_velocity_is_in_its_own_gradients() -> None:
    correction, slope = ShutterCorrection(0.02, 51), 0.02 / 50 * (1 - 0.04)
    first, second = uniform(0.0, 0.0, u=0.5, v=0.1), uniform(2.0, -3.0, u=0.5, v=0.1)
    correction.apply(first, 0.5)
    common = correction.apply(second, 1.0).common
    assert common is not None
    for name, value in (("du_dy", "u"), ("dv_dy", "v")):
        velocity = np.sqrt(2) * first.mean(value)[1] / 0.5
        assert common.variance(name) == pytest.approx((velocity * slope) ** 2, rel=1e-9), name
