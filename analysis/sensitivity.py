"""How a ZOI answers to its modes: the normal matrix, its inverse and the unit covariances.

With the filtered reference f and its gradient, the columns of J are f_x b, f_y b for the
monomials b of the shape function, and the nuisances f, x f, y f, 1, x, y. Everything the iteration
needs is (J' w J)^-1 and the moments J' w d of the difference image d (docs/method.md): the
"sensors" of a ZOI are never stored, only the images they are made of. Coordinates are scaled to
-1..1 over the ZOI. Compiled loops.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from analysis.compiled import helper, inlined, parallel
from analysis.shapes import N_POWERS, cross_moments
from analysis.warp import LANES

f4 = np.float32

# Products of the channels f_x, f_y, f, 1, in the order the moments are kept in.
PRODUCT = np.array([[0, 1, 3, 7], [1, 2, 4, 8], [3, 4, 5, 9], [7, 8, 9, 6]])
N_PRODUCTS = 10
RIDGE = 1e-7
"""Added to the unit diagonal of the scaled normal matrix."""


def columns(order: int) -> NDArray[np.int64]:
    """Columns of J as (channel, power of x, power of y), (P, 3): u modes, v modes, nuisances."""
    powers = [(0, 0), (1, 0), (0, 1)] + ([(2, 0), (1, 1), (0, 2)] if order == 2 else [])
    linear = [(0, 0), (1, 0), (0, 1)]
    table = [(0, *p) for p in powers] + [(1, *p) for p in powers]
    table += [(2, *p) for p in linear] + [(3, *p) for p in linear]
    return np.array(table, np.int64)


def parameter_scale(order: int, size: int) -> NDArray[np.float64]:
    """Units of the parameters for coordinates in px instead of half sizes, (6,) or (12,)."""
    half = size / 2
    one = [1, 1 / half, 1 / half] + ([half**-2] * 3 if order == 2 else [])
    return np.array(one + one)


def power_rows(line: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """line * xi^k for k = 0 .. 2*order, (2 order + 1, size); xi from -1 to 1 over the ZOI."""
    size = len(line)
    xi = (np.arange(size) - (size - 1) / 2) / (size / 2)
    return np.stack([line * xi**k for k in range(2 * order + 1)])


@inlined
def _dot6(a: Any, i: Any, b: Any, j: Any, size: int, w: Any, q: Any, r: int) -> Any:
    """Sums over one row of a b times rows r, r+1, r+2 of w and of q."""
    w0 = f4(0)
    w1 = f4(0)
    w2 = f4(0)
    q0 = f4(0)
    q1 = f4(0)
    q2 = f4(0)
    for n in range(size):
        k = np.uintp(n)
        t = a[i + k] * b[j + k]
        w0 += t * w[r, k]
        w1 += t * w[r + 1, k]
        w2 += t * w[r + 2, k]
        q0 += t * q[r, k]
        q1 += t * q[r + 1, k]
        q2 += t * q[r + 2, k]
    return w0, w1, w2, q0, q1, q2


@helper
def _add_product(
    a: Any, i: Any, b: Any, j: Any, size: int, y: int, w: Any, q: Any, under_w: Any, under_q: Any
) -> None:
    """Add one row of the product a b: under_w[l, k] += eta^l xi^k w a b, likewise under q."""
    powers = len(w)
    for r in range(0, powers - 1, 2):
        w0, w1, w2, q0, q1, q2 = _dot6(a, i, b, j, size, w, q, r)
        for k in range(powers):
            under_w[k, r] += w0 * w[k, y]
            under_w[k, r + 1] += w1 * w[k, y]
            under_q[k, r] += q0 * q[k, y]
            under_q[k, r + 1] += q1 * q[k, y]
            if r + 3 == powers:
                under_w[k, r + 2] += w2 * w[k, y]
                under_q[k, r + 2] += q2 * q[k, y]


@helper
def _add_row(fx: Any, fy: Any, f: Any, one: Any, at: Any, size: int, y: int, w: Any, q: Any, m: Any) -> None:
    """Add one row of a ZOI to all moments; ``one`` stands for the channel 1."""
    o = np.uintp(0)
    _add_product(fx, at, fx, at, size, y, w, q, m[0, 0], m[1, 0])
    _add_product(fx, at, fy, at, size, y, w, q, m[0, 1], m[1, 1])
    _add_product(fy, at, fy, at, size, y, w, q, m[0, 2], m[1, 2])
    _add_product(fx, at, f, at, size, y, w, q, m[0, 3], m[1, 3])
    _add_product(fy, at, f, at, size, y, w, q, m[0, 4], m[1, 4])
    _add_product(f, at, f, at, size, y, w, q, m[0, 5], m[1, 5])
    _add_product(one, o, one, o, size, y, w, q, m[0, 6], m[1, 6])
    _add_product(one, o, fx, at, size, y, w, q, m[0, 7], m[1, 7])
    _add_product(one, o, fy, at, size, y, w, q, m[0, 8], m[1, 8])
    _add_product(one, o, f, at, size, y, w, q, m[0, 9], m[1, 9])


@helper
def _add_row_of_level(
    fx: Any, fy: Any, f: Any, level: Any, at: Any, size: int, y: int, q: Any, scratch: Any, m: Any
) -> None:
    """Add one row of a ZOI to the moments under q times the grey level."""
    o = np.uintp(0)
    for n in range(size):
        k = np.uintp(n)
        scratch[0, k] = level[at + k]
        scratch[1, k] = level[at + k] * fx[at + k]
        scratch[2, k] = level[at + k] * fy[at + k]
        scratch[3, k] = level[at + k] * f[at + k]
    unused = m[1]
    _add_product(scratch[1], o, fx, at, size, y, q, q, m[0, 0], unused[0])
    _add_product(scratch[1], o, fy, at, size, y, q, q, m[0, 1], unused[0])
    _add_product(scratch[2], o, fy, at, size, y, q, q, m[0, 2], unused[0])
    _add_product(scratch[1], o, f, at, size, y, q, q, m[0, 3], unused[0])
    _add_product(scratch[2], o, f, at, size, y, q, q, m[0, 4], unused[0])
    _add_product(scratch[3], o, f, at, size, y, q, q, m[0, 5], unused[0])
    _add_product(scratch[0], o, scratch[4], o, size, y, q, q, m[0, 6], unused[0])
    _add_product(scratch[1], o, scratch[4], o, size, y, q, q, m[0, 7], unused[0])
    _add_product(scratch[2], o, scratch[4], o, size, y, q, q, m[0, 8], unused[0])
    _add_product(scratch[3], o, scratch[4], o, size, y, q, q, m[0, 9], unused[0])


@helper
def _assemble(moments: Any, table: Any, out: Any) -> None:
    for i in range(len(table)):
        for j in range(len(table)):
            product = PRODUCT[table[i, 0], table[j, 0]]
            out[i, j] = moments[product, table[i, 2] + table[j, 2], table[i, 1] + table[j, 1]]


@helper
def _invert(matrix: Any, low: Any, inverse: Any) -> bool:
    """Inverse of a symmetric positive matrix by Cholesky after scaling to a unit diagonal, ridged."""
    n = len(matrix)
    scale = np.empty(n)
    for i in range(n):
        if not matrix[i, i] > 0:
            return False
        scale[i] = 1 / math.sqrt(matrix[i, i])
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j] * scale[i] * scale[j]
            if i == j:
                total += RIDGE
            for k in range(j):
                total -= low[i, k] * low[j, k]
            if i == j:
                if not total > 0:
                    return False
                low[i, i] = math.sqrt(total)
            else:
                low[i, j] = total / low[j, j]
    back = np.zeros((n, n))  # inverse of the triangle
    for j in range(n):
        back[j, j] = 1 / low[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= low[i, k] * back[k, j]
            back[i, j] = total / low[i, i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, n):
                total += back[k, i] * back[k, j]
            inverse[i, j] = total * scale[i] * scale[j]
            inverse[j, i] = inverse[i, j]
    return True


@helper
def _sandwich(inverse: Any, middle: Any, affine: Any, units: Any, out: Any) -> None:
    """The 21 affine entries of inverse @ middle @ inverse, in px units."""
    n = len(inverse)
    part = np.empty((6, n))
    for a in range(6):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += inverse[affine[a], k] * middle[k, j]
            part[a, j] = total
    pair = 0
    for a in range(6):
        for b in range(a, 6):
            total = 0.0
            for k in range(n):
                total += part[a, k] * inverse[affine[b], k]
            out[pair] = total * units[a] * units[b]
            pair += 1


@parallel
def prepare(
    fx: Any, fy: Any, f: Any, level: Any, width: int, origins: Any, size: int, along_x: Any, square_x: Any,
    powers: Any, blocks: Any, mix: Any, table: Any, units: Any,
    inverse: Any, covariance: Any, covariance_level: Any, cross: Any, freedom: Any, energy: Any,
) -> None:  # fmt: skip
    """Normal matrices of all ZOIs.

    Parameters
    ----------
    fx, fy, f : flat float32
        Gradient (GL/px) and level of the filtered reference, ``width`` pixels a row, some samples
        longer than the image.
    level : flat float32, or empty
        Grey level for a noise that grows with it; empty: not wanted.
    origins : (A, 2) int64
        First row and column of each ZOI.
    along_x, square_x : (2 order + 1, size) float32
        Window and squared window times powers of xi (the window is the same along y).
    powers, blocks, mix
        See ``shapes.Shapes``.
    table : (P, 3), units : (6,)
    inverse : (A, P, P) float32, written
        Zero where there is no pattern.
    covariance, covariance_level : (A, 21) float32, written
        Of the six affine parameters, px units, for noise of variance 1 GL^2 and for noise of
        variance ``level``.
    cross : (A, 10, P) float32, written
        Of the shapes that the fit cannot follow with the columns of J (``shapes.cross_moments``).
    freedom : (A,) float32, written
        Sum of the weights less what the fit takes: expected weighted residual per GL^2 of noise.
    energy : (A, 4) float32, written
        Over the window: mean of f_x^2 and f_y^2, (GL/px)^2, variance (GL^2) and mean (GL) of f.
    """
    count = len(table)
    affine = np.array([0, 1, 2, (count - 6) // 2, (count - 6) // 2 + 1, (count - 6) // 2 + 2])
    n_powers = along_x.shape[0]
    one = np.ones(size + LANES, np.float32)
    rounded = (size + LANES - 1) // LANES * LANES
    chunks = (len(origins) + 31) // 32
    for chunk in prange(chunks):
        scratch = np.ones((5, size), np.float32)
        normal = np.empty((count, count))
        middle = np.empty((count, count))
        inv = np.empty((count, count))
        low = np.empty((count, count))
        moments = np.empty((2, N_PRODUCTS, n_powers, n_powers))
        of_level = np.empty((2, N_PRODUCTS, n_powers, n_powers))
        shaped = np.empty((7, 3, 4, N_POWERS))
        for z in range(chunk * 32, min(chunk * 32 + 32, len(origins))):
            moments[:] = 0
            of_level[:] = 0
            for y in range(size):
                at = np.uintp((origins[z, 0] + y) * width + origins[z, 1])
                _add_row(fx, fy, f, one, at, size, y, along_x, square_x, moments)
                if level.size:
                    _add_row_of_level(fx, fy, f, level, at, size, y, square_x, scratch, of_level)
            _assemble(moments[0], table, normal)
            total = moments[0, 6, 0, 0]
            energy[z, 0] = moments[0, 0, 0, 0] / total
            energy[z, 1] = moments[0, 2, 0, 0] / total
            energy[z, 3] = moments[0, 9, 0, 0] / total
            energy[z, 2] = moments[0, 5, 0, 0] / total - (moments[0, 9, 0, 0] / total) ** 2
            if not _invert(normal, low, inv):
                inverse[z] = 0
                cross[z] = 0
                covariance[z] = 0
                freedom[z] = 0
                continue
            inverse[z] = inv
            cross_moments(
                fx, fy, f, one, np.uintp(origins[z, 0] * width + origins[z, 1]), np.uintp(width), rounded,
                1 if count == 12 else 2, powers, blocks, mix, table, shaped, cross[z],
            )  # fmt: skip
            _assemble(moments[1], table, middle)
            _sandwich(inv, middle, affine, units, covariance[z])
            taken = 0.0
            for i in range(count):
                for j in range(count):
                    taken += inv[i, j] * middle[j, i]
            freedom[z] = total - taken
            if level.size:
                _assemble(of_level[0], table, middle)
                _sandwich(inv, middle, affine, units, covariance_level[z])
