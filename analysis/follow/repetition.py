"""Displacements at which a picture may look like itself: the side peaks of its autocorrelation, in tiles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi

Floats = NDArray[np.float64]
Image = NDArray[np.float32]

TILE = 160
"""Side of a tile, px: what repeats in a part of a picture is seen in its tiles."""
REACH = 0.4
"""Longest displacement, in sides of a tile: beyond it too little of the tile overlaps."""
SHORTEST_PX = 3.0
PEAK = 0.5
"""Least autocorrelation, of that without displacement."""
MAX_PEAKS = 4
"""The nearest ones of a tile; longer ones are sums of them."""
NEAR = 0.6
"""Sides of a tile from its centre within which a ZOI may repeat with it."""


def side_peaks(
    image: Image, region: Roi, x: Floats, y: Floats
) -> Iterator[tuple[tuple[int, int], NDArray[np.bool_]]]:
    """Displacements (x, y) at which tiles of a region look like themselves, px, each with the points near such tiles.

    Parameters
    ----------
    image : (H, W) float32, GL
        Without noise (``Pattern.level``).
    region : Roi
    x, y : (A,), px

    Yields
    ------
    (int, int), (A,) bool
        One of each pair of opposite displacements.
    """
    near: dict[tuple[int, int], NDArray[np.bool_]] = {}
    side = min(TILE, region.width, region.height)
    middle = (side - 1) / 2
    for top in _firsts(region.y, region.height, side):
        for left in _firsts(region.x, region.width, side):
            peaks = _peaks(image[top : top + side, left : left + side])
            if not peaks:
                continue
            around = np.maximum(abs(x - left - middle), abs(y - top - middle)) <= NEAR * side
            for peak in peaks:
                known = next((p for p in near if math.dist(p, peak) < 2), peak)
                near[known] = near.get(known, False) | around
    yield from near.items()


def _firsts(first: int, length: int, side: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(first, first + length - side, math.ceil(length / side)).astype(np.intp))


class _Tile(NamedTuple):
    """What is the same for all tiles of one side.

    Attributes
    ----------
    window : (side, side) float32
        That of Hann.
    weight : float32
        Its sum.
    overlap : (reach + 1, 2 reach + 1) float32
        Its autocorrelation, down from 0 and across from -reach.
    far : the same of bool
        Displacements that are looked at: one of each pair of opposite ones, of ``SHORTEST_PX`` at least.
    """

    window: Image
    weight: np.float32
    overlap: Image
    far: NDArray[np.bool_]


@lru_cache(maxsize=1)
def _tile(side: int) -> _Tile:
    line = np.hanning(side + 2)[1:-1].astype(np.float32)
    window = np.outer(line, line)
    reach = int(REACH * side)
    down, across = np.meshgrid(np.arange(reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    far = (np.hypot(down, across) >= SHORTEST_PX) & ((down > 0) | (across > 0))
    return _Tile(window, window.sum(), _correlation(window), far)


def _correlation(tile: Image) -> Image:
    """Of a tile with itself, (reach + 1, 2 reach + 1): down from 0 and across from -reach."""
    from scipy.fft import ifft, irfft, rfft2

    side = len(tile)
    reach = int(REACH * side)
    power = (np.abs(rfft2(tile)) ** 2).astype(np.complex64)
    down = ifft(power, axis=0, norm="forward", overwrite_x=True)[: reach + 1]
    product = irfft(down, n=side, norm="forward") * np.float32(1 / np.longdouble(side * side))
    return np.concatenate([product[:, side - reach :], product[:, : reach + 1]], axis=1)


def _peaks(image: Image) -> list[tuple[int, int]]:
    """The nearest side peaks (x, y) of the autocorrelation of a tile under a Hann window, over that of the window."""
    from scipy.ndimage import maximum_filter

    of = _tile(len(image))
    level = (image - np.multiply(image, of.window).sum() / of.weight) * of.window
    share = _correlation(level) / of.overlap
    reach = len(share) - 1
    share /= max(float(share[0, reach]), 1e-12)
    found = (share > PEAK) & of.far
    if not found.any():  # most patterns do not repeat
        return []
    y, x = np.nonzero(found & (share >= maximum_filter(share, 3)))
    return sorted(zip((x - reach).tolist(), y.tolist(), strict=True), key=lambda p: math.hypot(*p))[
        :MAX_PEAKS
    ]
