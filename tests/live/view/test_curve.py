"""Forces join their strains, and the axes read well."""

from __future__ import annotations

import math

import numpy as np

from live.view.curve import MAX_POINTS, ForceStrain, force_axis, strain_axis, stress_axis

NAN = math.nan


def test_a_force_that_comes_later_is_interpolated() -> None:
    curve = ForceStrain()
    curve.load(0.0, 0.0)
    curve.strain(0.05, 1e-3, NAN)
    assert len(curve.points()) == 0
    curve.load(0.1, 100.0)
    np.testing.assert_allclose(curve.points()[-1], [1e-3, 50.0])


def test_a_force_that_came_along_counts() -> None:
    curve = ForceStrain()
    curve.strain(0.05, 1e-3, 12.0)
    np.testing.assert_array_equal(curve.points()[-1], [1e-3, 12.0])


def test_nothing_is_invented_across_a_gap_or_before_the_first_sample() -> None:
    curve = ForceStrain()
    curve.strain(0.0, 1e-3, NAN)
    curve.load(1.0, 5.0)
    curve.strain(2.0, 2e-3, NAN)
    curve.load(3.0, 6.0)
    assert len(curve.points()) == 0


def test_a_rejected_strain_gives_no_point() -> None:
    curve = ForceStrain()
    curve.strain(0.0, NAN, 1.0)
    assert curve.points().shape == (0, 2)


def test_a_long_test_is_thinned_and_ends_with_the_newest() -> None:
    curve = ForceStrain()
    for k in range(20 * MAX_POINTS):
        curve.strain(float(k), 1e-6 * k, float(k))
    points = curve.points()
    assert MAX_POINTS / 2 - 1 <= len(points) <= MAX_POINTS + 1
    assert points[-1, 1] == 20 * MAX_POINTS - 1
    assert (np.diff(points[:, 1]) > 0).all()
    assert len(set(np.diff(points[:-1, 1]))) == 1


def test_axes_start_at_zero_and_leave_room() -> None:
    axis = strain_axis(np.array([0.0, 1e-3, 3.3e-3]))
    assert (axis.low, axis.unit) == (0.0, "µm/m")
    assert 3.3e-3 < axis.high <= 5e-3
    assert axis.place(np.array([0.0, axis.high])).tolist() == [0.0, 1.0]


def test_axes_of_compression_end_at_zero() -> None:
    axis = stress_axis(np.array([0.0, -120e6]))
    assert axis.high == 0.0
    assert axis.low <= -120e6
    assert axis.unit == "MPa"


def test_units_follow_the_size() -> None:
    assert strain_axis(np.array([0.05])).unit == "%"
    assert force_axis(np.array([8000.0])).unit == "N"
    assert force_axis(np.array([25e3])).unit == "kN"


def test_a_curve_of_nothing_but_zero_has_an_axis() -> None:
    for axis in (strain_axis(np.zeros(1)), stress_axis(np.zeros(1)), force_axis(np.zeros(1))):
        assert axis.high > axis.low
        assert len(axis.ticks) >= 2
