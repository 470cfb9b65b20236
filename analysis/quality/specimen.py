"""Where the speckled specimen is in a picture: by what could be measured there, not by grey level.

The figure is the smaller eigenvalue of the structure tensor, the noise taken out: what is left of the
gradient in the worst direction, from which the uncertainty of a displacement follows. An edge, a brushed
grip, a blurred background have none of it. Single strong edges (letters, screws) are capped at the strength
of the speckle, so that they count for no more than one. The rest is a matter of size: what no ZOI fits
into is left out, and of several speckled places the largest is the specimen. Rectangles of its speckle beside it, along
its length, look like plates.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import Roi
from analysis.picture.pattern import noise_of_picture

MOST = 2
MIN_FILLED = 0.9  # of its box: a rectangle
MAX_RADIUS_RATIO = 1.5  # of its speckle to that of the specimen, either way
MIN_LENGTH = 0.4  # of the specimen beside it
RIM_PX = 16


Cells = NDArray[np.float32]
Bools = NDArray[np.bool_]
CELL = 4
"""Side of a cell, px: the gradient is taken on pixels, judged in cells."""
QUANTISATION = 12**-0.5  # GL: the least noise there is
OVER_NOISE = 2.0  # times the variance that noise alone gives a gradient
OF_ALL, OF_AROUND = 0.06, 0.4  # least share of the specimen's own quality, overall and within some speckles
CAP = 1.5  # times the rms gradient of the speckle: no edge counts for more
MIN_WIDTH_PX = 32.0  # px: what is narrower takes no ZOI
SPECKLES = 3.0  # radii: std of the window that judges
WINDOW = (5.0, 24.0)  # px
MIN_PICTURE_SHARE = 0.005  # of the picture
SLOW_PX = 20.0  # std of what is taken for light and background, for the contrast


@dataclass(frozen=True, slots=True)
class FoundPlates:
    """What looks like plates in a still picture, which does not show what they hang from.

    Attributes
    ----------
    plates : tuple of Roi
        From left to right, or from top to bottom.
    unclear : tuple of Roi
        Other patterns beside the specimen.
    """

    plates: tuple[Roi, ...] = ()
    unclear: tuple[Roi, ...] = ()


def find_plates(image: ArrayLike, specimen: Specimen, noise: float | None = None) -> FoundPlates:
    """Patterns outside of ``specimen``, which ``find_specimen`` has found in ``image``.

    Parameters
    ----------
    image : (H, W), GL
    specimen : Specimen
    noise : float, GL, optional
        As of ``find_specimen``.
    """
    rest = np.array(image, np.float32)
    _cover(rest, specimen.box)
    found: dict[bool, list[Roi]] = {True: [], False: []}
    for _ in range(MOST):
        piece = find_specimen(rest, noise)
        if piece is None:
            break
        found[_is_plate(piece, specimen)].append(piece.box)
        _cover(rest, piece.box)
    return FoundPlates(
        *(tuple(sorted(found[clear], key=lambda box: box.x + box.y)) for clear in (True, False))
    )


def _cover(picture: NDArray[np.float32], box: Roi) -> None:
    """Make a box and its rim even."""
    y, x = max(box.y - RIM_PX, 0), max(box.x - RIM_PX, 0)
    part = picture[y : box.y + box.height + RIM_PX, x : box.x + box.width + RIM_PX]
    part[:] = part.mean()


def _is_plate(piece: Specimen, specimen: Specimen) -> bool:
    box = piece.box
    filled = float(piece.mask[box.y : box.y + box.height, box.x : box.x + box.width].mean())
    alike = 1 / MAX_RADIUS_RATIO <= piece.radius / specimen.radius <= MAX_RADIUS_RATIO
    return filled >= MIN_FILLED and alike and _beside(box, specimen.box)


def _beside(box: Roi, of: Roi) -> bool:
    """Whether a box lies along another one, which is longer than wide, for a good part of its length."""
    if of.width > of.height:
        box, of = (Roi(one.y, one.x, one.height, one.width) for one in (box, of))
    common = min(box.y + box.height, of.y + of.height) - max(box.y, of.y)
    apart = box.x >= of.x + of.width or box.x + box.width <= of.x
    return apart and common >= MIN_LENGTH * of.height


@dataclass(frozen=True, slots=True, eq=False)
class Specimen:
    """The speckled specimen in a picture.

    Attributes
    ----------
    mask : (H, W) bool
        Read-only; holes are left out.
    box : Roi
        Around the mask.
    radius : float, px
        Of its speckle, roughly; ``describe_pattern`` has it to the point.
    """

    mask: Bools
    box: Roi
    radius: float

    @property
    def share(self) -> float:
        """Part of the picture that it covers."""
        return float(self.mask.mean())


def find_specimen(image: ArrayLike, noise: float | None = None) -> Specimen | None:
    """The largest place of a picture with a pattern that can be measured; None where there is none.

    Parameters
    ----------
    image : (H, W), GL
    noise : float, GL, optional
        Of this picture; None: from the corners of its spectrum.

    Raises
    ------
    ValueError
        Not a grey picture, or smaller than 16 px.
    """
    picture = np.asarray(image, np.float32)
    sigma = max(noise_of_picture(picture) if noise is None else noise, QUANTISATION)
    gradient = _Gradient.of(picture, sigma)
    spread = _Spread.of(picture, gradient, sigma)
    window, cap, radius, core = WINDOW[0] + 1, math.inf, 2.0, None
    for _ in range(3):
        quality = gradient.quality(window, cap)
        core = _core(quality, gradient.variance)
        if core is None:
            return None
        inner = _inner(core, window)
        cap = CAP * math.sqrt(2 * float(np.median(quality[inner])))
        radius = spread.radius(inner)
        window = float(np.clip(SPECKLES * radius, *WINDOW))
    assert core is not None
    for _ in range(2):
        core = _outlined(quality, core, gradient.variance, window)
        if core is None:
            return None
    return _specimen(core, picture.shape, radius)


@dataclass(frozen=True, slots=True, eq=False)
class _Gradient:
    """Products of the gradients of a picture, slightly smoothed, and the variance that its noise gives them."""

    xx: NDArray[np.float32]
    yy: NDArray[np.float32]
    xy: NDArray[np.float32]
    variance: float

    @classmethod
    def of(cls, picture: NDArray[np.float32], sigma: float) -> _Gradient:
        from scipy.ndimage import gaussian_filter

        x, y = (gaussian_filter(picture, 1.0, order=order, mode="nearest") for order in ((0, 1), (1, 0)))
        return cls(x * x, y * y, x * y, sigma**2 / (8 * math.pi))

    def quality(self, window: float, cap: float) -> Cells:
        """Smaller eigenvalue of the structure tensor in a Gaussian of std ``window`` px, GL^2/px^2."""
        xx, yy, xy = (_blurred(cells, window) for cells in self._capped(cap))
        smaller = (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)
        return np.asarray(smaller - self.variance, np.float32)

    def _capped(self, cap: float) -> Iterator[Cells]:
        """The products, none of a gradient larger than ``cap``."""
        if not math.isfinite(cap):
            yield from (_means(product) for product in (self.xx, self.yy, self.xy))
            return
        share = self.xx + self.yy
        np.maximum(share, np.float32(1e-18), out=share)
        np.divide(np.float32(cap**2), share, out=share)
        np.minimum(share, np.float32(1), out=share)
        scratch = np.empty_like(share)
        for product in (self.xx, self.yy, self.xy):
            yield _means(np.multiply(product, share, out=scratch))

    def power(self) -> Cells:
        """Mean square of one component, the noise taken out, GL^2/px^2."""
        return np.asarray((_means(self.xx) + _means(self.yy)) / 2 - self.variance, np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class _Spread:
    """Contrast of a picture and power of its gradient, both squared and about each cell."""

    contrast: Cells
    power: Cells
    noise: float

    @classmethod
    def of(cls, picture: NDArray[np.float32], gradient: _Gradient, sigma: float) -> _Spread:
        zero = picture - picture.mean(dtype=np.float64).astype(np.float32)
        level, square = _means(zero), _means(zero * zero)
        slow = _blurred(level, SLOW_PX)
        contrast = square - 2 * slow * level + slow**2
        return cls(_blurred(contrast, WINDOW[0]), _blurred(gradient.power(), WINDOW[0]), sigma**2)

    def radius(self, inner: Bools) -> float:
        """r from contrast over gradient: a blob of radius r has C^2 = 2 r^2 g^2, smoothed 1 px beforehand."""
        contrast, power = (float(np.median(values[inner])) for values in (self.contrast, self.power))
        ratio = (contrast - self.noise) / max(power, 1e-9)
        return math.sqrt(max(ratio / 2 - 0.5, 0.5))


def _means(values: NDArray[np.float32]) -> Cells:
    """Over cells; what is left over at the right and below is left out."""
    rows, columns = (n // CELL * CELL for n in values.shape)
    sums = values[:rows:CELL, :columns].copy()
    for k in range(1, CELL):
        sums += values[k:rows:CELL, :columns]
    cells = sums[:, ::CELL].copy()
    for k in range(1, CELL):
        cells += sums[:, k::CELL]
    cells *= np.float32(CELL**-2)
    return cells


def _blurred(cells: NDArray[np.float32], px: float) -> Cells:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(cells, px / CELL, mode="reflect"), np.float32)


def _core(quality: Cells, variance: float) -> Bools | None:
    """The largest piece of what is good, against the noise and against the better part of all that is."""
    seen = quality > OVER_NOISE * variance
    if not seen.any():
        return None
    typical = float(np.percentile(quality[seen], 70))
    return _largest(quality > max(OVER_NOISE * variance, OF_ALL * typical))


def _inner(piece: Bools, px: float) -> Bools:
    """What lies deeper inside than ``px``; all of a piece that is nowhere so deep."""
    from scipy.ndimage import distance_transform_edt

    inner = np.asarray(distance_transform_edt(piece) > px / CELL)
    return inner if inner.any() else piece


def _outlined(quality: Cells, core: Bools, variance: float, window: float) -> Bools | None:
    """The piece with its edge where the quality falls below a share of what is usual just inside."""
    inner = _inner(core, window).astype(np.float32)
    near = _blurred(inner, 4 * window)
    usual = _blurred(np.maximum(quality, 0) * inner, 4 * window) / np.maximum(near, 1e-6)
    usual[near < 1e-3] = usual[inner > 0].mean()
    good = quality > np.maximum(OF_AROUND * usual, OVER_NOISE * variance)
    piece = _largest(_smooth(good, window))
    return None if piece is None else _without_pinholes(piece, 2 * window)


def _smooth(good: Bools, window: float) -> Bools:
    """Gaps between speckles closed, what is too narrow for a ZOI opened; the picture's edge is no edge."""
    gap, narrow = 0.6 * window / CELL, max(2 * window, MIN_WIDTH_PX / 2) / CELL
    pad = math.ceil(2 * narrow)
    padded = np.pad(good, pad, mode="edge")
    closed = ~_grown(~_grown(padded, gap), gap)
    opened = _grown(~_grown(~closed, narrow), narrow)
    return opened[pad:-pad, pad:-pad]


