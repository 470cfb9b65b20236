"""What white noise leaves in the shapes of third degree, exactly: what their common ratio is measured against.

The shapes are no columns of J, but not orthogonal to them either: the fit takes a part of them, which depends on the
pattern (``shapes.bent``). They look at somewhat higher frequencies than u and v do, and u and v at others than the
gradients: where an error is not white, ``responses`` gives the difference.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.pool import each
from analysis.field import Status
from analysis.fit.kernel_args import NUISANCES
from analysis.kernel.prepared import PreparedReference

Floats = NDArray[np.float64]

SAMPLE = 50
"""ZOIs whose answer to white noise is computed."""
FEW = 20
"""ZOIs whose answers to each frequency are averaged."""
BATCH_PX = 8 * 32**2  # of ZOIs computed together: more do not fit into a processor's cache


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
    some = max(1, BATCH_PX // size**2)
    parts = (sample[k : k + some] for k in range(0, len(sample), some))
    found = [*each(lambda which: _of_zois(ready, which, size, order), parts)]
    return np.asarray(np.median(np.concatenate(found) / unit[sample], axis=0))


def _of_zois(ready: PreparedReference, zois: NDArray[np.intp], size: int, order: int) -> Floats:
    """The same of S ZOIs, of u and of v, (S, 2), px^2 per GL^2."""
    cubic = _weights(ready, zois, size, order)[2] / (ready.weight * ready.energy[zois, :2])[:, :, None, None]
    variances = np.asarray(np.linalg.eigvalsh(cubic @ cubic.swapaxes(-1, -2)), np.float64)
    return _median_of_squares(variances)


def responses(ready: PreparedReference, size: int, order: int) -> Floats:
    """How much an error of each frequency counts: in u and its gradients, v and its, the shapes of u and those of v.

    Shares of the variance that white noise makes, (8, n, n // 2 + 1), frequencies as ``scipy.fft.rfft2`` gives them.
    """
    from scipy.fft import rfft2

    able = np.flatnonzero(ready.status == Status.OK)
    out = np.zeros((8, size, size // 2 + 1))
    half = (ready.inverse.shape[1] - NUISANCES) // 2
    for z in able[:: max(1, len(able) // FEW)]:
        modes, inverse, cubic = _weights(ready, np.array([z]), size, order)
        affine = inverse[0][[0, 1, 2, half, half + 1, half + 2]] @ modes[0]
        weights = np.concatenate([affine, *cubic[0]]).reshape(-1, size, size)
        power = np.abs(rfft2(weights / np.sqrt(np.sum(weights**2, axis=(1, 2), keepdims=True)))) ** 2
        out += np.concatenate([power[:6], power[6:].reshape(2, 4, size, -1).mean(axis=1)])
    out *= halves(size)
    return np.asarray(out / np.maximum(out.sum(axis=(1, 2), keepdims=True), 1e-30))


def halves(size: int) -> Floats:
    """How often each column of the half of a spectrum stands in the whole, (n // 2 + 1,)."""
    columns = np.arange(size // 2 + 1)
    return np.where((columns == 0) | (2 * columns == size), 1.0, 2.0)


def _weights(
    ready: PreparedReference, zois: NDArray[np.intp], size: int, order: int
) -> tuple[Floats, Floats, Floats]:
    """Of S ZOIs the columns of J and the inverse of J^T J, (S, P, n n) and (S, P, P), and the weights of their pixels
    in the cubic shapes of u and of v, (S, 2, 4, n n).
    """
    from analysis.fit.sensitivity import columns

    channels = _channels(ready, ready.origins[zois], size)
    line, xi = ready.shapes.rows[0, :size], (np.arange(size) - (size - 1) / 2) / (size / 2)
    window, powers = np.outer(line, line), xi ** np.arange(4)[:, None]
    which, along_x, along_y = np.transpose(columns(order))
    bases = powers[along_y][:, :, None] * powers[along_x][:, None, :] * window
    modes = (channels[:, which] * bases).reshape(len(zois), len(which), -1)
    inverse = ready.inverse[zois].astype(np.float64)
    degrees = ready.shapes.mix @ powers
    cubic = np.stack([np.outer(degrees[j], degrees[3 - j]) for j in range(4)])
    shapes = (channels[:, :2, None] * cubic).reshape(len(zois), 8, -1)
    left = shapes * window.ravel() - (shapes @ modes.swapaxes(1, 2) @ inverse) @ modes
    return modes, inverse, left.reshape(len(zois), 2, 4, -1)


def _channels(ready: PreparedReference, origins: NDArray[np.int64], size: int) -> Floats:
    """f_x, f_y, f, 1, f_xx, f_yy and f_xy of S ZOIs (``sensitivity.columns``), (S, 7, n, n)."""
    rows, columns = (
        np.clip(at[:, None] + np.arange(-1, size + 1), 0, end - 1)
        for at, end in zip(origins.T, ready.shape, strict=True)
    )
    fx, fy, f = ready.images[:3, rows[:, :, None], columns[:, None, :]].astype(np.float64)
    inner = (slice(None), slice(1, -1), slice(1, -1))
    along_x, along_y = np.diff(f, n=2, axis=2)[:, 1:-1], np.diff(f, n=2, axis=1)[:, :, 1:-1]
    across = (f[:, 2:, 2:] + f[:, :-2, :-2] - f[:, 2:, :-2] - f[:, :-2, 2:]) / 4
    ones = np.ones_like(along_x)
    return np.stack([fx[inner], fy[inner], f[inner], ones, along_x, along_y, across], axis=1)


def _median_of_squares(variances: Floats) -> Floats:
    """Medians of sums of squares of normal values, over the last axis of their variances.

    Of chi^2 with the same mean and variance (Wilson-Hilferty).
    """
    total = variances.sum(axis=-1)
    freedom = total**2 / np.sum(variances**2, axis=-1)
    return np.asarray(total * (1 - 2 / (9 * freedom)) ** 3)
