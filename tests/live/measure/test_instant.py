"""The means of an instant: their bits belong to the values alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from live.measure import ordered_mean


@pytest.mark.parametrize("size", [1, 7, 945, 15_129])
def test_the_mean_does_not_depend_on_the_place_in_memory(size: int) -> None:
    values = np.random.default_rng(size).normal(1e-3, 1.0, size).astype(np.float32)
    means = set()
    for offset in range(0, 64, 4):
        room = np.empty(size * 4 + 64, np.uint8)
        place = room[offset : offset + size * 4].view(np.float32)
        place[:] = values
        means.add(ordered_mean(place))
    assert len(means) == 1
    assert means.pop() == pytest.approx(math.fsum(values.tolist()) / size, rel=1e-12)


def test_the_mean_of_nothing_is_not_a_number() -> None:
    assert math.isnan(ordered_mean(np.empty(0, np.float32)))
