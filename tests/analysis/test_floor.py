"""The still phase of forces and strains that are known, and the noise floor of maps whose noise is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.evaluate.floor import MIN_STILL_INSTANTS, evenly, noise_floor, still_phase

UNKNOWN = np.full(6, np.nan)
MOVES = {"eyy": (np.array([0.0, 4e-6, -4e-6, 2e-4, 0.0, 0.0]), np.full(6, 1e-6))}


@pytest.mark.parametrize(
    ("force", "count"),
    [
        ([5.0, 5.1, 4.9, 5.05, 8.0, 5.0, 100.0], 4),
        ([0.0, 0.0, -90.0, -6000.0], 2),  # pressed
        ([1.0, 1.0, np.nan, 9.0], 2),  # unknown from there on
        ([np.nan, 1.0, 9.0], 0),
        ([np.nan] * 5, 0),
        ([0.0] * 9, 0),  # nothing was pulled
        ([], 0),
    ],
)
def test_still_until_the_force_leaves_its_first_value(force: list[float], count: int) -> None:
    assert still_phase(np.array(force)) == count
    assert MIN_STILL_INSTANTS == 2


@pytest.mark.parametrize("force", [UNKNOWN, np.full(6, 3.0), np.array([np.nan, 0, 0, 0, 50, 100])])
def test_the_strains_decide_where_the_force_does_not(force: NDArray[np.float64]) -> None:
    assert still_phase(force, MOVES) == 3
    unknown = {"exx": (np.array([0, 0, np.nan, 0, 0, 0]), np.full(6, 1e-6))}
    assert still_phase(force, MOVES | unknown) == 2


def test_strains_that_scatter_do_not_end_what_the_force_decides() -> None:
    """They are the scatter that is looked for."""
    assert still_phase(np.array([0.0, 0, 0, 0, 0, 900]), MOVES) == 5


def test_the_noise_of_a_load_cell_is_no_load() -> None:
    force = np.random.default_rng(0).normal(3.0, 0.2, 600)
    still = {"eyy": (np.zeros(600), np.full(600, 1e-6))}
    assert still_phase(force, still) == 600
    force[400:] += np.linspace(0, 500, 200)
    assert still_phase(force, still) == pytest.approx(401, abs=2)


@pytest.mark.parametrize(("sigmas", "count"), [(4.9, 6), (5.1, 3)])
def test_a_mean_strain_moves_beyond_five_sigmas(sigmas: float, count: int) -> None:
    means = {"exx": (np.array([0.0, 0, 0, -sigmas * 1e-6, 0, 0]), np.full(6, 1e-6))}
    assert still_phase(UNKNOWN, means) == count


@pytest.mark.parametrize(("highest", "count"), [(23.0, 0), (24.5, 1)])
def test_a_force_ranges_over_ten_times_its_noise(highest: float, count: int) -> None:
    """One up and down: like a standard deviation of 2.42, by its second differences."""
    force = (-1.0) ** np.arange(40)
    force[-1] = highest - 1
    assert still_phase(force) == count


@pytest.mark.parametrize(("force", "count"), [(0.99, 4), (1.01, 2)])
def test_a_force_differs_beyond_one_percent_of_its_range(force: float, count: int) -> None:
    assert still_phase(np.array([0.0, 0, -force, 0, 50, 100 - force])) == count


def test_evenly() -> None:
    assert evenly(3, 8).tolist() == [0, 1, 2]
    assert evenly(101, 3).tolist() == [0, 50, 100]
    assert evenly(0, 8).tolist() == []


@pytest.mark.parametrize("planes", [True, False])
def test_the_floor_is_the_noise(planes: bool) -> None:
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:9, :7]
    motion = 0.3 + 0.02 * x - 0.01 * y if planes else 0.3
    values = [motion + rng.normal(0, 2e-3, x.shape) for _ in range(200)]
    for one in values:
        one[0, 0] = np.nan
    found = noise_floor([(one, np.full(x.shape, 1e-3)) for one in values], planes=planes)
    assert found is not None
    assert found.measured == pytest.approx(2e-3, rel=0.02)
    assert found.predicted == pytest.approx(1e-3)


def test_too_few_zois_have_no_floor() -> None:
    one = np.array([[1.0, np.nan], [np.nan, np.nan]])
    assert noise_floor([(one, one)]) is None
    three = np.array([[1.0, 2.0], [4.0, np.nan]])
    assert noise_floor([(three, three)], planes=True) is None
    assert noise_floor([(three, three)]) is not None
