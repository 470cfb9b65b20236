"""Readings in memory and in a file, by value against a plain list."""

from __future__ import annotations

import random
from bisect import bisect_left, bisect_right

import numpy as np
import pytest

from acquire.load_cell import LoadLog, load_log
from acquire.load_sample import LoadSample


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(load_log, "ROWS", 4)
    monkeypatch.setattr(load_log, "PIECE", 3)


@pytest.mark.parametrize("seed", range(20))
def test_a_part_and_a_place_are_those_of_a_list(seed: int) -> None:
    rng, stored, times = random.Random(seed), load_log.StoredReadings(), list[float]()
    for k in range(rng.randrange(40)):
        times.append((times[-1] if times else 0.0) + rng.choice([0.0, 0.0, 1.0, 2.0]))
        stored.append(times[-1], float(k))
        assert (len(stored), stored.last_t) == (k + 1, times[-1])
    for t in np.arange(-1, 45, 0.5).tolist():
        assert (stored.before(t), stored.until(t)) == (bisect_left(times, t), bisect_right(times, t))
    first, stop = rng.randrange(45), rng.randrange(len(times) + 1)
    assert stored.part(first, stop).tolist() == [times[first:stop], [*map(float, range(first, stop))]]
    assert [stored.at(k) for k in range(len(times))] == [*zip(times, range(len(times)), strict=True)]


def test_old_readings_are_in_a_file_and_the_forces_the_same() -> None:
    log, plain = LoadLog(max_gap_s=2.0), np.random.default_rng(1).normal(size=50)
    for k, force in enumerate(plain.tolist()):
        log.append(LoadSample(float(k), force))
    assert [type(block) for block in log._stored._filed] == [int] * 12
    at = np.linspace(0, 49, 491)
    assert [log.force_at(t) for t in at.tolist()] == pytest.approx(np.interp(at, range(50), plain), abs=1e-12)
    assert log.mean(3.5, 20.0) == (pytest.approx(plain[4:21].mean()), 17)
    pieces = [*log.pieces()]
    assert [len(t) for t, _ in pieces] == [3] * 16 + [2]
    assert (
        np.concatenate([force for _, force in pieces]).tolist() == plain.tolist() == log.arrays()[1].tolist()
    )
