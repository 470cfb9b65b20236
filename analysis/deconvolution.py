"""An option for showing maps: undo part of the blur of the ZOI's window, at the price of noise.

Never applied to stored data; whoever shows such a map says so. Van Cittert's iteration (P. H. van
Cittert, Z. Phys. 69 (1931) 298-308, doi:10.1007/BF01391351): m <- m + (m_0 - w * m), where w is the window of
the ZOI, which is the transfer function of an affine fit for displacement and gradients alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.windows import Window, profile
from analysis.zoi_grid import ZoiGrid

Floats = NDArray[np.float64]


def deconvolved(values: Floats, grid: ZoiGrid, steps: int = 3, window: Window = "gaussian") -> Floats:
    """A map of an affine measurement with part of its window's blur taken off.

    Parameters
    ----------
    values : (R, C)
        Any value of a ``StrainField`` of order 1; NaN where there is none, and stays so.
    grid : ZoiGrid
        Its step should be at most a sixth of its size, or the window is sampled too coarsely.
    steps : int
        Of the iteration: more resolve finer and are noisier; 0 gives the map back.
    window : str
        The least-squares weight the map was measured with.

    Returns
    -------
    (R, C) float64

    Raises
    ------
    ValueError
        Another shape than the grid, negative ``steps``, or a grid too coarse for its ZOIs.
    """
    if values.shape != grid.shape:
        raise ValueError(f"the map has the shape {values.shape}, the grid of ZOIs {grid.shape}")
    if steps < 0:
        raise ValueError(f"the number of steps must not be negative, got {steps}")
    if 6 * grid.step > grid.size:
        raise ValueError(
            f"ZOIs of {grid.size} px at a step of {grid.step} px are too far apart to be deconvolved; "
            f"take a step of at most {grid.size // 6} px"
        )
    known = np.isfinite(values)
    line = _sampled(window, grid)
    measured = np.where(known, values, 0.0)
    out = measured
    for _ in range(steps):
        out = np.where(known, out + measured - _blurred(out, known, line), 0.0)
    return np.where(known, out, np.nan)


def _sampled(window: Window, grid: ZoiGrid) -> Floats:
    """One line of the window at the spacing of the ZOIs, centred on one of them, sum 1."""
    pixels = profile(window, grid.size)
    x = np.arange(grid.size) - (grid.size - 1) / 2
    reach = int((grid.size - 1) / 2 // grid.step)
    line = np.interp(np.arange(-reach, reach + 1) * grid.step, x, pixels)
    return np.asarray(line / line.sum())


def _blurred(values: Floats, known: NDArray[np.bool_], line: Floats) -> Floats:
    """Convolution with the window over the known values, renormalised where some are missing."""
    from scipy.ndimage import convolve1d

    def blur(a: Floats) -> Floats:
        first = convolve1d(a, line, axis=0, mode="constant")
        return np.asarray(convolve1d(first, line, axis=1, mode="constant"))

    return blur(values) / np.maximum(blur(known.astype(np.float64)), 1e-9)
