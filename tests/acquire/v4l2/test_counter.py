from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acquire.camera.guards import FailureGuard, RepeatGuard, missing_between
from acquire.events import Muffler
from acquire.v4l2.counter import FrameCounter


def counted(*stamps: tuple[int, float], fps: float | None = 10.0) -> list[tuple[int, int]]:
    counter = FrameCounter()
    return [(counter.count(sequence, t, fps), counter.index)[::-1] for sequence, t in stamps]


def test_it_begins_with_the_drivers_number_and_counts_its_gaps() -> None:
    assert counted((7, 0.0), (8, 0.1), (12, 0.5)) == [(7, 0), (8, 0), (12, 3)]


def test_the_number_may_run_over() -> None:
    assert counted((2**32 - 1, 0.0), (0, 0.1), (2, 0.3)) == [(2**32 - 1, 0), (2**32, 0), (2**32 + 2, 1)]


def test_after_a_restart_the_stamps_tell() -> None:
    counter = FrameCounter()
    counter.count(5, 1.0, 10.0)
    counter.restart()
    assert (counter.count(0, 2.0, 10.0), counter.index) == (9, 15)
    assert (counter.count(2, 2.2, 10.0), counter.index) == (1, 17)


def test_a_driver_that_does_not_count_is_noticed() -> None:
    counter = FrameCounter()
    assert [counter.count(0, t, 10.0) for t in (0.0, 0.1, 0.4)] == [0, 0, 2]
    assert not counter.counts_itself
    assert counter.index == 4


@given(
    st.lists(st.tuples(st.integers(0, 2**32 - 1), st.floats(-1e3, 1e6), st.booleans()), max_size=40),
    st.sampled_from([None, 1.0, 60.0]),
)
def test_numbers_always_increase_and_agree_with_the_losses(
    stamps: list[tuple[int, float, bool]], fps: float | None
) -> None:
    counter = FrameCounter()
    last = None
    for sequence, t, restart in stamps:
        if restart:
            counter.restart()
        lost = counter.count(sequence, t, fps)
        if last is not None:
            assert counter.index == last + 1 + lost
        last = counter.index


def test_missing_between_never_counts_backwards() -> None:
    assert missing_between(1.0, 1.5, 10.0) == 4
    assert missing_between(1.0, 0.5, 10.0) == 0
    assert missing_between(1.0, 9.0, None) == 0


def test_repeated_pictures_are_found_once_a_run() -> None:
    guard = RepeatGuard()
    a, b = np.zeros((2, 2)), np.ones((2, 2))
    seen = [(guard.repeated(image), guard.just_found) for image in (a, a, a, a, b, b)]
    assert seen == [(False, False)] * 2 + [(True, True), (True, False)] + [(False, False)] * 2


def test_a_dead_handle_is_told_from_a_stall() -> None:
    assert "fail at once" in FailureGuard().verdict(0.0001)
    assert "within 1.0 s" in FailureGuard().verdict(1.0)


def test_a_fault_with_every_frame_is_told_once_a_while_and_none_is_forgotten() -> None:
    muffler = Muffler(2.0)
    assert [muffler.told(t) for t in (0.0, 0.5, 1.0, 2.5, 2.6, 9.0)] == [1, 0, 0, 3, 0, 2]
