"""How a ZOI answers to its modes: the normal matrix, its inverse and the unit covariances.

With the filtered reference f and its derivatives, the columns of J are f_x b, f_y b for the
monomials b of the shape function, and the nuisances f, x f, y f, 1, x, y, f_xx, f_yy, f_xy. Everything the iteration
needs is (J' w J)^-1 and the moments J' w d of the difference image d (docs/method.md): the
"sensors" of a ZOI are never stored, only the images they are made of. Coordinates are scaled to
-1..1 over the ZOI. Compiled loops.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import part, shared
from analysis.compiled.shares import in_shares
from analysis.compiled.threads import SHARES, next_piece
from analysis.fit.kernel_args import BLURS, NUISANCES, NormalArgs, ReferenceImages, WindowRows
from analysis.fit.moments import N_PRODUCTS, PRODUCT, PRODUCT_ROWS, SQUARE_ROWS, product_moments
from analysis.fit.shapes import cross_moments

CHUNK, RUN = 32, 8
"""ZOIs that a thread takes at a time; those among them whose columns are summed once, at most."""
RIDGE, BLUR_RIDGE = 1e-7, 1e-3
"""Added to the unit diagonal of the scaled normal matrix; in a pattern of one frequency blur and gain are alike."""


def columns(order: int) -> NDArray[np.int64]:
    """Columns of J as (channel, power of x, power of y), (P, 3): u modes, v modes, nuisances."""
    powers = [(0, 0), (1, 0), (0, 1)] + ([(2, 0), (1, 1), (0, 2)] if order == 2 else [])
    linear = [(0, 0), (1, 0), (0, 1)]
    table = [(0, *p) for p in powers] + [(1, *p) for p in powers]
    table += [(2, *p) for p in linear] + [(3, *p) for p in linear] + [(c, 0, 0) for c in (4, 5, 6)]
    return np.array(table, np.int64)


def parameter_scale(order: int, size: int) -> NDArray[np.float64]:
    """Units of the parameters for coordinates in px instead of half sizes, (6,) or (12,)."""
    half = size / 2
    one = [1, 1 / half, 1 / half] + ([half**-2] * 3 if order == 2 else [])
    return np.array(one + one)


def square_rows(line: NDArray[np.float64], length: int) -> NDArray[np.float32]:
    """line^2 * xi^k for k = 0 .. 4, (5, length), zero beyond the ZOI; xi from -1 to 1 over it."""
    size = len(line)
    xi = (np.arange(size) - (size - 1) / 2) / (size / 2)
    rows = np.stack([line**2 * xi**k for k in range(SQUARE_ROWS)])
    return np.pad(rows, ((0, 0), (0, length - size))).astype(np.float32)


def ridged(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """A normal matrix (P, P) as it is inverted: with the ridges on its scaled diagonal."""
    ridge = np.full(len(normal), RIDGE)
    ridge[-BLURS:] = BLUR_RIDGE
    return normal + np.diag(ridge * np.diag(normal))


@part
def _moments_of(table: Any) -> Any:
    """Where the products of the columns of J are among the moments of a ZOI, (P, P), flat."""
    out = np.empty((len(table), len(table)), np.intp)
    for i in range(len(table)):
        for j in range(len(table)):
            at = PRODUCT[table[i, 0], table[j, 0]] * PRODUCT_ROWS + table[i, 2] + table[j, 2]
            out[i, j] = at * PRODUCT_ROWS + table[i, 1] + table[j, 1]
    return out


@part
def _assemble(moments: Any, places: Any, out: Any) -> None:
    flat = moments.reshape(moments.size)
    for i in range(len(places)):
        for j in range(i + 1):
            out[i, j] = flat[places[i, j]]
            out[j, i] = out[i, j]


@part
def _invert(matrix: Any, low: Any, back: Any, inverse: Any) -> bool:
    """Inverse of a symmetric positive matrix by Cholesky after scaling to a unit diagonal, ridged; blur stands last.

    ``low`` and ``back``, (P, P) each, are for use: the triangle, and the columns of its inverse as rows.
    """
    n = len(matrix)
    scale, over = np.empty(n), np.empty(n)
    for i in range(n):
        if not matrix[i, i] > 0:
            return False
        scale[i] = 1 / math.sqrt(matrix[i, i])
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j] * scale[i] * scale[j]
            if i == j:
                total += RIDGE if i < n - BLURS else BLUR_RIDGE
            for k in range(j):
                total -= low[i, k] * low[j, k]
            if i == j:
                if not total > 0:
                    return False
                over[i] = 1 / math.sqrt(total)
            else:
                low[i, j] = total * over[j]
    for j in range(n):
        back[j, j] = over[j]
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= low[i, k] * back[j, k]
            back[j, i] = total * over[i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, n):
                total += back[i, k] * back[j, k]
            inverse[i, j] = total * scale[i] * scale[j]
            inverse[j, i] = inverse[i, j]
    return True


@part
def _sandwich(inverse: Any, middle: Any, affine: Any, units: Any, out: Any) -> None:
    """The 21 affine entries of inverse @ middle @ inverse, in px units."""
    n = len(inverse)
    part = np.empty((6, n))
    for a in range(6):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += inverse[affine[a], k] * middle[j, k]
            part[a, j] = total
    pair = 0
    for a in range(6):
        for b in range(a, 6):
            total = 0.0
            for k in range(n):
                total += part[a, k] * inverse[affine[b], k]
            out[pair] = total * units[a] * units[b]
            pair += 1


@shared
def prepare(
    images: ReferenceImages,
    origins: Any,
    size: int,
    rows: WindowRows,
    table: Any,
    units: Any,
    out: NormalArgs,
) -> None:
    """NormalArgs matrices of all ZOIs.

    Parameters
    ----------
    images : ReferenceImages
    origins : (A, 2) int64
        First row and column of each ZOI.
    rows : WindowRows
    table : (P, 3), units : (6,)
    out : NormalArgs, written
    """
    in_shares(_prepare_share, (images, origins, size, rows, table, units, out, np.zeros(SHARES, np.int64)))


@part
def _prepare_share(
    images: Any,
    origins: Any,
    size: int,
    rows: Any,
    table: Any,
    units: Any,
    out: Any,
    counters: Any,
    share: int,
) -> None:
    """The pieces of all ZOIs that one thread takes."""
    pieces = (len(origins) + CHUNK - 1) // CHUNK
    piece = next_piece(counters, share, pieces)
    while piece >= 0:
        _prepare_some(images, origins, piece * CHUNK, size, rows, table, units, out)
        piece = next_piece(counters, share, pieces)


@part
def _prepare_some(
    images: Any, origins: Any, first: int, size: int, rows: Any, table: Any, units: Any, out: Any
) -> None:
    """``prepare`` for CHUNK ZOIs."""
    count = len(table)
    half = (count - NUISANCES) // 2
    order = 1 if half == 3 else 2
    affine = np.array([0, 1, 2, half, half + 1, half + 2])
    down, end, o = np.uintp(images.pitch), np.uintp(3 * images.samples), np.uintp(0)
    wide = RUN * rows.powers.shape[1]
    one = np.ones(wide, np.float32)
    columns = np.empty((PRODUCT_ROWS + SQUARE_ROWS, wide), np.float32)
    normal = np.empty((count, count))
    middle = np.empty((count, count))
    inv = np.empty((count, count))
    low, back = np.empty((count, count)), np.empty((count, count))
    pairs = _moments_of(table)
    all_w = np.zeros((RUN, N_PRODUCTS, PRODUCT_ROWS, PRODUCT_ROWS))
    all_q, by_level = np.zeros_like(all_w), np.zeros_like(all_w)
    energy = out.energy
    begin = end_of_run = first
    for z in range(first, min(first + CHUNK, len(origins))):
        if z == end_of_run:
            begin, end_of_run = z, _end_of_run(origins, z, min(first + CHUNK, len(origins)), size)
            at = np.uintp(origins[z, 0] * images.pitch + origins[z, 1])
            places = (origins[z:end_of_run, 1] - origins[z, 1]).astype(np.uintp)
            product_moments(
                images.plain, images.plain, one, o, o, one, np.uintp(images.samples), at, down, size, places,
                rows.powers, rows.squares, order, columns, all_w, all_q,
            )  # fmt: skip
            if images.by_level.size:  # of both the latter alone is read, and kept
                product_moments(
                    images.by_level, images.plain, images.by_level, end + at, down, one, np.uintp(images.samples),
                    at, down, size, places, rows.powers, rows.squares, order, columns, by_level, by_level,
                )  # fmt: skip
        of_w, of_q = all_w[z - begin], all_q[z - begin]
        _assemble(of_w, pairs, normal)
        total = of_w[6, 0, 0]
        energy[z, 0] = of_w[0, 0, 0] / total
        energy[z, 1] = of_w[2, 0, 0] / total
        energy[z, 3] = of_w[9, 0, 0] / total
        energy[z, 2] = of_w[5, 0, 0] / total - (of_w[9, 0, 0] / total) ** 2
        if not _invert(normal, low, back, inv):
            out.inverse[z].fill(0)
            out.cross[z].fill(0)
            out.covariance[z].fill(0)
            out.taken[z].fill(0)
            out.freedom[z] = out.blur[z] = 0
            continue
        _copy(inv, out.inverse[z])
        cross_moments(of_w, table, rows.mix, out.cross[z])
        _assemble(of_q, pairs, middle)
        _sandwich(inv, middle, affine, units, out.covariance[z])
        out.freedom[z] = total - _taken(inv, middle, out.taken[z])
        out.blur[z] = _of_sum(inv, middle, count - 3, count - 2)
        if images.by_level.size:
            _assemble(by_level[z - begin], pairs, middle)
            _sandwich(inv, middle, affine, units, out.covariance_level[z])


@part
def _end_of_run(origins: Any, z: int, end: int, size: int) -> int:
    """The first ZOI behind ``z`` that does not begin in its row, close behind the one before."""
    n = z + 1
    while n < min(end, z + RUN) and origins[n, 0] == origins[z, 0]:
        if not 0 <= origins[n, 1] - origins[n - 1, 1] <= size:
            break
        n += 1
    return n


@part
def _copy(matrix: Any, to: Any) -> None:
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            to[i, j] = matrix[i, j]


@part
def _of_sum(inverse: Any, middle: Any, i: int, j: int) -> Any:
    """Variance of the sum of the parameters i and j: of inverse @ middle @ inverse."""
    out = 0.0
    for k in range(len(inverse)):
        for n in range(len(inverse)):
            out += (inverse[i, k] + inverse[j, k]) * middle[k, n] * (inverse[i, n] + inverse[j, n])
    return out


@part
def _taken(inverse: Any, middle: Any, out: Any) -> Any:
    """The diagonal of inverse @ middle, both symmetric, written to ``out``; returns its sum."""
    whole = 0.0
    for i in range(len(inverse)):
        part = 0.0
        for j in range(len(inverse)):
            part += inverse[i, j] * middle[i, j]
        out[i] = part
        whole += part
    return whole
