"""What white noise leaves in the shapes of third degree, exactly: what their common ratio is measured against.

The shapes are no columns of J, but not orthogonal to them either: the fit takes a part of them, which depends on the
pattern (``shapes.bent``). They look at somewhat higher frequencies than u and v do, and u and v at others than the
gradients: where an error is not white, ``responses`` gives the difference.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from analysis.fit.kernel_args import NUISANCES
from analysis.kernel.prepared import PreparedReference

Floats = NDArray[np.float64]

SAMPLE = 50
"""ZOIs whose answer to white noise is computed."""
FEW = 20
"""ZOIs whose answers to each frequency are averaged."""


def white_cubic(ready: PreparedReference, size: int, order: int, unit: Floats) -> Floats:
    """Median over ZOIs of ``OutArgs.cubic`` from white noise, of u and of v, over their variance, (2,).

    Parameters
    ----------
    ready : PreparedReference
        Of A ZOIs.
    size : int, px
        Of a ZOI.
    order : 1 or 2
    unit : (A, 2), px^2 per GL^2
        Variance of u and of v from noise of 1 GL, of a ZOI without anything else to find.
    """
    able = np.flatnonzero(ready.status == Status.OK)
    sample = able[:: max(1, len(able) // SAMPLE)]
    if len(sample) == 0:
        return np.ones(2)
    return np.asarray(np.median([_of_zoi(ready, z, size, order) / unit[z] for z in sample], axis=0))


def _of_zoi(ready: PreparedReference, z: int, size: int, order: int) -> Floats:
    """The same of one ZOI, px^2 per GL^2."""
    cubic = _weights(ready, z, size, order)[1]
    each = [of / (ready.weight * ready.energy[z, k]) for k, of in enumerate(cubic)]
    return np.array([_median_of_squares(np.linalg.eigvalsh(weights @ weights.T)) for weights in each])


def responses(ready: PreparedReference, size: int, order: int) -> Floats:
    """How much an error of each frequency counts: in u and its gradients, v and its, the shapes of u and those of v.

    Shares of the variance that white noise makes, (8, n, n // 2 + 1), frequencies as ``scipy.fft.rfft2`` gives them.
    """
    from scipy.fft import rfft2

    able = np.flatnonzero(ready.status == Status.OK)
    out = np.zeros((8, size, size // 2 + 1))
    for z in able[:: max(1, len(able) // FEW)]:
        affine, cubic = _weights(ready, z, size, order)
        weights = np.concatenate([affine, *cubic]).reshape(-1, size, size)
        power = np.abs(rfft2(weights / np.sqrt(np.sum(weights**2, axis=(1, 2), keepdims=True)))) ** 2
        out += np.concatenate([power[:6], power[6:].reshape(2, 4, size, -1).mean(axis=1)])
    out *= halves(size)
    return np.asarray(out / np.maximum(out.sum(axis=(1, 2), keepdims=True), 1e-30))


def halves(size: int) -> Floats:
    """How often each column of the half of a spectrum stands in the whole, (n // 2 + 1,)."""
    columns = np.arange(size // 2 + 1)
    return np.where((columns == 0) | (2 * columns == size), 1.0, 2.0)


def _weights(ready: PreparedReference, z: int, size: int, order: int) -> tuple[Floats, list[Floats]]:
    """Weights of the pixels in the six affine parameters, (6, n n), and in the cubic shapes of u and of v, (4, n n)."""
    from analysis.fit.sensitivity import columns

    zoi = _channels(ready, ready.origins[z], size)
    line, xi = ready.shapes.rows[0, :size], (np.arange(size) - (size - 1) / 2) / (size / 2)
    window = np.outer(line, line).ravel()
    modes = np.stack([(zoi[k] * np.outer(xi**py, xi**px)).ravel() for k, px, py in columns(order)]) * window
    degrees = ready.shapes.mix @ xi ** np.arange(4)[:, None]
    cubic = [np.outer(degrees[j], degrees[3 - j]) for j in range(4)]
    sensors = ready.inverse[z].astype(np.float64) @ modes
    half = (len(modes) - NUISANCES) // 2
    shapes = [np.stack([(zoi[k] * shape).ravel() for shape in cubic]) for k in (0, 1)]
    return sensors[[0, 1, 2, half, half + 1, half + 2]], [
        of * window - of @ modes.T @ sensors for of in shapes
    ]


def _channels(ready: PreparedReference, origin: NDArray[np.int64], size: int) -> Floats:
    """f_x, f_y, f, 1, f_xx, f_yy and f_xy of one ZOI (``sensitivity.columns``), (7, n, n)."""
    rows, columns = (
        np.clip(at + np.arange(-1, size + 1), 0, end - 1) for at, end in zip(origin, ready.shape, strict=True)
    )
    fx, fy, f = ready.images[:3, rows[:, None], columns].astype(np.float64)
    inner = f[1:-1, 1:-1]
    along_x, along_y = np.diff(f, n=2, axis=1)[1:-1], np.diff(f, n=2, axis=0)[:, 1:-1]
    across = (f[2:, 2:] + f[:-2, :-2] - f[2:, :-2] - f[:-2, 2:]) / 4
    return np.stack([fx[1:-1, 1:-1], fy[1:-1, 1:-1], inner, np.ones_like(inner), along_x, along_y, across])


def _median_of_squares(variances: Floats) -> float:
    """Median of a sum of squares of normal values: of chi^2 with the same mean and variance (Wilson-Hilferty)."""
    freedom = float(variances.sum() ** 2 / np.sum(variances**2))
    return float(variances.sum()) * (1 - 2 / (9 * freedom)) ** 3
