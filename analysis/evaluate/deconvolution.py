"""An option for showing maps: remove the blur of the ZOI's window, at the price of noise.

Never applied to stored data; a map shown so must be labelled. An affine measurement under a Gaussian
window passes a sine with the transform W of that window, displacement and gradients alike. Blurring
a map again passes W once more, so sums of repeated blurs make any polynomial of W; this module makes

    T(W) = W^a sum_{j=0}^{n} C(a-1+j, j) (1-W)^j,        a = ``PASSES``, n = steps,

the one of its degree that is flattest both where W = 1 (long waves come back whole) and where W = 0
(noise of short waves stays out): J. F. Kaiser and R. W. Hamming, "Sharpening the response of a symmetric
nonrecursive filter by multiple use of the same filter", IEEE Trans. ASSP 25 (1977) 415-422. With a = 1 it
is Van Cittert's iteration (doi:10.1007/BF01391351), which lets more noise through for the same resolution.

Each further sharpening applies their 3 T^2 - 2 T^3 to the whole response. It ends more abruptly, which lets
less noise through for the same resolution, rings longer beside an edge, and triples the work. A polynomial of
as high a degree in one piece would grow without bound beside gaps; this one takes what is not exactly 0 or 1 back.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import ZoiGrid, profile

Floats = NDArray[np.float64]

PASSES = 4
"""Order of the zero of the response where the window passes nothing: the more, the sharper its end."""

_RIDGE = 1e-9  # of the slopes of a plane that its points do not determine
_LOST = 0.1  # what a sine has lost at the period called l_10%


@dataclass(frozen=True, slots=True)
class Effect:
    """What ``deconvolved`` does to a map of a grid, by theory.

    Attributes
    ----------
    l10 : float, px
        Period of a sine along x or y that has lost 10 %, the blur of the measurement included.
    noise : float
        Standard deviation of a displacement over that of the map as measured, white noise in the picture.
    noise_gradient : float
        The same of a gradient.
    """

    l10: float
    noise: float
    noise_gradient: float


def deconvolved(values: Floats, grid: ZoiGrid, steps: int = 7, sharpened: int = 0) -> Floats:
    """A map of an affine measurement under the Gaussian window, with the window's blur removed.

    Linear in the values. Constant and linear maps come back as they were, at borders and beside gaps
    too: where values are missing, a blur is the value of the plane fitted with the same weights. An edge
    overshoots by 6 % of its height (3 steps), 7 % (7 steps), 9 % at most, as under any flat response.

    Parameters
    ----------
    values : (R, C)
        Displacement (px) or gradients of a ``StrainField`` of order 1, estimator "spectral", window
        "gaussian"; NaN where there is none, and stays so.
    grid : ZoiGrid
        Its step should be at most a sixth of its size, or the window is sampled too coarsely.
    steps : int
        More resolve finer and are noisier (``effect``); 0 gives the map back.
    sharpened : int
        How often the response is sharpened: the same resolution with less noise, and longer ringing.

    Returns
    -------
    (R, C) float64

    Raises
    ------
    ValueError
        Another shape than the grid, a negative number, or a grid too coarse for its ZOIs.
    """
    if values.shape != grid.shape:
        raise ValueError(f"the map has the shape {values.shape}, the grid of ZOIs {grid.shape}")
    _check(grid, steps, sharpened)
    known = np.isfinite(values)
    measured = np.where(known, values, 0.0)
    if steps:
        blur = _Blur(known, _sampled(grid))
        measured = _unblurred(blur, measured, steps)
        for times in range(sharpened):
            measured = _sharpened(blur, measured, steps, times)
    return np.where(known, measured, np.nan)


def response(periods: ArrayLike, grid: ZoiGrid, steps: int = 7, sharpened: int = 0) -> Floats:
    """Share of a sine along x or y that is left, the blur of the measurement included.

    Parameters
    ----------
    periods : (N,), px
    grid, steps, sharpened : as for ``deconvolved``

    Returns
    -------
    (N,) float64

    Raises
    ------
    ValueError
        As ``deconvolved``.
    """
    _check(grid, steps, sharpened)
    k = 2 * pi / np.atleast_1d(np.asarray(periods, np.float64))
    return _passed(k, grid) * _gain(_repeated(k, grid), steps, sharpened)


def effect(grid: ZoiGrid, steps: int = 7, sharpened: int = 0) -> Effect:
    """The resolution and the noise of a deconvolved map; raises ValueError as ``deconvolved``."""
    periods = np.geomspace(0.2, 30, 4000) * grid.size
    kept = response(periods, grid, steps, sharpened)
    last = int(np.flatnonzero(kept < 1 - _LOST)[-1])
    l10 = float(np.interp(1 - _LOST, kept[last : last + 2], periods[last : last + 2]))
    # Of white noise, a displacement passes the window and a gradient its first moment.
    k = np.linspace(0, min(pi, 60 / grid.size), 241)
    across, again = _passed(k, grid) ** 2, _repeated(k, grid)
    gain = _gain(np.outer(again, again), steps, sharpened) ** 2
    inside = np.r_[0.5, np.ones(len(k) - 2), 0.5]

    def noise(along: Floats) -> float:
        a, b = along * inside, across * inside
        return sqrt(float(a @ gain @ b) / float(a.sum() * b.sum()))

    return Effect(l10, noise(across), noise(_passed(k, grid, moment=1) ** 2))


def _check(grid: ZoiGrid, steps: int, sharpened: int) -> None:
    if steps < 0 or sharpened < 0:
        raise ValueError(
            f"the numbers of steps and of sharpenings must not be negative, got {min(steps, sharpened)}"
        )
    if 6 * grid.step > grid.size:
        raise ValueError(
            f"ZOIs of {grid.size} px at a step of {grid.step} px are too far apart to be deconvolved; "
            f"take a step of at most {grid.size // 6} px"
        )


def _coefficient(j: int) -> float:
    return float(comb(PASSES - 1 + j, j))


def _unblurred(blur: _Blur, values: Floats, steps: int) -> Floats:
    """T(W)/W of the module's head, applied to a map."""
    for _ in range(PASSES - 1):
        values = blur(values)
    out = _coefficient(steps) * values
    for j in range(steps - 1, -1, -1):
        out = _coefficient(j) * values + out - blur(out)
    return out


