"""The whole-pixel start of each ZOI, from nothing: blocks of the picture first, then the ZOI's own whole pixel.

Coarse to fine: one displacement for the whole region by zero-mean normalised correlation
(errata of eq. 2-3 of the paper: FFT(g) conj(FFT(f))), then blocks at each level of an image
pyramid, then each ZOI tries the displacements of the blocks around it and climbs to the best
whole pixel. Blocks depend on the images and the region alone, never on which ZOIs are active.

Blocks are matched by a compiled loop, by zero-mean normalised correlation as ``cv2.matchTemplate`` has it: that took
25 us a block with its call; the loop takes 3 (AMD EPYC, November 2026).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import part, shared
from analysis.compiled.shares import in_shares, part_of
from analysis.field import Roi
from analysis.follow.hill_climb import MAX_MOVES, climbed

f4 = np.float32


@shared
def match(
    reference: Any, padded: Any, margin: int, firsts: Any, size: int, guesses: Any, reach: int, out: Any
) -> None:
    """The best displacement (x, y) of each block within ``reach`` px of its guesses.

    A block without contrast stays at its first guess.

    Parameters
    ----------
    reference : (H, W) float32
    padded : (H + 2 margin, W + 2 margin) float32
        The other picture, continued beyond its edges; places beyond it are moved inside.
    margin : int, px
    firsts : (N, 2) int64
        First row and column of each block of ``size`` px.
    guesses : (N, K, 2) int64, (x, y)
    reach : int, px
    out : (N, 2) float64, written
    """
    in_shares(_match_share, (reference, padded, margin, firsts, size, guesses, reach, out))


@part
def _match_share(
    reference: Any, padded: Any, margin: int, firsts: Any, size: int, guesses: Any, reach: int, out: Any, share: int
) -> None:  # fmt: skip
    first, end = part_of(len(firsts), share)
    for n in range(first, end):
        _match_block(reference, padded, margin, firsts[n], size, guesses[n], reach, out[n])


@part
def _match_block(
    reference: Any, padded: Any, margin: int, first: Any, size: int, guesses: Any, reach: int, out: Any
) -> None:
    out[0], out[1] = guesses[0, 0], guesses[0, 1]
    block, square = _without_mean(reference, first, size)
    side, best = size + 2 * reach, f4(-2)
    for k in range(len(guesses)):
        if square <= 0 or _is_repeated(guesses, k):
            continue
        row, column = margin + first[0], margin + first[1]
        top = min(max(row + guesses[k, 1] - reach, 0), padded.shape[0] - side)
        left = min(max(column + guesses[k, 0] - reach, 0), padded.shape[1] - side)
        for y in range(2 * reach + 1):
            for x in range(2 * reach + 1):
                value = _correlation(block, square, padded, top + y, left + x, size)
                if value > best:
                    best = value
                    out[0], out[1] = left + x - column, top + y - row


@part
def _is_repeated(guesses: Any, k: int) -> bool:
    for i in range(k):  # noqa: SIM110 - compiled
        if guesses[i, 0] == guesses[k, 0] and guesses[i, 1] == guesses[k, 1]:
            return True
    return False


@part
def _without_mean(image: Any, first: Any, size: int) -> Any:
    """A block less its mean, and the sum of its squares."""
    block = np.empty((size, size), np.float32)
    total = 0.0
    for y in range(size):
        for x in range(size):
            total += image[first[0] + y, first[1] + x]
    mean, square = f4(total / (size * size)), f4(0)
    for y in range(size):
        row, to = image[first[0] + y, first[1] : first[1] + size], block[y]
        for x in range(size):
            to[x] = row[x] - mean
            square += to[x] * to[x]
    return block, square


@part
def _correlation(block: Any, square: Any, image: Any, top: int, left: int, size: int) -> Any:
    """Of a block without its mean and the sum of its squares with a place of an image; 0 without contrast there."""
    product, total, squares = f4(0), f4(0), f4(0)
    # Sums of squares keep their digits where a grey level from inside is taken off.
    zero = image[top + size // 2, left + size // 2]
    for y in range(size):
        a, b = block[y], image[top + y, left : left + size]
        for x in range(size):
            value = b[x] - zero
            product += a[x] * value
            total += value
            squares += value * value
    spread = squares - total * total / f4(size * size)
    return product / f4(math.sqrt(square * spread)) if spread > 1e-6 * squares else f4(0)


Image = NDArray[np.float32]
MIN_SIDE = 48
"""Halving stops before the shorter side of the region falls below this (px)."""
BLOCK = 24
BLOCK_STEP = 20
PARTS = 3
"""The coarsest level is searched for in this many parts a side."""
PLANE_REACH = 2
OUTLIER = 2.0
"""Pixels from the plane of its neighbours from which on a block is left out."""
MAX_GRADIENT = 0.15
"""Largest displacement gradient that a search from nothing allows for."""
MIN_OVERLAP = 0.2
"""Share of the region that must still lie in the deformed image."""


def search(
    reference: NDArray[np.float32],
    deformed: NDArray[np.float32],
    offset: Any,
    region: Roi,
    origins: NDArray[np.int64],
    size: int,
) -> NDArray[np.float64]:
    """Whole-pixel displacements of all ZOIs and the gradients of the blocks around them.

    Parameters
    ----------
    reference, deformed : (H, W) float32, GL
    offset : float32, GL
        Taken off both, so that sums of squares keep their digits.
    region : Roi
        Of the reference, where the ZOIs lie.
    origins : (A, 2) int64
        First row and column of each ZOI.
    size : int, px

    Returns
    -------
    (A, 6) float64 : u, du_dx, du_dy, v, dv_dx, dv_dy, px and px per px.
    """
    blocks = find_blocks(reference, deformed, region)
    centre = origins + (size - 1) / 2
    out = blocks.plane_at(centre[:, 0], centre[:, 1])
    around = blocks.around(centre[:, 0], centre[:, 1])
    candidates = np.rint(np.concatenate([out[:, None, [0, 3]], around], axis=1)).astype(np.int64)
    out[:, [0, 3]] = climbed(reference, deformed, offset, origins, size, candidates, MAX_MOVES)[0]
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Displacements of blocks of the reference, whole pixels of their level.

    ``y`` (M,) and ``x`` (N,) are centres and ``shift`` (M, N, 2) the displacements (x, y) in px.
    """

    y: NDArray[np.float64]
    x: NDArray[np.float64]
    shift: NDArray[np.float64]

    def planes(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float64]:
        """A plane through the displacements of some blocks (K,) and their neighbours', (K, 6), px.

        u, du_dx, du_dy, v, dv_dx, dv_dy at the block's centre, least squares over 5 x 5 blocks; those
        further than OUTLIER from the plane are left out the second time.
        """
        near = np.arange(-PLANE_REACH, PLANE_REACH + 1)
        r, c = (
            np.clip(which[:, None] + near, 0, count - 1)
            for which, count in zip((rows, columns), self.shift.shape, strict=False)
        )
        # Blocks beyond the border would be counted twice: weight zero.
        weight = np.einsum("ki,kj->kij", *(np.diff(k, axis=1, prepend=-1) > 0 for k in (r, c))).astype(float)
        dy = np.broadcast_to((self.y[r] - self.y[rows, None])[:, :, None], weight.shape)
        dx = np.broadcast_to((self.x[c] - self.x[columns, None])[:, None, :], weight.shape)
        basis = np.stack([np.ones_like(dx), dx, dy], axis=-1).reshape(len(rows), -1, 3)
        shift = self.shift[r[:, :, None], c[:, None, :]].reshape(len(rows), -1, 2)
        start = np.median(shift, axis=1, keepdims=True)
        weight = weight.reshape(len(rows), -1)
        reach = 0.5 * np.hypot(np.ptp(self.x), np.ptp(self.y)) / max(self.shift.shape[:2]) * MAX_GRADIENT
        keep = weight * (np.abs(shift - start).max(axis=-1) < np.maximum(OUTLIER, 4 * reach))
        fit = _planes(basis, shift, keep)
        error = np.abs(np.einsum("kip,kpc->kic", basis, fit) - shift).max(axis=-1)
        fit = _planes(
            basis, shift, weight * (error < np.maximum(OUTLIER, np.median(error, axis=1, keepdims=True)))
        )
        return np.concatenate([fit[..., 0], fit[..., 1]], axis=-1)

    def around(self, y: NDArray[np.floating], x: NDArray[np.floating]) -> NDArray[np.float64]:
        """Displacements of the four blocks around each point, (points, 4, 2)."""
        rows, columns = _neighbours(self.y, y), _neighbours(self.x, x)
        return np.concatenate([self.shift[r, c][:, None] for r in rows for c in columns], axis=1)

    def plane_at(self, y: NDArray[np.floating], x: NDArray[np.floating]) -> NDArray[np.float64]:
        """The plane of the nearest block, moved to each point, (points, 6)."""
        r, c = _nearest(self.y, y), _nearest(self.x, x)
        blocks, own = np.unique(r * len(self.x) + c, return_inverse=True)
        plane = self.planes(*np.divmod(blocks, len(self.x)))[own]
        dy, dx = y - self.y[r], x - self.x[c]
        for k in (0, 3):
            plane[:, k] += plane[:, k + 1] * dx + plane[:, k + 2] * dy
        return np.asarray(plane)


