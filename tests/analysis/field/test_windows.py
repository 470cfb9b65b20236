"""Windows and the correlation of estimates whose ZOIs overlap."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.field.windows import WINDOWS, overlap, profile


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("size", [32, 33])
def test_windows_are_symmetric_positive_and_at_most_one(window, size: int) -> None:
    line = profile(window, size)
    assert line.shape == (size,)
    assert np.allclose(line, line[::-1]) and line.min() >= 0 and 0.9 < line.max() <= 1


def test_an_unknown_window_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="bi-triangular"):
        profile("round", 32)  # type: ignore[arg-type]


@pytest.mark.parametrize("moment", [0, 1])
def test_overlap_is_the_correlation_of_window_weighted_noise(moment: int) -> None:
    size, step = 16, 4
    x = np.arange(size) - (size - 1) / 2
    kernel = x**moment * profile("gaussian", size)
    noise = np.random.default_rng(0).normal(0, 1, (4000, 3 * size))
    values = [noise[:, k : k + size] @ kernel for k in range(0, 2 * size, step)]
    expected = [np.corrcoef(values[0], v)[0, 1] for v in values[:6]]
    assert np.allclose(overlap("gaussian", size, step, 6, moment), expected, atol=0.05)
