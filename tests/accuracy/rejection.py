"""Pictures in which some ZOIs cannot be right: cracks, holes, edges, blur, glare, occlusion.

Each case gives a reference, a deformed picture and the true displacement; boundaries are blended over
one pixel, as a lens and a pixel do. Counted: wrong ZOIs that were accepted, and good ones rejected.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, Status, ZoiGrid
from tests.accuracy.truth import Speckle, digitise, pixels

SHAPE = (512, 512)
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """Levels 0..1, the true displacement at (x, y), and where a ZOI of half side h contains the trouble."""

    reference: Array
    deformed: Array
    u: Callable[[Array, Array], Array]
    v: Callable[[Array, Array], Array]
    touched: Callable[[Array, Array, float], Array]


def _blend(depth: Array, inside: Array | float, outside: Array) -> Array:
    share = np.clip(depth + 0.5, 0, 1)
    return share * inside + (1 - share) * outside


def _moved(s: Speckle, x: Array, y: Array) -> Array:
    return s.at(x - 0.4, y + 0.3)


def _u(x: Array, y: Array) -> Array:
    return np.full_like(x, 0.4)


def _v(x: Array, y: Array) -> Array:
    return np.full_like(x, -0.3)


def crack(opening: float, slip: float) -> Callable[..., Scene]:
    """Along y = 0, its two sides moving apart and past one another; the gap is dark."""

    def scene(s: Speckle, x: Array, y: Array) -> Scene:
        upper = s.at(x - 0.3 + slip / 2, y + opening / 2 + 0.2)
        lower = s.at(x - 0.3 - slip / 2, y - opening / 2 + 0.2)
        if opening:
            lower = _blend(y - opening / 2 + 0.2, lower, np.full_like(x, 0.1))
        deformed = _blend(-(y + opening / 2 + 0.2), upper, lower)
        return Scene(
            s.at(x, y),
            deformed,
            lambda a, b: 0.3 + np.where(b < 0, -1, 1) * slip / 2,
            lambda a, b: np.where(b < 0, -1, 1) * opening / 2 - 0.2,
            lambda a, b, h: np.abs(b) < h,
        )

    return scene


def hole(s: Speckle, x: Array, y: Array) -> Scene:
    """A hole through which a still background shows; a ZOI centred in it has no right value."""
    still = Speckle(3.0, 9).at(x, y) * 0.3
    mx = (x - 0.4) / 1.01
    return Scene(
        _blend(60 - np.hypot(x, y), still, s.at(x, y)),
        _blend(60 - np.hypot(mx, y), still, s.at(mx, y)),
        lambda a, b: np.where(np.hypot(a, b) < 60, np.nan, 0.01 * a + 0.4),
        lambda a, b: 0 * a,
        lambda a, b, h: np.abs(np.hypot(a, b) - 60) < 1.42 * h,
    )


def edge(s: Speckle, x: Array, y: Array) -> Scene:
    """The edge of a specimen before another still pattern."""
    still = Speckle(2.0, 5).at(x, y)
    return Scene(
        _blend(-100 - x, still, s.at(x, y)),
        _blend(-100 - x + 2.3, still, s.at(x - 2.3, y)),
        lambda a, b: np.where(a < -100, 0, 2.3),
        lambda a, b: 0 * a,
        lambda a, b, h: np.abs(a + 100) < h + 3,
    )


def occlusion(s: Speckle, x: Array, y: Array) -> Scene:
    """Something with a pattern of its own before the specimen."""
    depth = np.minimum(70 - np.abs(x - 40), 50 - np.abs(y + 30))
    return Scene(
        s.at(x, y),
        _blend(depth, Speckle(2.5, 77).at(x, y), _moved(s, x, y)),
        _u,
        _v,
        lambda a, b, h: (np.abs(a - 40) < 70 + h) & (np.abs(b + 30) < 50 + h),
    )


def blur(s: Speckle, x: Array, y: Array) -> Scene:
    """One side far out of focus."""
    sharp = _moved(s, x, y)
    share = 1 / (1 + np.exp(-x / 30))
    soft = cv2.GaussianBlur(sharp, (0, 0), 6)
    return Scene(s.at(x, y), sharp * (1 - share) + soft * share, _u, _v, lambda a, b, h: a > -60 - h)


def glare(s: Speckle, x: Array, y: Array) -> Scene:
    """A reflection that saturates."""
    light = 1.5 * np.exp(-((x - 60) ** 2 + (y - 40) ** 2) / (2 * 50**2))
    return Scene(
        s.at(x, y), np.clip(_moved(s, x, y) + light, 0, 1), _u, _v,
        lambda a, b, h: np.hypot(a - 60, b - 40) < 130 + h,
    )  # fmt: skip


def saturation(s: Speckle, x: Array, y: Array) -> Scene:
    """One side over-exposed."""
    light = 1 + 0.9 / (1 + np.exp(-x / 30))
    return Scene(s.at(x, y), np.clip(_moved(s, x, y) * light, 0, 1), _u, _v, lambda a, b, h: a > -90 - h)


def featureless(s: Speckle, x: Array, y: Array) -> Scene:
    """A patch without pattern."""
    return Scene(
        _blend(90 - np.hypot(x + 80, y - 50), 0.5, s.at(x, y)),
        _blend(90 - np.hypot(x - 0.4 + 80, y + 0.3 - 50), 0.5, _moved(s, x, y)),
        _u, _v,
        lambda a, b, h: np.hypot(a + 80, b - 50) < 90 + 1.42 * h,
    )  # fmt: skip


CASES: dict[str, Callable[..., Scene]] = {
    "crack, opening 1 px": crack(1.0, 0.0),
    "crack, opening 0.3 px": crack(0.3, 0.2),
    "crack, opening 5 px": crack(5.0, 0.0),
    "slip line, 1.5 px": crack(0.0, 1.5),
    "hole": hole,
    "edge": edge,
    "occlusion": occlusion,
    "blur": blur,
    "glare": glare,
    "saturation": saturation,
    "featureless patch": featureless,
}


@dataclass(frozen=True)
class Count:
    """ZOIs: wrong and accepted, rejected where the trouble is, rejected elsewhere, elsewhere in all."""

    accepted: int = 0
    flagged: int = 0
    good_rejected: int = 0
    good: int = 0

    def __add__(self, other: Count) -> Count:
        return Count(
            self.accepted + other.accepted, self.flagged + other.flagged,
            self.good_rejected + other.good_rejected, self.good + other.good,
        )  # fmt: skip


def count(name: str, radius: float, size: int, noise: float, step: int = 8) -> Count:
    """Measure one case with 8 bits and count."""
    rng = np.random.default_rng(3)
    scene = CASES[name](Speckle(radius), *pixels(SHAPE))
    images = [digitise(level, 8, noise, rng) for level in (scene.reference, scene.deformed)]
    grid = ZoiGrid.cover(Roi(8, 8, SHAPE[1] - 16, SHAPE[0] - 16), size, step)
    sigma = float(np.hypot(noise * 255, 0.29))
    field = PhaseKernel(images[0], grid, noise=sigma, clipped=images[0] >= 255).measure(
        images[1], noise=sigma, clipped=images[1] >= 255
    )
    x, y = np.meshgrid(grid.x - (SHAPE[1] - 1) / 2, grid.y - (SHAPE[0] - 1) / 2)
    error = np.hypot(field.u - scene.u(x, y), field.v - scene.v(x, y))
    wrong = field.ok & (error > 5 * np.hypot(field.sigma_u, field.sigma_v) / np.sqrt(2)) & (error > 0.05)
    touched = scene.touched(x, y, size / 2)
    rejected = ~field.ok & (field.status != Status.OUTSIDE)
    return Count(
        int(wrong.sum()), int((rejected & touched).sum()),
        int((rejected & ~touched).sum()), int((~touched).sum()),
    )  # fmt: skip