def _planes(
    basis: NDArray[np.float64], values: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weighted least squares of planes, (K, 3, 2); flat where too few blocks are left."""
    weighted = (basis * weight[..., None]).swapaxes(1, 2)
    normal, right = weighted @ basis, weighted @ values
    ridge = np.zeros((3, 3))
    ridge[1, 1] = ridge[2, 2] = BLOCK_STEP**2
    ridge[0, 0] = 1e-9
    return np.asarray(np.linalg.solve(normal + ridge, right))


def _neighbours(centres: NDArray[np.floating], at: NDArray[np.floating]) -> tuple[NDArray[np.intp], ...]:
    right = np.searchsorted(centres, at)
    return np.clip(right - 1, 0, len(centres) - 1), np.clip(right, 0, len(centres) - 1)


def _nearest(centres: NDArray[np.floating], at: NDArray[np.floating]) -> NDArray[np.intp]:
    left, right = _neighbours(centres, at)
    return np.where(at - centres[left] <= centres[right] - at, left, right)


def find_blocks(reference: Image, deformed: Image, roi: Roi) -> Blocks:
    """Displacements of blocks all over the region, right to about one pixel.

    Parameters
    ----------
    reference, deformed : (H, W) float32
    roi : Roi
        The region of the reference that is searched for in the whole deformed image.
    """
    levels = list(_pyramid(reference, deformed, roi))
    coarse = levels[-1]
    whole = global_shift(*coarse)
    blocks = _match_parts(*coarse)
    reach = 6 if len(levels) > 1 else 4
    # The finest level only costs time: each ZOI climbs to its own whole pixel anyway.
    for ref, image, box in levels[: 0 if len(levels) > 1 else None : -1]:
        blocks = _match_blocks(ref, image, box, blocks, reach, whole if ref is coarse[0] else None)
        scale = 1.0 if ref is levels[0][0] else 2.0
        blocks = Blocks((blocks.y + 0.5) * scale - 0.5, (blocks.x + 0.5) * scale - 0.5, blocks.shift * scale)
        reach = 3
    return blocks


def _pyramid(reference: Image, deformed: Image, roi: Roi) -> Iterator[tuple[Image, Image, Roi]]:
    import cv2

    box = roi
    while True:
        yield reference, deformed, box
        if min(box.width, box.height) < 2 * MIN_SIDE:
            return
        size = (reference.shape[1] // 2, reference.shape[0] // 2)
        reference, deformed = (
            np.asarray(cv2.resize(im[: 2 * size[1], : 2 * size[0]], size, interpolation=cv2.INTER_AREA))
            for im in (reference, deformed)
        )
        right, bottom = min((box.x + box.width) // 2, size[0]), min((box.y + box.height) // 2, size[1])
        box = Roi((box.x + 1) // 2, (box.y + 1) // 2, right - (box.x + 1) // 2, bottom - (box.y + 1) // 2)


def global_shift(reference: Image, deformed: Image, box: Roi) -> tuple[int, int]:
    """One displacement (x, y) of a region, whole px, by normalised correlation over their overlap."""
    from scipy import fft

    part = reference[box.y : box.y + box.height, box.x : box.x + box.width].astype(np.float64)
    image = deformed.astype(np.float64)
    part, image = part - part.mean(), image - image.mean()
    shape = tuple(
        fft.next_fast_len(a + b - 1, real=True) for a, b in zip(part.shape, image.shape, strict=True)
    )

    def correlate(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
        return np.asarray(fft.irfft2(fft.rfft2(b, shape) * np.conj(fft.rfft2(a, shape)), shape))

    here, there = np.ones_like(part), np.ones_like(image)
    count = np.maximum(correlate(here, there), 1)
    sum_f, sum_g = correlate(part, there), correlate(here, image)
    product = correlate(part, image) - sum_f * sum_g / count
    var_f = correlate(part**2, there) - sum_f**2 / count
    var_g = correlate(here, image**2) - sum_g**2 / count
    floor = 1e-6 * max(float(np.sum(part**2)), float(np.sum(image**2)), 1e-30)
    score = product / np.sqrt(np.maximum(var_f, floor) * np.maximum(var_g, floor))
    score[count < MIN_OVERLAP * part.size] = -2
    row, column = np.unravel_index(int(np.argmax(score)), score.shape)
    dy = int(row) - (shape[0] if row >= image.shape[0] else 0) - box.y
    dx = int(column) - (shape[1] if column >= image.shape[1] else 0) - box.x
    return dx, dy


def _match_parts(reference: Image, deformed: Image, box: Roi) -> Blocks:
    """Displacements of 3 x 3 parts of the region, each searched for in the whole image.

    A rotated region as a whole correlates with nothing; its parts still do.
    """
    import cv2

    height, width = max(box.height // PARTS, 8), max(box.width // PARTS, 8)
    first_y = np.linspace(box.y, box.y + max(box.height - height, 0), PARTS).astype(int)
    first_x = np.linspace(box.x, box.x + max(box.width - width, 0), PARTS).astype(int)
    shift = np.zeros((PARTS, PARTS, 2))
    for r, top in enumerate(first_y):
        for c, left in enumerate(first_x):
            template = reference[top : top + height, left : left + width]
            if template.std() > 0 and all(
                a <= b for a, b in zip(template.shape, deformed.shape, strict=True)
            ):
                score = cv2.matchTemplate(deformed, template, cv2.TM_CCOEFF_NORMED)
                _, _, _, place = cv2.minMaxLoc(np.nan_to_num(score, nan=-1.0, posinf=-1.0, neginf=-1.0))
                shift[r, c] = place[0] - left, place[1] - top
    return Blocks(first_y + (height - 1) / 2, first_x + (width - 1) / 2, shift)


def _match_blocks(
    reference: Image, deformed: Image, box: Roi, guess: Blocks, reach: int, extra: tuple[int, int] | None
) -> Blocks:
    """Displacement of each block: the best match within ``reach`` px of any guess."""
    from analysis.compiled.loops import read_only

    size = min(BLOCK, box.width, box.height)
    first_y = _firsts(box.y, box.height, size)
    first_x = _firsts(box.x, box.width, size)
    y: NDArray[np.float64] = np.asarray(first_y + (size - 1) / 2, np.float64)
    x: NDArray[np.float64] = np.asarray(first_x + (size - 1) / 2, np.float64)
    grid_y, grid_x = (a.ravel() for a in np.meshgrid(y, x, indexing="ij"))
    guesses = np.rint(guess.around(grid_y, grid_x)).astype(np.int64)
    if extra is not None:
        guesses = np.concatenate([guesses, np.broadcast_to(np.array(extra), (len(guesses), 1, 2))], axis=1)
    margin = size + 2 * reach
    padded = np.pad(deformed, margin, mode="reflect" if min(deformed.shape) > margin else "edge")
    shift = np.empty((len(grid_y), 2))
    firsts = np.stack(np.meshgrid(first_y, first_x, indexing="ij"), axis=-1).reshape(-1, 2).astype(np.int64)
    match(read_only(np.ascontiguousarray(reference)), padded, margin, firsts, size, guesses, reach, shift)
    return Blocks(y, x, shift.reshape(len(y), len(x), 2))


def _firsts(first: int, length: int, size: int) -> NDArray[np.intp]:
    count = max(1, (length - size) // BLOCK_STEP + 1)
    return np.unique(np.linspace(first, first + length - size, count).astype(np.intp))
