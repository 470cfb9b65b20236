"""Displacements at which a picture may look like itself: the side peaks of its autocorrelation.

Near ones are sought in tiles, so that a part that repeats is seen, farther ones by the whole region in the picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.pool import THREADS, each
from analysis.field import Roi

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Image = NDArray[np.float32]

TILE = 160
"""Side of a tile, px: what repeats in a part of a picture is seen in its tiles."""
REACH = 0.4
"""Longest displacement, in sides of a tile: beyond it too little of the tile overlaps."""
SHORTEST_PX = 3.0
PEAK = 0.5
"""Least autocorrelation, of that without displacement."""
MAX_PEAKS = 4
"""The nearest ones of a tile; longer ones are sums of them."""
NEAR = 0.6
"""Sides of a tile from its centre within which a ZOI may repeat with it."""
FAR_PIXELS = 1_000_000, 16_000_000
"""Pixels from which on a picture is halved before farther displacements are sought, and halved once more."""
SLOWEST_PX = 64.0
"""Longest wave that counts there: light and background are slower."""
FAR_PEAK = 0.25
"""Least share of the region's own pattern that is there; print, paper and fractions of a pixel take some."""
MIN_OVERLAP, MAX_FAR = 0.1, 6
"""Share of the region that must lie in the picture there, and how many displacements are looked at."""
TOO_MUCH = 2.2
"""Share that is found only beside the opposite edge, where the picture is continued with itself; 2: on both sides."""
SAME_PX = 3.0
"""How far from a sum of known displacements another one is new."""


@dataclass(frozen=True, slots=True, eq=False)
class Repetition:
    """Where the ZOIs of a picture look like themselves.

    Attributes
    ----------
    places : (K, 2) float64, px
        Displacements (x, y), one of each pair of opposite ones.
    has : (A, K) bool
        Which of them each ZOI has.
    """

    places: Floats
    has: Bools

    @classmethod
    def none(cls, zois: int) -> Repetition:
        """Of a pattern that does not repeat."""
        return cls(np.zeros((0, 2)), np.zeros((zois, 0), bool))

    @property
    def period(self) -> Floats:
        """The smallest displacement of each ZOI, (A,), px; infinite: none."""
        lengths = np.where(self.has, np.hypot(*self.places.T), np.inf)
        return np.asarray(lengths.min(axis=1, initial=np.inf))

    def off(self, away: Floats, which: NDArray[np.intp] | slice = slice(None)) -> Floats:
        """How far ZOIs are from a place, in periods: at 0.5 the next place is as near.

        Parameters
        ----------
        away : (B, 2), px
            Their distance (x, y) from it.
        which : optional
            The B ZOIs; one that does not repeat counts as if it did so in every way.
        """
        has = self.has[which]
        counted = has | ~has.any(axis=1, keepdims=True)
        shares = abs(away @ self.places.T) / np.sum(self.places**2, axis=1)
        return np.asarray(np.where(counted, shares, 0.0).max(axis=1, initial=0.0))

    def nearest(self, away: Floats, which: NDArray[np.intp]) -> Floats:
        """The shortest displacement (B, 2) at which ZOIs look the same as at ``away`` (B, 2), px."""
        out, has = away.copy(), self.has[which]
        for _ in range(2 * len(self.places)):
            for place, here in zip(self.places, has.T, strict=True):
                times = np.where(here, np.rint(out @ place / (place @ place)), 0.0)
                out -= times[:, None] * place
        return out


def side_peaks(
    image: Image, region: Roi, x: Floats, y: Floats
) -> Iterator[tuple[tuple[int, int], NDArray[np.bool_]]]:
    """Displacements (x, y) at which tiles of a region look like themselves, px, each with the points near such tiles.

    Parameters
    ----------
    image : (H, W) float32, GL
        Without noise (``Pattern.level``).
    region : Roi
        Its tiles are looked at, and where it looks like another part of the picture.
    x, y : (A,), px

    Yields
    ------
    (int, int), (A,) bool
        One of each pair of opposite displacements.
    """
    near: dict[tuple[int, int], NDArray[np.bool_]] = {}
    side = min(TILE, region.width, region.height)
    middle = (side - 1) / 2
    tops, lefts = _firsts(region.y, region.height, side), _firsts(region.x, region.width, side)

    def in_row(top: int) -> list[list[tuple[int, int]]]:
        return _peaks(np.stack([image[top : top + side, left : left + side] for left in lefts]))

    for top, row in zip(tops, each(in_row, tops), strict=True):
        for left, peaks in zip(lefts, row, strict=True):
            if not peaks:
                continue
            around = np.maximum(abs(x - left - middle), abs(y - top - middle)) <= NEAR * side
            for peak in peaks:
                known = next((p for p in near if math.dist(p, peak) < 2), peak)
                near[known] = near.get(known, False) | around
    yield from near.items()
    seen = Repetition(np.array(list(near), float).reshape(-1, 2), np.ones((1, len(near)), bool))
    for peak in _far_peaks(image, region, int(REACH * side)):
        if np.hypot(*seen.nearest(np.array([peak], float), np.zeros(1, np.intp))[0]) > SAME_PX:
            yield peak, np.ones(len(x), bool)


