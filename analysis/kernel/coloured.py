"""An error of the picture that is not noise as stated: what made it, and what it adds to the fits on average.

The cause shows in what is left of some ZOIs. Measured on twenty ways to spoil a real picture
(``tests/accuracy/degraded.py``): blocks 1.9 to 2.9 where a codec was, else 0.98 to 1.06; correlation of neighbours up
to 0.05 for noise, else 0.15 and more.

What white noise of the strength stated in the reference adds is taken off in the fit (``noise_bias``). Of what
compression or a filter leaves, neighbouring pixels are alike, and so the spectrum of what the fits leave takes the
place of the noise: half of it is the reference's where both pictures were spoilt alike. Without it, JPEG at quality 50
makes mean strains of 700 um/m too much, and a blur of 0.6 px, where there is none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field.picture_error import Cause
from analysis.kernel.lines import inner, left_by_fit, lines_along, some
from analysis.kernel.prepared import PreparedReference
from analysis.kernel.solve import Solution
from analysis.picture.blocks import BLOCKS, blockiness

Floats = NDArray[np.float64]

BLUR, SOME_BLUR, NEIGHBOURS = 0.25, 0.1, 0.12
"""Limits: growth of the variance of the blur that is the cause of an error, and that acts on u and v, px^2;
correlation of neighbouring pixels."""
SAMPLE, SPECTRA = 30, 300
"""ZOIs that are looked at, and whose spectra are averaged."""
BOTH_ALIKE = ("compression", "filter")
"""Causes that spoil the reference as much as the picture."""


def error_cause(solution: Solution, ok: NDArray[np.bool_]) -> Cause:
    """What the error of the deformed picture looks like; ``ok`` (A,) are the ZOIs that have a value."""
    if blockiness(solution.image) > BLOCKS:
        return "compression"
    which = some(ok, SAMPLE)
    left = left_by_fit(solution, which)
    if lines_along(left) is not None:
        return "bands"
    if abs(float(np.median(solution.found.nuisance[ok, 2]))) > BLUR:
        return "blur"
    within = inner(left)
    beside = (np.mean(within[:, 1:] * within[:, :-1]) + np.mean(within[:, :, 1:] * within[:, :, :-1])) / 2
    return "noise" if abs(beside) < NEIGHBOURS * np.mean(within**2) else "filter"


def coloured_bias(
    solution: Solution, ok: NDArray[np.bool_], cause: Cause, share: float
) -> tuple[Floats, Floats]:
    """What to add to the parameters (A, modes) and to the growth of the variance of the blur (A,), px^2.

    Parameters
    ----------
    solution : Solution
    ok : (A,) bool
    cause : str
        Of the error.
    share : float
        Of the error of both pictures that is the reference's, as stated.
    """
    from analysis.fit.sensitivity import parameter_scale

    reference, ready, found = solution.reference, solution.reference.prepared, solution.found
    modes = reference.modes
    which = some(ok, SPECTRA)
    own = _own_error(ready, left_by_fit(solution, which), which)
    own *= 0.5 if cause in BOTH_ALIKE else share
    more = ready.weight * (own - solution.noise_taken[:, None] * ready.pattern.own_noise)
    inverse = ready.inverse[:-1, :, [modes, -3, -2]]  # with the columns f, f_xx and f_yy
    step = np.einsum("apk,ak->ap", inverse, more) / found.nuisance[:, :1]
    moved = -parameter_scale(reference.settings.order, reference.grid.size) * step[:, :modes]
    return moved, step[:, -3] + step[:, -2]


def _own_error(ready: PreparedReference, left: Floats, which: NDArray[np.intp]) -> Floats:
    """What the error of a pixel, times f, f_xx and f_yy of its own part in them, is on average, (3,), GL^2.

    The filter that makes f shows in the cross spectrum of f and the reference as it was recorded.
    """
    size = left.shape[1]
    window = np.outer(np.hanning(size + 2)[1:-1], np.hanning(size + 2)[1:-1])
    places = [np.s_[top : top + size, column : column + size] for top, column in ready.origins[which]]
    level, raw = (_spectra(np.stack([ready.images[k][at] for at in places]), window) for k in (2, 3))
    response = np.mean((level * raw.conj()).real, axis=0) / np.mean(np.abs(raw) ** 2, axis=0)
    power = np.mean(np.abs(_spectra(left, window)) ** 2, axis=0) / np.sum(window**2)
    bend = 2 * np.cos(2 * np.pi * np.fft.fftfreq(size)) - 2
    return np.array([np.mean(power * response * b) for b in (np.ones(1), bend[None, :], bend[:, None])])


def _spectra(zois: NDArray[np.floating], window: Floats) -> NDArray[np.complex128]:
    """Of ZOIs (N, n, n) without their means, under a window."""
    return np.asarray(np.fft.fft2((zois - zois.mean(axis=(1, 2), keepdims=True)) * window))
