"""Pieces of work that threads come for: each is done once, whoever does it."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest

from analysis.compiled.shares import SHARES, next_piece


@numba.njit(parallel=True)
def done_by(times: Any, pieces: int, counter: Any) -> None:
    """How often each piece was done."""
    for _ in numba.prange(SHARES):
        piece = next_piece(counter)
        while piece < pieces:
            times[piece] += 1
            piece = next_piece(counter)


@pytest.mark.parametrize("pieces", [0, 1, 1000, 100_000])
def test_each_piece_is_done_once(pieces: int) -> None:
    times, counter = np.zeros(pieces, np.int64), np.zeros(1, np.int64)
    done_by(times, pieces, counter)
    assert (times == 1).all()
    assert counter[0] == pieces + SHARES, "each share has asked once too often"