def _far_peaks(image: Image, region: Roi, reach: int) -> list[tuple[int, int]]:
    """Displacements beyond ``reach`` px at which a region looks like the picture, the nearest first."""
    from scipy.fft import irfft2, rfft2

    times = 2 ** int(np.searchsorted(FAR_PIXELS, image.size))
    height, width = (n // times for n in image.shape)
    parts = [image[i::times, k::times][:height, :width] for i in range(times) for k in range(times)]
    small, spectrum = _without_slow(sum(parts[1:], parts[0]) / np.float32(times**2), SLOWEST_PX / times)
    top, left = region.y // times, region.x // times
    rows, columns = max(region.height // times, 1), max(region.width // times, 1)
    part = np.zeros_like(small)
    part[top : top + rows, left : left + columns] = small[top : top + rows, left : left + columns]
    found = irfft2(spectrum * np.conj(rfft2(part, workers=THREADS)), small.shape, workers=THREADS) / max(
        float(np.vdot(part, part)), 1e-12
    )
    y, x = _tops(found, found > FAR_PEAK * MIN_OVERLAP, 2, "wrap")
    scores: dict[tuple[int, int], float] = {}
    for down in (y, y - height):
        for across in (x, x - width):
            shared = _shared(down, top, rows, height) * _shared(across, left, columns, width)
            far = (np.maximum(abs(down), abs(across)) * times > reach) & (shared > MIN_OVERLAP)
            share = found[y, x] / np.maximum(shared, MIN_OVERLAP)
            for k in np.flatnonzero(far & (share > FAR_PEAK) & (share < TOO_MUCH)):
                place = int(down[k]) * times, int(across[k]) * times
                place = max(place, (-place[0], -place[1]))  # one of two opposite ones
                # A picture of whole periods is like itself everywhere where it is continued with itself.
                scores[place[::-1]] = float(found[y[k], x[k]] * shared[k])
    best = sorted(scores, key=lambda p: -scores[p])[:MAX_FAR]
    return sorted(best, key=lambda p: math.hypot(*p))


def _tops(
    image: Image, among: Bools, near: int, beyond: Literal["wrap", "clip"]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pixels ``among`` (H, W) that are the largest within ``near`` px, by what is taken for ``beyond`` an edge."""
    y, x = np.nonzero(among)  # hardly any, as a rule
    flat = image.ravel()
    for down in range(-near, near + 1):
        for across in range(-near, near + 1):
            beside = flat[np.ravel_multi_index((y + down, x + across), image.shape, beyond)]
            top = image[y, x] >= beside
            y, x = y[top], x[top]
    return y, x


def _without_slow(image: Image, slowest: float) -> tuple[Image, NDArray[np.complex64]]:
    """A picture less all waves longer than ``slowest`` px, and its spectrum."""
    from scipy.fft import fftfreq, irfft2, rfft2, rfftfreq

    height, width = image.shape
    spectrum, some = rfft2(image, workers=THREADS), int(width / slowest) + 1
    spectrum[:, :some] *= np.hypot(fftfreq(height)[:, None], rfftfreq(width)[None, :some]) * slowest > 1
    return np.asarray(irfft2(spectrum, image.shape, workers=THREADS), np.float32), spectrum


def _shared(moved: NDArray[np.intp], first: int, length: int, whole: int) -> Floats:
    """Share of ``length`` px from ``first`` on that stays in ``whole`` px when it is ``moved``."""
    ends = np.minimum(first + length + moved, whole) - np.maximum(first + moved, 0)
    return np.asarray(np.maximum(ends, 0) / length)


def _firsts(first: int, length: int, side: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(first, first + length - side, math.ceil(length / side)).astype(np.intp))


class _Tile(NamedTuple):
    """What is the same for all tiles of one side.

    Attributes
    ----------
    window : (side, side) float32
        That of Hann.
    weight : float32
        Its sum.
    overlap : (reach + 1, 2 reach + 1) float32
        Its autocorrelation, down from 0 and across from -reach.
    far : the same of bool
        Displacements that are looked at: one of each pair of opposite ones, of ``SHORTEST_PX`` at least.
    """

    window: Image
    weight: np.float32
    overlap: Image
    far: NDArray[np.bool_]


@lru_cache(maxsize=1)
def _tile(side: int) -> _Tile:
    line = np.hanning(side + 2)[1:-1].astype(np.float32)
    window = np.outer(line, line)
    reach = int(REACH * side)
    down, across = np.meshgrid(np.arange(reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    far = (np.hypot(down, across) >= SHORTEST_PX) & ((down > 0) | (across > 0))
    return _Tile(window, window.sum(), _correlation(window[None])[0], far)


def _correlation(tiles: Image) -> Image:
    """Of tiles with themselves, (N, reach + 1, 2 reach + 1): down from 0 and across from -reach."""
    from scipy.fft import ifft, irfft, rfft2

    side = tiles.shape[2]
    reach = int(REACH * side)
    spectrum = rfft2(tiles)
    power = (spectrum.real**2 + spectrum.imag**2).astype(np.complex64)
    down = ifft(power, axis=1, norm="forward", overwrite_x=True)[:, : reach + 1]
    product = irfft(down, n=side, norm="forward") * np.float32(1 / np.longdouble(side * side))
    return np.concatenate([product[:, :, side - reach :], product[:, :, : reach + 1]], axis=2)


def _peaks(tiles: Image) -> list[list[tuple[int, int]]]:
    """The nearest side peaks (x, y) of the autocorrelation of tiles under a Hann window, over that of the window."""
    of = _tile(tiles.shape[2])
    means = np.multiply(tiles, of.window).reshape(len(tiles), -1).sum(axis=1) / of.weight
    shares = _correlation((tiles - means[:, None, None]) * of.window) / of.overlap
    reach, out = of.overlap.shape[0] - 1, []
    shares /= np.maximum(shares[:, :1, reach, None], np.float32(1e-12))
    for share in shares:
        y, x = _tops(share, (share > PEAK) & of.far, 1, "clip")  # most patterns do not repeat
        peaks = zip((x - reach).tolist(), y.tolist(), strict=True)
        out.append(sorted(peaks, key=lambda p: math.hypot(*p))[:MAX_PEAKS])
    return out
