"""A burst judges its own pictures: one that is blank, as of a shutter, a flash or a lost line, falsifies the mean."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acquire.burst import BurstAccumulator
from acquire.burst.memory import PictureMemory
from acquire.burst.summed import SumAccumulator
from acquire.frame import Frame, frozen

SHAPE = (240, 320)
BITS = 12
RNG = np.random.default_rng(1)
PATTERN = 1500 + 400 * RNG.standard_normal(SHAPE).cumsum(1) / np.sqrt(np.arange(1, SHAPE[1] + 1))


def frames(*levels: Any) -> list[Frame]:
    """Pictures of the pattern times ``factor``, or blank at a level."""
    found = []
    for k, (factor, level) in enumerate(levels):
        grey = factor * PATTERN + level + 10 * RNG.standard_normal(SHAPE)
        image = frozen(np.clip(np.rint(grey), 0, 2**BITS - 1).astype(np.uint16))
        found.append(Frame(image, k, k / 10, "host", 0, BITS, k / 10))
    return found


def alike(kind: Any, given: list[Frame]) -> bool:
    made = None
    accumulator = kind(len(given), memory=PictureMemory())
    for frame in given:
        made = accumulator.add(frame)
    assert made is not None
    return bool((made if kind is BurstAccumulator else made.burst(PictureMemory())).alike)


@pytest.mark.parametrize("kind", [BurstAccumulator, SumAccumulator])
@pytest.mark.parametrize("place", [0, 1, 3])
@pytest.mark.parametrize("blank", [(0.0, 0.0), (0.0, 4095.0), (0.0, 1500.0), (0.3, 900.0)])
def test_a_burst_knows_that_one_of_its_pictures_is_blank(
    kind: Any, place: int, blank: tuple[float, float]
) -> None:
    levels = [(1.0, 0.0)] * 4
    levels[place] = blank
    assert not alike(kind, frames(*levels))


@pytest.mark.parametrize("kind", [BurstAccumulator, SumAccumulator])
def test_flicker_and_pictures_without_a_pattern_are_no_blank_pictures(kind: Any) -> None:
    assert alike(kind, frames((1.0, 0.0), (0.7, 0.0), (1.2, 0.0), (1.0, 100.0)))
    assert alike(kind, frames(*[(0.0, 500.0)] * 4)) and alike(kind, frames((1.0, 0.0)))
