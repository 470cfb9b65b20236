"""The measurements behind the tables: imposed motions on analytic speckle, errors of every ZOI."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from tests.accuracy.truth import Speckle, affine, digitise

SHAPE = (512, 512)
MARGIN = 24
NAMES = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")


@lru_cache(maxsize=64)
def level(radius: float, seed: int = 1, **motion: float) -> NDArray[np.float64]:
    """The noise-free picture of a pattern after a uniform motion, 0..1."""
    return Speckle(radius, seed).at(*affine(SHAPE, **motion))


def grid(size: int, step: int | None = None) -> ZoiGrid:
    side = SHAPE[0] - 2 * MARGIN
    return ZoiGrid.cover(Roi(MARGIN, MARGIN, side, side), size, step or size // 2)


def truth(zois: ZoiGrid, name: str, **m: float) -> NDArray[np.float64]:
    """The imposed value at the centres of the ZOIs."""
    x, y = np.meshgrid(zois.x - (SHAPE[1] - 1) / 2, zois.y - (SHAPE[0] - 1) / 2)
    if name in ("u", "v"):
        return m.get(name, 0.0) + m.get(f"d{name}_dx", 0.0) * x + m.get(f"d{name}_dy", 0.0) * y
    return np.full(zois.shape, m.get(name, 0.0))


@dataclass(frozen=True)
class Errors:
    """Errors (value - truth) and predicted sigmas of all ZOIs and pairs, by name; share of valid ZOIs."""

    error: dict[str, NDArray[np.float64]]
    sigma: dict[str, NDArray[np.float64]]
    valid: float

    def mean(self, name: str) -> float:
        return float(np.nanmean(self.error[name]))

    def scatter(self, name: str) -> float:
        return float(np.nanstd(self.error[name]))


def errors(fields: list[tuple[StrainField, dict[str, float]]]) -> Errors:
    error: dict[str, list] = {n: [] for n in NAMES}
    sigma: dict[str, list] = {n: [] for n in NAMES}
    for field, motion in fields:
        for n in NAMES:
            error[n].append(getattr(field, n) - truth(field.grid, n, **motion))
            sigma[n].append(getattr(field, f"sigma_{n}"))
    valid = float(np.mean([f.ok[f.grid.active].mean() for f, _ in fields]))
    return Errors(
        {n: np.stack(e) for n, e in error.items()}, {n: np.stack(s) for n, s in sigma.items()}, valid
    )


def measure(
    radius: float, size: int, motions: list[dict[str, float]], bits: int = 12, noise: float = 0.0,
    settings: KernelSettings | None = None, step: int | None = None, pairs: int = 1,
) -> list[Errors]:  # fmt: skip
    """One ``Errors`` a motion. With noise each motion is measured ``pairs`` times, both images drawn anew."""
    rng = np.random.default_rng(int(1000 * radius) + size)
    zois, full = grid(size, step), 2**bits - 1
    given = noise * full if noise else None
    kernels = [
        PhaseKernel(digitise(level(radius), bits, noise, rng), zois, settings, given) for _ in range(pairs)
    ]
    out = []
    for motion in motions:
        frames = [digitise(level(radius, **motion), bits, noise, rng) for _ in kernels]
        out.append(
            errors([(k.measure(f, noise=given), motion) for k, f in zip(kernels, frames, strict=True)])
        )
    return out
