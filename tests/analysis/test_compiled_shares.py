"""Loops in shares: each item is done once, whoever does it, and the arguments may be of any kind."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest

from analysis.compiled.loops import helper, shared
from analysis.compiled.shares import in_shares, part_of
from analysis.compiled.threads import SHARES, next_piece


class Args(NamedTuple):
    """As loops have them: arrays and numbers, one within the other."""

    values: Any
    factor: float


@helper
def _times(args: Any, other: tuple[Any, int], done: Any, share: int) -> None:
    first, end = part_of(len(args.values), share)
    for i in range(first, end):
        done[i] += args.factor * args.values[i] + other[0][i, 1] + other[1]


@shared
def times(args: Args, other: tuple[Any, int], done: Any) -> int:
    """Add to ``done``; then go on, alone."""
    in_shares(_times, (args, other, done))
    return len(done)


@helper
def _count(done: Any, counters: Any, by: Any, share: int) -> None:
    piece = next_piece(counters, share, len(done))
    while piece >= 0:
        done[piece] += 1
        by[share] += 1
        piece = next_piece(counters, share, len(done))


@shared
def count(done: Any, by: Any) -> None:
    """Two loops one after the other, of which the second finds all of the first done."""
    in_shares(_count, (done, np.zeros(SHARES, np.int64), by))
    in_shares(_count, (done, np.zeros(SHARES, np.int64), by))


@pytest.mark.parametrize("n", [0, 1, 63, 64, 65, 1000])
def test_every_item_is_done_once_with_its_arguments(n: int) -> None:
    values, beside, done = np.arange(n, dtype=np.float32), np.arange(2.0 * n).reshape(n, 2), np.ones(n)
    assert times(Args(values, 2.5), (beside, 7), done) == n
    np.testing.assert_array_equal(done, 1 + 2.5 * np.arange(n) + (2 * np.arange(n) + 1) + 7)


@pytest.mark.parametrize("n", [0, 1, 10, 999])
def test_pieces_are_taken_once_in_each_of_two_loops(n: int) -> None:
    done, by = np.zeros(n, np.int64), np.zeros(SHARES, np.int64)
    count(done, by)
    np.testing.assert_array_equal(done, 2)
    assert by.sum() == 2 * n


def test_the_parts_of_shares_join() -> None:
    for n in (0, 1, 64, 1001):
        parts = [part_of.py_func(n, share) for share in range(SHARES)]
        assert parts[0][0] == 0
        assert parts[-1][1] == n
        assert all(a[1] == b[0] for a, b in pairwise(parts))
