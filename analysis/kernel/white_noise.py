"""What white noise leaves in the shapes of third degree, exactly: what their common ratio is measured against.

The shapes are no columns of J, but not orthogonal to them either: the fit takes a part of them, which depends on the
pattern (``shapes.bent``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from analysis.kernel.prepared import PreparedReference

Floats = NDArray[np.float64]

SAMPLE = 50
"""ZOIs whose answer to white noise is computed."""


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
    from analysis.fit.sensitivity import columns

    zoi = _channels(ready, ready.origins[z], size)
    line, xi = ready.shapes.rows[0, :size], (np.arange(size) - (size - 1) / 2) / (size / 2)
    window = np.outer(line, line).ravel()
    modes = np.stack([(zoi[k] * np.outer(xi**py, xi**px)).ravel() for k, px, py in columns(order)]) * window
    degrees = ready.shapes.mix @ xi ** np.arange(4)[:, None]
    cubic = [np.outer(degrees[j], degrees[3 - j]) for j in range(4)]
    out = np.empty(2)
    for k in (0, 1):
        shapes = np.stack([(zoi[k] * shape).ravel() for shape in cubic])
        taken = shapes @ modes.T @ ready.inverse[z].astype(np.float64) @ modes
        weights = (shapes * window - taken) / (ready.weight * ready.energy[z, k])
        out[k] = _median_of_squares(np.linalg.eigvalsh(weights @ weights.T))
    return out


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
