"""The memory of bursts: as exact sums, and pictures that are used again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
import pytest

from acquire.burst import (
    BurstAccumulator,
    PictureMemory,
    SumAccumulator,
    SummedBurst,
    nothing_clipped,
    sum_kind,
)
from acquire.frame import Burst, Frame, frozen

SHAPE = (23, 31)


def frames(n: int, bits: int, *, glare: bool, lost: int = 0) -> Iterator[Frame]:
    """n frames of noise, with some pixels at saturation where there is ``glare``."""
    rng, top = np.random.default_rng(n + bits), 2**bits - 1
    for i in range(n):
        image = rng.integers(0, top, SHAPE).astype(np.uint8 if bits <= 8 else np.uint16)
        if glare:
            image[rng.integers(0, SHAPE[0], 3), rng.integers(0, SHAPE[1], 3)] = top
        yield Frame(frozen(image), i, 7.0 + i / 30, "device", lost * (i == 0), bits, i / 30)


def summed(n: int, bits: int, *, glare: bool, lost: int = 0) -> SummedBurst:
    *_, burst = map(SumAccumulator(n).add, frames(n, bits, glare=glare, lost=lost))
    assert burst is not None
    return burst


@pytest.mark.parametrize("glare", [False, True])
@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("n", [1, 2, 8, 9, 16, 17, 300])
def test_mean_and_mask_have_the_bits_of_an_averaged_burst(n: int, bits: int, glare: bool) -> None:
    *_, expected = map(BurstAccumulator(n).add, frames(n, bits, glare=glare, lost=2))
    made = summed(n, bits, glare=glare, lost=2).burst(PictureMemory())
    assert expected is not None
    assert made.mean.dtype == expected.mean.dtype and made.mean.tobytes() == expected.mean.tobytes()
    assert made.clipped.any() == glare and np.array_equal(made.clipped, expected.clipped)
    assert not (made.mean.flags.writeable or made.clipped.flags.writeable)
    numbers = [f.name for f in fields(Burst) if f.name not in ("mean", "clipped")]
    assert repr([getattr(made, name) for name in numbers]) == repr(
        [getattr(expected, name) for name in numbers]
    )


@pytest.mark.parametrize(
    ("n", "bits", "bytes_a_pixel"),
    [(2, 8, 2), (257, 8, 2), (258, 8, 4), (16, 12, 2), (17, 12, 4), (2, 16, 4), (2, 15, 2), (3, 15, 4)],
)
def test_what_waits_is_the_sum_and_the_bits_of_clipped_pixels(n: int, bits: int, bytes_a_pixel: int) -> None:
    pixels = SHAPE[0] * SHAPE[1]
    assert sum_kind(bits, n).itemsize == bytes_a_pixel
    assert summed(n, bits, glare=False).nbytes == bytes_a_pixel * pixels
    assert summed(n, bits, glare=True).nbytes == bytes_a_pixel * pixels + (pixels + 7) // 8


@pytest.mark.parametrize("glare", [False, True])
def test_a_single_frame_waits_as_it_is(glare: bool) -> None:
    [frame] = frames(1, 8, glare=glare)
    burst = SumAccumulator(1).add(frame)
    assert burst is not None and burst.total is frame.image and burst.flags is None
    assert burst.burst(PictureMemory()).mean is frame.image


def test_bursts_without_a_clipped_pixel_share_their_mask() -> None:
    masks = [summed(n, 8, glare=False).burst(PictureMemory()).clipped for n in (1, 2, 2)]
    assert all(mask is nothing_clipped(SHAPE) for mask in masks)


def test_a_gap_begins_the_sum_anew_and_is_counted() -> None:
    given = list(frames(5, 8, glare=False))
    taker = SumAccumulator(2)
    made = [burst for k in (0, 2, 3, 4) if (burst := taker.add(given[k])) is not None]
    assert [(burst.first_index, burst.last_index, burst.n) for burst in made] == [(2, 3, 2)]
    brief = made[0].without_pictures()
    assert (brief.nbytes, brief.first_index, brief.lost) == (0, 2, 0)


SMALL = (6, 7)


def bursts_of(memory: PictureMemory, n: int, *, held: int, total: int) -> list[tuple[Burst, float]]:
    """Bursts of n frames of one level each, with that level; each is dropped after ``held`` more."""
    accumulator = BurstAccumulator(n, memory=memory)
    kept: list[tuple[Burst, float]] = []
    for i in range(n * total):
        level = 3 * (i // n)
        image = frozen(np.full(SMALL, level, np.uint8))
        burst = accumulator.add(Frame(image, i, i / 50, "device", 0, 8, i / 50))
        if burst is not None:
            kept = [*kept, (burst, float(level))][-held:]
            assert all((b.mean == level).all() for b, level in kept)
    return kept


def test_a_picture_stays_as_it_is_for_as_long_as_anybody_has_it() -> None:
    for n in (1, 2, 9):
        kept = bursts_of(PictureMemory(), n, held=5, total=40)
        assert [level for _, level in kept] == [105, 108, 111, 114, 117]


def test_memory_is_used_again() -> None:
    memory = PictureMemory()
    first = memory.take(SMALL, np.float32)
    place = first.ctypes.data
    assert memory.take(SMALL, np.float32).ctypes.data != place  # somebody has it
    first.flags.writeable = False
    del first
    again = memory.take(SMALL, np.float32)
    assert again.ctypes.data == place and again.flags.writeable
    del again
    assert memory.take(SMALL, np.uint32).ctypes.data != place
    assert memory.take((7, 6), np.float32).ctypes.data != place


def test_a_view_alone_keeps_its_memory() -> None:
    memory = PictureMemory()
    part = memory.take(SMALL, np.float32)[2:, 1:].T
    raw = memoryview(memory.take(SMALL, np.float32))
    part[:] = 1
    assert {memory.take(SMALL, np.float32).ctypes.data for _ in range(3)}.isdisjoint(
        {part.base.ctypes.data, np.asarray(raw).ctypes.data}
    )


def test_what_was_prepared_is_enough() -> None:
    memory = PictureMemory()
    memory.prepare(4, SMALL, np.float32)
    memory.prepare(4, SMALL, np.bool_)
    ready = {id(array) for array in memory._arrays}
    bursts_of(memory, 2, held=3, total=30)
    assert {id(array) for array in memory._arrays} == ready
