"""Bursts that wait as exact sums: the same bits as an averaged burst, in the memory that is stated."""

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
    [(2, 8, 2), (257, 8, 2), (258, 8, 4), (16, 12, 2), (17, 12, 4), (2, 16, 4)],
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


@pytest.mark.parametrize(
    ("bits", "n", "itemsize"), [(1, 65535, 2), (1, 65536, 4), (16, 1, 2), (15, 2, 2), (15, 3, 4)]
)
def test_a_sum_takes_two_bytes_up_to_65535(bits: int, n: int, itemsize: int) -> None:
    assert sum_kind(bits, n).itemsize == itemsize
