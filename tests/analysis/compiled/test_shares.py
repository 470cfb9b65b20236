"""Pieces of work that threads come for: each is done once, whoever does it."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest

from analysis.compiled.shares import SHARES, next_piece


@numba.njit(parallel=True)
def done_by(times: Any, counters: Any, pieces: int) -> None:
    """How often each piece was done."""
    for share in numba.prange(SHARES):
        piece = next_piece(counters, share, pieces)
        while piece >= 0:
            times[piece] += 1
            piece = next_piece(counters, share, pieces)


@pytest.mark.parametrize("pieces", [0, 1, 3, 1000, 100_001])
def test_each_piece_is_done_once(pieces: int) -> None:
    times, counters = np.zeros(pieces, np.int64), np.zeros(SHARES, np.int64)
    done_by(times, counters, pieces)
    assert (times == 1).all()
    assert counters.sum() >= pieces


@pytest.mark.parametrize("share", [0, 5, SHARES - 1])
def test_a_thread_begins_with_its_own_and_goes_on_with_what_others_left(share: int) -> None:
    counters, pieces = np.zeros(SHARES, np.int64), 10 * SHARES + 3
    other = next_piece(counters, (share + 1) % SHARES, pieces)
    done = [next_piece(counters, share, pieces) for _ in range(pieces)]
    own = range(pieces * share // SHARES, pieces * (share + 1) // SHARES)
    assert done[: len(own)] == list(own)
    assert sorted(done) == [-1, *sorted(set(range(pieces)) - {other})]
