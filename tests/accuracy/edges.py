"""Edges in place of a pattern: a black box on even grey, still and moved."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, ZoiGrid
from analysis.kernel.prepared import PatternError

Array = NDArray[np.float64]

SHAPE = (320, 320)
NOISES_GL, BLURS_PX, MOTIONS_PX = (0.0, 0.5, 1.0, 2.0), (0.0, 0.5, 1.0, 3.0), (0.0, 3.3)


def box(motion: float, blur: float) -> Array:
    """A box of 140 px with 10 GL on 200 GL, moved by ``motion`` px along x and half as much along y."""
    y, x = np.indices(SHAPE).astype(float)
    level = 200 - 190 * _between(x, 80 + motion, 220 + motion) * _between(
        y, 100 + motion / 2, 240 + motion / 2
    )
    return np.asarray(cv2.GaussianBlur(level, (0, 0), blur) if blur else level, float)


def _between(x: Array, first: float, last: float) -> Array:
    """The share of each pixel that lies between."""
    return np.asarray(np.clip(x - first + 0.5, 0, 1) * np.clip(last - x + 0.5, 0, 1))


def valid_on_box(grid: ZoiGrid, noise: float, blur: float, motion: float, seed: int = 1) -> int:
    """ZOIs that have a value; 8 bits, ``noise`` in GL."""
    rng = np.random.default_rng(seed)
    first, second = (
        np.clip(np.rint(box(m, blur) + rng.normal(0, noise, SHAPE)), 0, 255).astype(np.uint8)
        for m in (0.0, motion)
    )
    try:
        return PhaseKernel(first, grid).measure(second).n_valid
    except PatternError:
        return 0


def on_box(size: int, step: int, noise: float, quick: bool) -> tuple[int, int]:
    """ZOIs asked for, and those that have a value, over blurs and motions."""
    grid = ZoiGrid.cover(Roi(8, 8, SHAPE[1] - 16, SHAPE[0] - 16), size, step)
    cases = [(b, m) for b in (BLURS_PX[:1] if quick else BLURS_PX) for m in MOTIONS_PX]
    return grid.n_active * len(cases), sum(valid_on_box(grid, noise, *case) for case in cases)
