"""The axes read well."""

from __future__ import annotations

import numpy as np

from live.view.drawing.curve import force_axis, strain_axis, stress_axis


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
