from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquire.burst.accumulate import BurstAccumulator, average_bursts, burst_of
from acquire.errors import ConfigError, DataError
from acquire.frame import Frame, frozen


def frame(image: NDArray[Any], index: int, *, bits: int = 8, lost: int = 0, damaged: bool = False) -> Frame:
    t = 100.0 + index / 10
    return Frame(frozen(image), index, t, "device", lost, bits, t, damaged)


def small(index: int, value: int = 7, **more: Any) -> Frame:
    return frame(np.full((3, 5), value, np.uint8), index, **more)


@pytest.mark.parametrize(("dtype", "bits"), [(np.uint8, 8), (np.uint16, 12), (np.uint16, 16)])
@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 16, 21])
def test_mean_noise_and_clipping_are_those_of_plain_arithmetic(dtype: type, bits: int, n: int) -> None:
    rng = np.random.default_rng(n)
    stack = rng.integers(0, 2**bits, (n, 61, 83)).astype(dtype)
    burst = burst_of([frame(image, 40 + i, bits=bits) for i, image in enumerate(stack)])
    exact = stack.astype(np.int64)
    assert burst.mean.dtype == (np.float32 if n > 1 else dtype)
    assert np.array_equal(burst.mean, (exact.sum(axis=0) / n).astype(np.float32))
    assert np.array_equal(burst.clipped, (exact == 2**bits - 1).any(axis=0))
    if n == 1:
        assert math.isnan(burst.noise)
    else:
        assert burst.noise == pytest.approx(math.sqrt((np.diff(exact, axis=0) ** 2).mean() / 2), rel=1e-12)
    assert (burst.n, burst.first_index, burst.last_index, burst.lost) == (n, 40, 40 + n - 1, 0)
    assert burst.t == pytest.approx(104 + (n - 1) / 20)
    assert burst.duration == pytest.approx((n - 1) / 10)


def test_noise_is_that_of_one_frame_and_ignores_slow_motion() -> None:
    rng = np.random.default_rng(1)
    drift = np.arange(32)[:, None, None] * 0.5
    stack = np.rint(1000 + drift + rng.normal(0, 4, (32, 200, 200))).astype(np.uint16)
    burst = burst_of([frame(image, i, bits=12) for i, image in enumerate(stack)])
    assert burst.noise == pytest.approx(math.hypot(4, 12**-0.5), rel=0.01)


def test_memory_is_its_own_and_read_only() -> None:
    sources = [small(0), small(1)]
    burst = burst_of(sources)
    assert not np.shares_memory(burst.mean, sources[0].image)
    assert not burst.mean.flags.writeable
    assert not burst.clipped.flags.writeable


def test_a_gap_restarts_the_burst_and_is_counted() -> None:
    indices = [0, 1, 2, 5, 6, 7, 8, 9, 10]
    lost = {5: 2}
    bursts = list(average_bursts((small(i, lost=lost.get(i, 0)) for i in indices), 4))
    assert [(b.first_index, b.last_index, b.lost) for b in bursts] == [(5, 8, 2)]


def test_a_loss_told_without_a_step_in_the_index_is_a_gap_too() -> None:
    bursts = list(average_bursts([small(0), small(1, lost=4), small(2)], 2))
    assert [(b.first_index, b.lost) for b in bursts] == [(1, 4)]


def test_a_damaged_frame_is_left_out() -> None:
    frames = [small(0), small(1, damaged=True), small(2), small(3)]
    bursts = list(average_bursts(frames, 2))
    assert [(b.first_index, b.lost) for b in bursts] == [(2, 1)]


def test_loss_between_bursts_belongs_to_the_next_one() -> None:
    frames = [small(0), small(1), small(4, lost=2), small(5)]
    assert [b.lost for b in average_bursts(frames, 2)] == [0, 2]


def test_frames_older_than_the_command_are_left_out() -> None:
    bursts = list(average_bursts([small(i) for i in range(6)], 2, not_before=100.25))
    assert [(b.first_index, b.lost) for b in bursts] == [(3, 0)]


@pytest.mark.parametrize("n", [0, -1, 65537])
def test_an_impossible_n_is_a_configuration_error(n: int) -> None:
    with pytest.raises(ConfigError, match="burst of"):
        average_bursts([], n)


def test_no_frames_make_no_burst() -> None:
    with pytest.raises(ConfigError):
        burst_of([])
    assert list(average_bursts([], 3)) == []


def test_an_exact_list_with_a_gap_is_refused() -> None:
    with pytest.raises(DataError, match="consecutive"):
        burst_of([small(0), small(2)])


def test_frames_of_another_kind_are_refused_by_name() -> None:
    with pytest.raises(DataError, match=r"frame 1 is 6x3 .* began with 5x3"):
        burst_of([small(0), frame(np.zeros((3, 6), np.uint8), 1)])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from(["good", "damaged", "gap"]), max_size=60), st.integers(1, 5))
def test_what_is_lost_or_damaged_is_counted_once(kinds: list[str], n: int) -> None:
    frames = list(_stream(kinds))
    accumulator = BurstAccumulator(n)
    bursts = [burst for burst in map(accumulator.add, frames) if burst]
    told_lost = sum(f.lost_before for f in frames)
    tail = accumulator.add(small(10_000, damaged=True))
    assert tail is None
    rest = [b for b in map(accumulator.add, (small(20_000 + i) for i in range(n))) if b]
    damaged = sum(f.damaged for f in frames) + 1
    assert sum(b.lost for b in bursts + rest) == told_lost + damaged
    indices = {f.index for f in frames if not f.damaged}
    assert all(set(range(b.first_index, b.last_index + 1)) <= indices for b in bursts)


def _stream(kinds: list[str]) -> Iterator[Frame]:
    index = 0
    for kind in kinds:
        index += 3 if kind == "gap" else 1
        yield small(index, lost=2 if kind == "gap" else 0, damaged=kind == "damaged")


@pytest.mark.parametrize("bits", [8, 12])
def test_a_burst_of_one_is_the_frame_itself(bits: int) -> None:
    top = 2**bits - 1
    image = frozen(np.array([[1, top], [top - 1, 0]], np.uint8 if bits == 8 else np.uint16))
    only = Frame(image, 5, 1.5, "device", 2, bits, 1.5)
    burst = burst_of([only])
    assert burst.mean is image
    assert (burst.n, burst.first_index, burst.last_index, burst.t, burst.lost) == (1, 5, 5, 1.5, 2)
    assert math.isnan(burst.noise)
    assert burst.clipped.tolist() == [[False, True], [False, False]]
