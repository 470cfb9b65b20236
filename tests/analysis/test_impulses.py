"""Wild pixels and the blocks of a codec, by value."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.picture.blocks import BLOCKS, blockiness
from analysis.picture.impulses import without_impulses
from tests.analysis.speckle import picture

RNG = np.random.default_rng(2)


@pytest.mark.parametrize("wild", [0, 4095])
def test_hot_and_dead_pixels_get_the_median_of_their_neighbours(wild: int) -> None:
    image = picture().copy()
    rows, columns = np.meshgrid(np.arange(9, image.shape[0] - 9, 9), np.arange(9, image.shape[1] - 9, 9))
    clean = image.copy()
    image[rows, columns] = wild
    out = without_impulses(image)
    assert out is not None
    changed = np.argwhere(out != image)
    assert len(changed) > 0.9 * rows.size
    for y, x in changed[:40]:
        around = np.delete(clean[y - 1 : y + 2, x - 1 : x + 2].ravel().astype(float), 4)
        assert out[y, x] == np.rint(np.median(around))


def test_one_pixel_in_twelve_is_the_pattern() -> None:
    image = picture().copy()
    image[RNG.random(image.shape) < 1 / 12] = 4095
    assert without_impulses(image) is None


@pytest.mark.parametrize("axis", [0, 1])
def test_blocks_along_either_axis_show(axis: int) -> None:
    """Each block of eight rows, or columns, a little brighter or darker than its neighbours."""
    image = picture().astype(np.float32)
    blocks = np.arange(image.shape[axis]) // 8
    brighter = RNG.normal(0, 100, blocks[-1] + 1)[blocks]
    assert blockiness(image) < BLOCKS
    assert blockiness(image + (brighter[:, None] if axis == 0 else brighter)) > BLOCKS


@pytest.mark.parametrize(("down", "across", "wild"), [(6, 6, True), (4, 7, False)])
def test_up_to_three_pixels_in_a_hundred_are_wild(down: int, across: int, wild: bool) -> None:
    image = np.random.default_rng(3).normal(1000, 5, (200, 240)).round().astype(np.uint16)
    image[3::down, 4::across] = 4095  # 2.8 or 3.6 %
    assert (without_impulses(image) is not None) is wild


def test_two_wild_pixels_that_touch_are_both_mended() -> None:
    image = np.random.default_rng(3).normal(1000, 5, (200, 240)).round().astype(np.uint16)
    image[5::12, 4::12] = image[5::12, 5::12] = 4095
    out = without_impulses(image)
    assert out is not None and out[4:-4, 4:-4].max() < 1100


@pytest.mark.parametrize(("period", "found"), [(8, 1.25), (16, 1.125)])
def test_blockiness_is_that_of_third_differences_at_the_borders_of_blocks(period: int, found: float) -> None:
    """They are 8 GL, up and down, and a quarter more at every border."""
    steps = 8.0 * (-1.0) ** np.arange(61)
    steps[::period] *= 1.25
    line = np.zeros(64)
    line[1:] = np.cumsum(np.concatenate([[0.0], np.cumsum(np.concatenate([[0.0], np.cumsum(steps)]))]))
    image = np.repeat(line[:, None], 40, axis=1).astype(np.float32)
    for one in (image, image.T):
        assert blockiness(one) == pytest.approx(found, rel=1e-3)
    assert 1.25 < BLOCKS < 1.35 and blockiness(image[:31]) == 1.0
