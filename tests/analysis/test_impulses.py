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
