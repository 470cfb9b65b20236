"""Known truth for the paper reproduced: pictures that ``hw_mocks`` renders without interpolation, a camera model, and
the noise limit by the renderer's own gradient.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis import KernelSettings, PhaseKernel
from analysis.field import Roi, StrainField, ZoiGrid
from hw_mocks.deformation import Affine, Deformation, Gradient
from hw_mocks.speckle import Speckle
from live.setup.pattern.imposed import QUANTISATION
from tests.accuracy.limit import Limit, least_squares
from tests.paper.estimator import PaperEstimator, PaperField, PaperSettings

Floats = NDArray[np.float64]
Light = NDArray[np.float32]
Image = NDArray[Any]

SLOPE_STEP = 0.05  # px, of the renderer's shifts for the gradient


@dataclass(frozen=True, slots=True)
class Tiles:
    """Many single ZOIs in one picture, each in the middle of a tile of an even side ``pitch`` px."""

    pitch: int
    columns: int = 10
    rows: int = 6

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of the picture, px."""
        return self.rows * self.pitch, self.columns * self.pitch

    def grid(self, size: int) -> ZoiGrid:
        """One ZOI of an even size in the middle of each tile."""
        edge = (self.pitch - size) // 2
        width, height = (self.columns - 1) * self.pitch + size, (self.rows - 1) * self.pitch + size
        return ZoiGrid.cover(Roi(edge, edge, width, height), size, self.pitch)


@dataclass(frozen=True, slots=True)
class TiledStrain:
    """The same affine deformation of every tile about its own centre: no rigid displacement of any ZOI."""

    pitch: int
    du_dx: float = 0.0
    du_dy: float = 0.0
    dv_dx: float = 0.0
    dv_dy: float = 0.0

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """See ``hw_mocks.deformation.Deformation``."""
        dx, dy = self._from_centre(x), self._from_centre(y)
        return self.du_dx * dx + self.du_dy * dy, self.dv_dx * dx + self.dv_dy * dy

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """See ``hw_mocks.deformation.Deformation``."""
        return Affine(0, 0, self.du_dx, self.du_dy, self.dv_dx, self.dv_dy).gradient(x, y)

    def _from_centre(self, positions: ArrayLike) -> Floats:
        positions = np.asarray(positions, float)
        return np.asarray((positions + 0.5) % self.pitch - self.pitch / 2)


@dataclass(frozen=True, slots=True)
class SensorModel:
    """A sensor: encoding, and white noise before rounding, standard deviation in GL."""

    bits: int
    noise: float = 0.0

    @property
    def top(self) -> int:
        """Full scale, GL."""
        return int(2**self.bits) - 1

    @property
    def sigma(self) -> float:
        """Standard deviation of one picture, rounding included, GL."""
        return math.sqrt(self.noise**2 + QUANTISATION)

    def picture(self, light: NDArray[Any], rng: np.random.Generator) -> Image:
        """One frame of ``light`` (H, W), part of full scale; uint8 or uint16."""
        levels = light * np.float32(self.top)
        if self.noise:
            levels = levels + np.float32(self.noise) * rng.standard_normal(light.shape, np.float32)
        return np.clip(np.rint(levels), 0, self.top).astype(np.uint8 if self.bits <= 8 else np.uint16)


class TrueScene:
    """A speckle pattern (radius in px), its pictures of ``shape`` (H, W) and its exact gradient."""

    def __init__(self, shape: tuple[int, int], radius: float, seed: int) -> None:
        self.speckle = Speckle(shape, radius, seed=seed)
        self.rng = np.random.default_rng(1000 + seed)

    @cached_property
    def reference(self) -> Light:
        """(H, W), part of full scale."""
        return self.speckle.reference()

    def light(self, deformation: Deformation) -> Light:
        """The deformed pattern, (H, W), part of full scale."""
        return self.speckle.fast(deformation)

    def pair(self, deformation: Deformation, camera: SensorModel) -> tuple[Image, Image]:
        """Reference and deformed picture with independent noise."""
        return camera.picture(self.reference, self.rng), camera.picture(self.light(deformation), self.rng)

    @cached_property
    def slopes(self) -> tuple[Floats, Floats]:
        """Exact gradient along x and y, (H, W) each, part of full scale per px."""
        h, fast = SLOPE_STEP, self.speckle.fast
        along_x = (fast(Affine(-h)).astype(float) - fast(Affine(h))) / (2 * h)
        along_y = (fast(Affine(0, -h)).astype(float) - fast(Affine(0, h))) / (2 * h)
        return np.asarray(along_x, float), np.asarray(along_y, float)


def limit(
    slopes: tuple[Floats, Floats],
    grid: ZoiGrid,
    sigma_w: float,
    field: tuple[Floats, Floats] | None = None,
) -> Limit:
    """Noise limit and window response of a Gaussian weight, sigma_w in px."""
    x = np.arange(grid.size) - (grid.size - 1) / 2
    return least_squares(slopes, grid.first_x, grid.first_y, np.exp(-0.5 * (x / sigma_w) ** 2), field)


def ours(
    pair: tuple[Image, Image], grid: ZoiGrid, noise: float | None, settings: KernelSettings | None = None
) -> StrainField:
    """The field of the kernel, by default with its default settings; ``noise`` GL of either picture."""
    return PhaseKernel(pair[0], grid, settings, noise=noise).measure(pair[1], noise=noise)


def papers(pair: tuple[Image, Image], grid: ZoiGrid, settings: PaperSettings | None = None) -> PaperField:
    """The field of the paper's estimator, by default without iteration."""
    return PaperEstimator(pair[0], grid, settings).measure(pair[1])
