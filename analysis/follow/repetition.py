"""Displacements at which a picture may look like itself: the side peaks of its autocorrelation, in tiles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

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
    for top in _firsts(region.y, region.height, side):
        for left in _firsts(region.x, region.width, side):
            middle = (side - 1) / 2
            around = np.maximum(abs(x - left - middle), abs(y - top - middle)) <= NEAR * side
            for peak in _peaks(image[top : top + side, left : left + side]):
                known = next((p for p in near if math.dist(p, peak) < 2), peak)
                near[known] = near.get(known, False) | around
    yield from near.items()


def _firsts(first: int, length: int, side: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(first, first + length - side, math.ceil(length / side)).astype(np.intp))


@lru_cache(maxsize=1)
def _window(side: int) -> tuple[Image, Image]:
    """A Hann window, (side, side), and its autocorrelation."""
    from scipy.fft import irfft2, rfft2

    line = np.hanning(side + 2)[1:-1].astype(np.float32)
    window = np.outer(line, line)
    return window, irfft2(np.abs(rfft2(window)) ** 2, window.shape)


def _peaks(tile: Image) -> list[tuple[int, int]]:
    """The nearest side peaks (x, y) of the autocorrelation under a Hann window, over that of the window."""
    from scipy.fft import irfft2, rfft2
    from scipy.ndimage import maximum_filter

    side = len(tile)
    window, overlap = _window(side)
    level = (tile - np.average(tile, weights=window)) * window
    product = irfft2(np.abs(rfft2(level)) ** 2, level.shape)
    reach = int(REACH * side)
    down, across = np.meshgrid(np.arange(reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    share = product[down, across] / overlap[down, across]
    share /= max(float(share[0, reach]), 1e-12)
    found = (share >= maximum_filter(share, 3)) & (share > PEAK) & (np.hypot(down, across) >= SHORTEST_PX)
    found &= (down > 0) | (across > 0)
    places = sorted(
        zip(across[found].tolist(), down[found].tolist(), strict=True), key=lambda p: math.hypot(*p)
    )
    return places[:MAX_PEAKS]
