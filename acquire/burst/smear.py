"""How far the picture moved while a burst was taken.

Averaging frames of a moving picture smears it: contrast at wave number k falls by
|sinc(k v T / 2)|. The motion is estimated from the first and the last frame of the burst by the
optical flow of a few large tiles (Lucas and Kanade, 1981): crude beside the measuring kernel, but
cheap enough for every burst. Pure; reads no clock.
"""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

LIMIT_PX = 0.05  # above it a burst is smeared
TILE_PIXELS = 4096  # looked at in each tile at least, so that noise gives less than about 0.01 px
MOST_TILES = 4
ROW_STEP = 4


def motion_between_frames(first: NDArray[Any], last: NDArray[Any], noise: float) -> float:
    """Largest motion of any part of the picture between two frames, px.

    Parameters
    ----------
    first, last : (H, W) uint8 | uint16, GL
    noise : float, GL
        Standard deviation of one frame.

    Returns
    -------
    float, px
        Reliable below about one pixel, and large above it; NaN where there is nothing to see.
    """
    from acquire.burst.smear_loops import tile_sums

    rows, columns, step = _tiles(*first.shape)
    sums = tile_sums(first, last, rows, columns, step)
    motions = [_solve(*tile, noise=noise) for tile in sums.reshape(-1, 6).tolist()]
    seen = [motion for motion in motions if not math.isnan(motion)]
    return max(seen, default=math.nan)


def _tiles(height: int, width: int) -> tuple[int, int, int]:
    step = ROW_STEP if height * width >= 2**18 else 1
    across = min(MOST_TILES, max(1, math.isqrt(height * width // (step * TILE_PIXELS))))
    return across, across, step


def _solve(xx: float, xy: float, yy: float, xd: float, yd: float, n: float, *, noise: float) -> float:
    """Displacement of one tile from its normal equations; NaN without contrast in both directions."""
    # What noise adds to the squares of a gradient of the mean of two frames.
    noise_square = n * noise**2 / 4
    xx, yy = xx - noise_square, yy - noise_square
    middle, half = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    if n == 0 or middle - half <= max(noise_square, 0.01 * n):
        return math.nan
    determinant = xx * yy - xy * xy
    u, v = (yy * xd - xy * yd) / determinant, (xx * yd - xy * xd) / determinant
    # Without what noise alone would show; the variance of a difference is twice that of a frame.
    return math.sqrt(max(0.0, u * u + v * v - 2 * noise**2 * (xx + yy) / determinant))
