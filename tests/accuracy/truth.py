"""Speckle images of known deformation: evaluated analytically, never interpolated.

Blobs ``a exp(-rho^2 / (2 r^2))`` of random sign stand on a jittered lattice; an image is the sum of
those blobs at the material point that each pixel shows. Independent of ``analysis``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

Array = NDArray[np.float64]
CONTRAST = 0.18
SPACING = 2.2
JITTER = 0.25


@dataclass(frozen=True)
class Speckle:
    """A pattern of unlimited extent (within +-span px); intensities are shares of full scale.

    ``blur`` is the standard deviation of a Gaussian that blurs it, px: a blob stays one, wider and weaker.
    """

    radius: float
    seed: int = 0
    span: int = 1400
    blur: float = 0.0

    def at(self, x: Array, y: Array) -> Array:
        """The pattern at material points, values in 0..1, mean 0.5, std 0.18."""
        spacing = SPACING * self.radius
        cells = int(2 * self.span / spacing)
        rng = np.random.default_rng(self.seed)
        shift = rng.uniform(-JITTER, JITTER, (cells, cells, 2))
        sign = rng.choice([-1.0, 1.0], (cells, cells)) * rng.uniform(0.9, 1.1, (cells, cells))
        wide = float(np.hypot(self.radius, self.blur))
        out = _sum_blobs(np.ascontiguousarray(x), np.ascontiguousarray(y), spacing, wide, shift, sign)
        out *= (self.radius / wide) ** 2
        mean_square = np.mean(sign**2) * np.pi / SPACING**2
        return 0.5 + CONTRAST * out / np.sqrt(mean_square)


@njit(parallel=True, cache=True)
def _sum_blobs(x, y, spacing, radius, shift, sign):
    out = np.zeros(x.shape)
    half = sign.shape[0] // 2
    reach = 3
    for i in prange(x.shape[0]):
        for j in range(x.shape[1]):
            px = x[i, j] / spacing + half
            py = y[i, j] / spacing + half
            cx = int(np.floor(px))
            cy = int(np.floor(py))
            total = 0.0
            for a in range(cy - reach, cy + reach + 1):
                for b in range(cx - reach, cx + reach + 1):
                    dx = (px - b - 0.5 - shift[a, b, 0]) * spacing / radius
                    dy = (py - a - 0.5 - shift[a, b, 1]) * spacing / radius
                    d2 = dx * dx + dy * dy
                    if d2 < 40.0:
                        total += sign[a, b] * np.exp(-0.5 * d2)
            out[i, j] = total
    return out


def pixels(shape: tuple[int, int]) -> tuple[Array, Array]:
    """Pixel coordinates (x, y) with the origin at the middle of the image."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    return x - (shape[1] - 1) / 2, y - (shape[0] - 1) / 2


def affine(shape: tuple[int, int], u=0.0, v=0.0, du_dx=0.0, du_dy=0.0, dv_dx=0.0, dv_dy=0.0):
    """Material points seen by each pixel after x -> x + (u, v) + grad x, about the image's middle."""
    x, y = pixels(shape)
    inverse = np.linalg.inv([[1 + du_dx, du_dy], [dv_dx, 1 + dv_dy]])
    return (
        inverse[0, 0] * (x - u) + inverse[0, 1] * (y - v),
        inverse[1, 0] * (x - u) + inverse[1, 1] * (y - v),
    )


def field(shape: tuple[int, int], displacement: Callable[[Array, Array], tuple[Array, Array]]):
    """Material points seen by each pixel for any smooth displacement, by fixed-point iteration."""
    x, y = pixels(shape)
    mx, my = x.copy(), y.copy()
    for _ in range(60):
        u, v = displacement(mx, my)
        mx, my = x - u, y - v
    return mx, my


def digitise(
    level: Array, bits: int | None, noise: float = 0.0, rng: np.random.Generator | None = None
) -> NDArray:
    """Grey levels of a camera: full scale 2**bits - 1, noise as a share of it; bits None: float, 12 bit."""
    full = 2 ** (bits or 12) - 1
    image = level * full
    if noise:
        assert rng is not None
        image = image + rng.normal(0, noise * full, level.shape)
    if bits is None:
        return image.astype(np.float32)
    return np.clip(np.rint(image), 0, full).astype(np.uint8 if bits <= 8 else np.uint16)
