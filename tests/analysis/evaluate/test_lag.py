"""The lag of the load, recovered from simulated tests, and refused where a test does not tell it."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.evaluate import Figure, Track, find_lag

YIELD = 3e-3


def tracks(
    seed: int, lag: float, still: float = 3.0, rate: float = 6e-4, total: float = 12.0, newtons: float = 1.0
) -> tuple[Track, Track]:
    """A metal pulled at a constant rate: 20 frames/s with 10 um/m, 80 load samples/s that come ``lag`` late."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, total, 1e-3)
    strain = np.clip((t - still) * rate, 0, None)
    force = 1.4e6 * np.where(strain < YIELD, strain, YIELD + 0.02 * (strain - YIELD))
    frames = np.arange(0, total - 0.2, 1 / 20) + rng.uniform(0, 0.05)
    samples = np.arange(0, total, 1 / 80) + rng.uniform(0, 0.0125)
    return (
        Track(frames, np.interp(frames, t, strain) + rng.normal(0, 10e-6, len(frames))),
        Track(samples, np.interp(samples - lag, t, force) + rng.normal(0, newtons, len(samples))),
    )


def found(lag: float, **test: float) -> list[Figure]:
    return [find_lag(*tracks(seed, lag, **test)) for seed in range(50)]


@pytest.mark.parametrize("lag", [0.15, -0.1])
def test_the_lag_is_recovered_within_15_ms(lag: float) -> None:
    figures = found(lag)
    assert max(abs(f.value - lag) for f in figures) < 0.015
    assert sum(f.low <= lag <= f.high for f in figures) >= 44
    assert abs(np.mean([f.value for f in figures]) - lag) < 0.004


def test_a_slower_test_tells_it_less_well_and_says_so() -> None:
    figures = found(0.15, rate=2e-4, total=24.0)
    assert sum(f.low <= 0.15 <= f.high for f in figures) >= 44
    assert np.mean([f.high - f.low for f in figures]) > 1.3 * np.mean([f.high - f.low for f in found(0.15)])


@pytest.mark.parametrize(
    ("test", "says"),
    [
        ({"still": -1.0}, "begin to measure some seconds before"),
        ({"rate": 0.0}, "does not change"),
        ({"total": 1.5}, "shorter than twice"),
        ({"total": 0.5}, "frames have a strain"),
    ],
)
def test_it_is_refused_in_words(test: dict[str, float], says: str) -> None:
    for figure in found(0.15, **test)[:20]:
        assert not figure.known
        assert says in figure.why


def test_a_lag_beyond_the_search_is_not_answered() -> None:
    assert not any(f.known for f in found(1.6)[:20])


def test_strain_that_does_not_follow_is_refused() -> None:
    strain, force = tracks(0, 0.15)
    noise = np.random.default_rng(1).normal(0, 1e-5, len(strain.t))
    assert find_lag(Track(strain.t, noise), force).why == "the strain does not follow the force"


def test_gaps_are_left_out() -> None:
    strain, force = tracks(3, 0.15)
    values = strain.values.copy()
    values[::7] = np.nan
    figure = find_lag(Track(strain.t, values), force)
    assert abs(figure.value - 0.15) < 0.02


def test_samples_that_come_in_bunches() -> None:
    """A busy machine reads several lines at once and stamps them alike."""
    strain, force = tracks(0, 0.15)
    bunched = np.repeat(force.t[::4], 4)[: len(force.t)]
    figure = find_lag(strain, Track(bunched, force.values))
    assert figure.value == pytest.approx(0.15, abs=0.05)
