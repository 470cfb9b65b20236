"""How often the truth lies within one and two sigma where noise is not white, or the strain is large.

Sample 5 of the DIC Challenge 1.0 (needs PHASEDIC_DATA): a part of its noise moves with the pattern. A fixed pattern as
of dust stands still under a specimen that moves. In steps of half a ZOI the six values of each are nearly independent.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, StrainField, ZoiGrid
from tests.accuracy.truth import Speckle, affine, pixels

Array = NDArray[np.float64]

SAMPLE5 = "dic_challenge_1_sample5"
MOVED_PX = {"Sample5-000 X0.00 Y0.00 N2 C75 R10.tif": 0.0, "Sample5-001 X0.10 Y0.10 N2 C100 R20.tif": 0.1}
SHAPE = (480, 480)
DUST_GL, DUST_PX = 2.0, 3.0
WITHIN = (0.65, 0.71), (0.94, 0.97)
CAUTIOUS = 0.01
"""How much more than that may be within one sigma: 72 % are where the picture has 0.45 of the contrast of its
reference, of which the filter leaves fine pattern that moves u and v less than noise would."""
NAMES = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")


@dataclass(frozen=True)
class Coverage:
    """Share of the truth within one and two sigma, and the number of values."""

    one: float
    two: float
    values: int

    @property
    def holds(self) -> bool:
        """Within the limits, widened by twice the standard error."""
        return all(
            low - 2 * self._error(low) <= share <= high + more + 2 * self._error(high)
            for share, (low, high), more in zip((self.one, self.two), WITHIN, (CAUTIOUS, 0), strict=True)
        )

    def _error(self, share: float) -> float:
        return float(np.sqrt(share * (1 - share) / self.values))


def coverage(fields: list[StrainField], truth: dict[str, Array | float]) -> Coverage:
    """Of u, v and the gradients of all fields; what ``truth`` does not name is 0."""
    off = [
        np.abs((f.value(n) - truth.get(n, 0.0)) / f.sigma(n))[f.ok] for f in fields for n in NAMES
    ]  # fmt: skip
    every = np.concatenate(off)
    return Coverage(float(np.mean(every < 1)), float(np.mean(every < 2)), len(every))


def cases(folder: Path | None, quick: bool) -> Iterator[tuple[str, int, Coverage]]:
    """What was found by case and size of the ZOI."""
    for size in (32,) if quick else (32, 64):
        if folder is not None:
            for file, moved in MOVED_PX.items():
                yield file.removesuffix(".tif"), size, _sample5(folder / SAMPLE5, file, moved, size)
        for grain in (0.0, 1.5):
            name = f"fixed pattern of {DUST_GL:g} GL, grains of {grain:g} px"
            yield name, size, _dust(size, grain, 1 if quick else 4)
    for strain in (0.2, 0.5):
        for noise in (1.0, 2.0):
            yield (
                f"{100 * strain:g} % of strain, {noise:g} GL",
                48,
                _stretched(strain, noise, 1 if quick else 6),
            )


def _sample5(folder: Path, file: str, moved: float, size: int) -> Coverage:
    first, second = (
        cv2.imread(str(folder / n), cv2.IMREAD_GRAYSCALE) for n in ("Sample5 Reference.tif", file)
    )
    assert first is not None and second is not None
    grid = ZoiGrid.cover(Roi(8, 8, 496, 496), size, size // 2)
    return coverage([PhaseKernel(first, grid).measure(second)], {"u": moved, "v": moved})


def _stored(level: Array) -> NDArray[np.uint8]:
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)


def _dust(size: int, grain: float, pairs: int) -> Coverage:
    still, moved = (255 * Speckle(2.0, 1).at(*affine(SHAPE, u=u)) for u in (0.0, DUST_PX))
    grid, fields = ZoiGrid.cover(Roi(16, 16, 448, 448), size, size // 2), []
    for seed in range(pairs):
        rng = np.random.default_rng(seed)
        dust = rng.normal(0, 1, SHAPE)
        dust = cv2.GaussianBlur(dust, (0, 0), grain) if grain else dust
        dust *= DUST_GL / dust.std()
        first, second = (_stored(level + dust + rng.normal(0, 0.5, SHAPE)) for level in (still, moved))
        fields.append(PhaseKernel(first, grid).measure(second))
    return coverage(fields, {"u": DUST_PX})


def _stretched(strain: float, noise: float, pairs: int) -> Coverage:
    motion = {"du_dx": strain, "dv_dy": -0.3 * strain}
    still, moved = (
        255 * Speckle(2.5, 1).at(*pixels(SHAPE)),
        255 * Speckle(2.5, 1).at(*affine(SHAPE, **motion)),
    )
    grid = ZoiGrid.cover(Roi(90, 90, 300, 300), 48, 24)
    x, y = np.meshgrid(grid.x - (SHAPE[1] - 1) / 2, grid.y - (SHAPE[0] - 1) / 2)
    truth: dict[str, Array | float] = {"u": strain * x, "v": -0.3 * strain * y, **motion}
    start = StrainField.from_values(grid, truth)
    fields, stated = [], float(np.hypot(noise, 12**-0.5))
    for seed in range(pairs):
        rng = np.random.default_rng(seed)
        first, second = (_stored(level + rng.normal(0, noise, SHAPE)) for level in (still, moved))
        fields.append(PhaseKernel(first, grid, noise=stated).measure(second, start=start, noise=stated))
    return coverage(fields, truth)
