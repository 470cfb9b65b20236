"""How still a series is; what a result does not have is None, so that equal results are equal."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from analysis.quality import mains_of, steadiness

TIMES = np.arange(60) / 30.0


def test_a_line_has_its_frequency_and_its_mains() -> None:
    found = steadiness(TIMES, 0.5 + 0.1 * np.sin(2 * np.pi * 10 * TIMES))
    assert found.frequency == pytest.approx(10, abs=0.1) and found.rate == pytest.approx(30)
    assert mains_of(found, 2) == 50.0  # 100 Hz shows at 10 Hz in 30 pictures a second


def test_noise_alone_has_no_frequency() -> None:
    noise = np.random.default_rng(3).normal(0, 1, 60)
    found = steadiness(TIMES, noise)
    assert found.frequency is None and mains_of(found, 2) is None
    assert found.rate == pytest.approx(30)


def test_without_times_there_is_neither_frequency_nor_rate() -> None:
    found = steadiness(np.zeros(60), np.arange(60.0) % 2)
    assert found.frequency is None and found.rate is None and mains_of(found, 1) is None


def test_the_same_series_gives_equal_results() -> None:
    """Also where nothing stands out, and from another process: no comparison by identity."""
    for values in (np.zeros(60), np.random.default_rng(3).normal(0, 1, 60)):
        found = steadiness(TIMES, values)
        assert steadiness(TIMES, values) == found
        assert pickle.loads(pickle.dumps(found)) == found