def _grown(piece: Bools, cells: float) -> Bools:
    from scipy.ndimage import distance_transform_edt

    if not piece.any():
        return piece
    return np.asarray(distance_transform_edt(~piece) <= cells)


def _largest(good: Bools) -> Bools | None:
    from scipy.ndimage import label

    labels, n = label(good)
    if n == 0:
        return None
    largest = np.asarray(labels == 1 + np.argmax(np.bincount(labels.ravel())[1:]))
    return largest if largest.mean() >= MIN_PICTURE_SHARE else None


def _without_pinholes(piece: Bools, px: float) -> Bools:
    """Holes smaller than a square of side ``px`` filled: gaps between speckles, not holes of a specimen."""
    from scipy.ndimage import label

    labels, _ = label(~piece)
    sizes = np.bincount(labels.ravel())
    small = sizes < (px / CELL) ** 2
    small[0] = False
    return np.asarray(piece | small[labels])


def _specimen(piece: Bools, shape: tuple[int, ...], radius: float) -> Specimen:
    # The edge came out a few pixels too far as a rule: half the window reaches over it.
    inner = ~_grown(np.pad(~piece, 1, mode="edge"), 1.0)[1:-1, 1:-1]
    piece = inner if inner.any() else piece
    mask = np.repeat(np.repeat(piece, CELL, axis=0), CELL, axis=1)
    height, width = shape
    mask = np.pad(mask, ((0, height - mask.shape[0]), (0, width - mask.shape[1])), mode="edge")
    mask.flags.writeable = False
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    x, y = int(columns[0]), int(rows[0])
    return Specimen(mask, Roi(x, y, int(columns[-1]) + 1 - x, int(rows[-1]) + 1 - y), radius)
