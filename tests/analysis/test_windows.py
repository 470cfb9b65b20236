"""Windows and the smallest and largest value of an area, by value."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import Roi, Status, StrainField, ZoiGrid
from analysis.evaluate import AreaGauge
from analysis.field.grid import profile

SIZE = 40
X = np.arange(SIZE) - 19.5


@pytest.mark.parametrize(
    ("window", "expected"),
    [
        ("gaussian", np.exp(-(X**2) / 2 / (SIZE / 6) ** 2)),
        ("uniform", np.ones(SIZE)),
        ("bi-triangular", 1 - np.abs(X) / 20.5),
        # Two cosine flanks that take 30 % of the side together, flat between them.
        ("tukey", np.where(np.abs(X) <= 14, 1, 0.5 + 0.5 * np.cos(np.pi * (np.abs(X) - 14) / 6))),
    ],
)
def test_the_windows(window: str, expected: np.ndarray) -> None:
    assert profile(window, SIZE) == pytest.approx(expected)  # type: ignore[arg-type]


@pytest.mark.parametrize(("statistic", "value"), [("smallest", -3e-3), ("largest", 2e-3), ("mean", 0.0)])
def test_the_extremes_of_an_area(statistic: str, value: float) -> None:
    """Where a ZOI has no value it is neither."""
    grid = ZoiGrid.cover(Roi(0, 0, 96, 64), 32, 16)
    strain, status = np.zeros(grid.shape), np.zeros(grid.shape, int)
    strain[0, 1], strain[1, 2], strain[2, 0], strain[2, 4] = -3e-3, 2e-3, 1e-3, 9.0
    status[2, 4] = Status.POOR_MATCH
    sigmas = np.arange(15.0).reshape(grid.shape) * 1e-6 + 1e-6
    field = StrainField.from_values(grid, {"du_dx": strain}, sigmas, status)
    gauge = AreaGauge("", (0, 0, 96, 64), value="exx", statistic=statistic)  # type: ignore[arg-type]
    found = gauge.measure(field)
    assert found.value == pytest.approx(value, abs=1e-12)
    place = {"smallest": (0, 1), "largest": (1, 2)}.get(statistic)
    assert place is None or found.sigma == pytest.approx(field.sigma("exx")[place])
