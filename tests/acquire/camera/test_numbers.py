"""Numbers of frames over the whole range of a driver's 32 bits."""

from __future__ import annotations

import pytest

from acquire.camera.timing import FrameCounter


@pytest.mark.parametrize(
    ("before", "after", "lost"),
    [
        (2**32 - 1, 0, 0),
        (2**32 - 3, 2, 4),
        (2**31 - 1, 2**31, 0),
        (10, 10 + 2**30 + 5, 2**30 + 4),  # more than a quarter of the range is still a gap
        (10, 10 + 2**31 - 1, 2**31 - 2),
    ],
)
def test_a_gap_anywhere_in_the_range(before: int, after: int, lost: int) -> None:
    counter = FrameCounter()
    counter.count(before, 1.0, None)
    assert counter.count(after, 2.0, None) == lost
    assert counter.index == before + 1 + lost and counter.counts_itself


def test_a_number_that_goes_back_is_no_gap() -> None:
    counter = FrameCounter()
    counter.count(1000, 1.0, 10.0)
    assert counter.count(990, 1.1, 10.0) == 0
    assert not counter.counts_itself and counter.index == 1001


def test_half_the_range_is_no_gap_any_more() -> None:
    counter = FrameCounter()
    counter.count(10, 1.0, 10.0)
    assert counter.count(10 + 2**31, 1.3, 10.0) == 2
    assert not counter.counts_itself and counter.index == 13
