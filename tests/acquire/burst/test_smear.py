from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.burst.accumulate import burst_of
from acquire.burst.smear import motion_between_frames
from acquire.frame import Frame, frozen


def waves(
    u: float = 0.0, v: float = 0.0, strain: float = 0.0, noise: float = 0.0, seed: int = 0
) -> NDArray[Any]:
    """A smooth pattern that has moved by (u, v) and been stretched along y about the middle."""
    y, x = np.mgrid[:180, :200].astype(float)
    x, y = x - u, (y - v - 90) / (1 + strain)
    level = np.sin(0.61 * x + 0.23 * y) + np.cos(0.52 * y - 0.31 * x) + np.sin(0.37 * x - 0.44 * y + 1)
    image = 2000 + 500 * level + np.random.default_rng(seed).normal(0, noise, level.shape)
    return np.rint(image).astype(np.uint16)


def frame(image: NDArray[Any], index: int) -> Frame:
    return Frame(frozen(image), index, index / 10, "device", 0, 12, index / 10)


@pytest.mark.parametrize(("u", "v"), [(0.05, 0.0), (0.0, -0.05), (0.03, 0.04), (0.2, 0.1), (-0.5, 0.0)])
def test_a_known_motion_is_told_well_enough(u: float, v: float) -> None:
    motion = motion_between_frames(waves(), waves(u, v), 0.3)
    assert motion == pytest.approx(math.hypot(u, v), rel=0.15)


def test_stretching_shows_although_the_middle_stands_still() -> None:
    # 45 px from the middle on the average of a tile, at 1e-3
    assert motion_between_frames(waves(), waves(strain=1e-3), 0.3) == pytest.approx(0.045, rel=0.15)


def test_noise_alone_is_not_taken_for_motion() -> None:
    seen = [
        motion_between_frames(waves(noise=40, seed=k), waves(noise=40, seed=k + 100), 40) for k in range(20)
    ]
    assert max(seen) < 0.03


def test_a_large_motion_is_never_taken_for_none() -> None:
    assert motion_between_frames(waves(), waves(u=1.5), 0.3) > 0.3


@pytest.mark.parametrize(
    "image", [np.full((50, 60), 9, np.uint8), np.tile(np.arange(60, dtype=np.uint8), (50, 1))]
)
def test_without_contrast_in_both_directions_nothing_is_known(image: NDArray[Any]) -> None:
    assert math.isnan(motion_between_frames(image, image, 1.0))


@pytest.mark.parametrize("shape", [(1, 1), (2, 9), (3, 3)])
def test_tiny_pictures_tell_nothing(shape: tuple[int, int]) -> None:
    image = np.zeros(shape, np.uint8)
    assert math.isnan(motion_between_frames(image, image, 1.0))


def test_a_burst_tells_its_motion_over_the_whole_of_its_frames() -> None:
    burst = burst_of([frame(waves(u=0.02 * k), k) for k in range(4)])
    assert burst.motion_px == pytest.approx(0.08, rel=0.15)
    assert math.isnan(burst_of([frame(waves(), 0)]).motion_px)