def _filtered(blur: _Blur, values: Floats, steps: int, sharpened: int) -> Floats:
    """The whole response T(W), sharpened so often, applied to a map."""
    if not sharpened:
        return _unblurred(blur, blur(values), steps)
    once = _filtered(blur, values, steps, sharpened - 1)
    return _sharpened(blur, once, steps, sharpened - 1)


def _sharpened(blur: _Blur, once: Floats, steps: int, sharpened: int) -> Floats:
    """3 T^2 - 2 T^3 in place of T, of a map that T has been applied to ``once``; T is sharpened so often."""
    twice = _filtered(blur, once, steps, sharpened)
    return 3 * twice - 2 * _filtered(blur, twice, steps, sharpened)


def _gain(blurred: Floats, steps: int, sharpened: int = 0) -> Floats:
    """T(W)/W, what is done to a wave of which one blur leaves the share ``blurred``."""
    if not steps:
        return np.ones_like(blurred)
    total = sum(_coefficient(j) * (1 - blurred) ** j for j in range(steps + 1))
    gain = np.asarray(blurred ** (PASSES - 1) * total)
    for _ in range(sharpened):
        kept = gain * blurred
        gain = gain * (3 * kept - 2 * kept**2)
    return gain


def _passed(k: Floats, grid: ZoiGrid, moment: int = 0) -> Floats:
    """Transform of one line of the window, (N,) at k rad/px; of its moment 1: the sine transform."""
    line = profile("gaussian", grid.size)
    x = np.arange(grid.size) - (grid.size - 1) / 2
    wave = np.sin if moment else np.cos
    return np.asarray(wave(np.outer(k, x)) @ (x**moment * line) / line.sum())


def _repeated(k: Floats, grid: ZoiGrid) -> Floats:
    """The same of the window as the map samples it."""
    line = _sampled(grid)
    x = grid.step * (np.arange(len(line)) - (len(line) - 1) / 2)
    return np.asarray(np.cos(np.outer(k, x)) @ line)


def _sampled(grid: ZoiGrid) -> Floats:
    """One line of the window at the spacing of the ZOIs, centred on one of them, sum 1."""
    pixels = profile("gaussian", grid.size)
    x = np.arange(grid.size) - (grid.size - 1) / 2
    reach = int((grid.size - 1) / 2 // grid.step)
    line = np.interp(np.arange(-reach, reach + 1) * grid.step, x, pixels)
    return np.asarray(line / line.sum())


class _Blur:
    """Convolution with a window; where values are missing, the local plane fitted with its weights.

    A fit at one of its own points, of the largest weight, never amplifies noise.
    """

    def __init__(self, known: NDArray[np.bool_], line: Floats) -> None:
        t = np.arange(len(line)) - (len(line) - 1) / 2
        t /= np.sqrt(line @ t**2)
        self._known = known
        self._lines = (line, line * t, line * t**2)
        there = known.astype(np.float64)
        orders = ((0, 0), (0, 1), (1, 0))
        normal = np.zeros((*known.shape, 3, 3))
        for i, (a, b) in enumerate(orders):
            for j, (c, d) in enumerate(orders):
                normal[..., i, j] = self._sum(there, a + c, b + d)
        normal += np.diag([0.0, _RIDGE, _RIDGE])
        normal[~known] = np.eye(3)
        self._shares = np.linalg.solve(normal, np.array([[1.0], [0.0], [0.0]]))[..., 0]

    def __call__(self, values: Floats) -> Floats:
        """``values`` (R, C) with 0 where unknown; so is the result."""
        mean, along_x, along_y = np.moveaxis(self._shares, -1, 0)
        total = mean * self._sum(values, 0, 0)
        total += along_x * self._sum(values, 0, 1) + along_y * self._sum(values, 1, 0)
        return np.where(self._known, total, 0.0)

    def _sum(self, values: Floats, down: int, along: int) -> Floats:
        """Sum over the window of the values times powers of the distance in y and in x."""
        from scipy.ndimage import correlate1d

        first = correlate1d(values, self._lines[down], axis=0, mode="constant")
        return np.asarray(correlate1d(first, self._lines[along], axis=1, mode="constant"))
