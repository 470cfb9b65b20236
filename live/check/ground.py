"""Where a check looks: the region with its ZOIs, laid once for many glances, and frames on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.frame import Burst, CameraInfo
from analysis.picture import noise_of_picture
from live.check.shots import Shots, temporal_noise
from live.measure import Correction
from live.setup import DEFAULT_BURST, DEFAULT_REFERENCE_BURST, Config, correction, kernel_settings
from live.specimen import Region

if TYPE_CHECKING:
    from analysis import KernelSettings, ZoiGrid

Bools = NDArray[np.bool_]
Cut = tuple[slice, slice]

MARGIN = 24  # px around what is measured: a spline reaches so far


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A region with its ZOIs.

    Attributes
    ----------
    config : Config
    camera : CameraInfo
    region : Region
    grid : ZoiGrid
        On the whole picture.
    cut : (slice, slice)
        Rows and columns of the region with a margin; all below is cut to it.
    zois : ZoiGrid
        The same ZOIs.
    inside : (h, w) bool
        The region.
    at_zois : (H, W) bool
        The inner halves of its ZOIs, on the whole picture: where light and noise are judged.
    correct : callable
    """

    config: Config
    camera: CameraInfo
    region: Region
    grid: ZoiGrid
    cut: Cut
    zois: ZoiGrid
    inside: Bools
    at_zois: Bools
    correct: Correction

    @classmethod
    def of(cls, region: Region, config: Config, camera: CameraInfo) -> Ground:
        """Lay it; raises ConfigError or DataError where region, mask, dark or flat do not fit."""
        inside = region.inside(camera.width, camera.height, config.measure.zoi)
        grid, cut = region.grid(config, camera.width, camera.height), around(inside)
        correct = correction(config, camera, cut)
        at_zois = _inner_halves(grid, inside)
        return cls(config, camera, region, grid, cut, moved(grid, cut), inside[cut], at_zois, correct)


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """Frames on a ground, and how they are measured.

    Attributes
    ----------
    shots : Shots
    ground : Ground
    settings : KernelSettings
    picture : Burst
        What the pattern is judged by, cut and corrected: all frames, or the first of too few.
    raw : (h, w) float32, GL
        The same as it came.
    pixels : (N, P), GL
        Some at the ZOIs in every frame.
    noise : float, GL
        Of one frame: as stated, as it changes in time, or of too few frames from the spectrum of the picture.
    reference, burst : int
        Frames in each of the test; one where nothing is given and the pictures are few.
    """

    shots: Shots
    ground: Ground
    settings: KernelSettings
    picture: Burst
    raw: NDArray[np.float32]
    pixels: NDArray[Any]
    noise: float
    reference: int
    burst: int

    @classmethod
    def of(cls, shots: Shots, ground: Ground) -> Bench:
        """Look at the frames once."""
        m = ground.config.measure
        raw = shots.cut(*ground.cut).mean(0, 1 if shots.few else None)
        picture, pixels = ground.correct(raw), shots.pixels(ground.at_zois)
        if m.noise_GL is not None:
            noise = m.noise_GL
        else:
            noise = noise_of_picture(picture.mean) if shots.few else temporal_noise(pixels)
        reference = m.reference_burst or (1 if shots.few else DEFAULT_REFERENCE_BURST)
        burst, settings = m.burst or (1 if shots.few else DEFAULT_BURST), kernel_settings(ground.config)
        return cls(shots, ground, settings, picture, raw.mean, pixels, noise, reference, burst)

    @property
    def half(self) -> int:
        """Frames of the reference here."""
        return 1 if self.shots.few else len(self.shots) // 2

    def mean(self, first: int, count: int) -> Burst:
        """A corrected burst, cut to the region."""
        return self.ground.correct(self.shots.cut(*self.ground.cut).mean(first, count))

    def halves(self) -> tuple[Burst, Burst]:
        """The reference here and what is measured against it; of too few frames the first and itself."""
        first = self.mean(0, self.half)
        return first, first if self.shots.few else self.mean(self.half, self.half)


def around(inside: Bools) -> Cut:
    """Rows and columns of what is True in (H, W), with a margin; all where nothing is."""
    if not inside.any():
        return slice(0, inside.shape[0]), slice(0, inside.shape[1])
    spans = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    rows, columns = (slice(max(int(s[0]) - MARGIN, 0), int(s[-1]) + 1 + MARGIN) for s in spans)
    return rows, columns


def moved(grid: ZoiGrid, cut: Cut) -> ZoiGrid:
    """The same ZOIs on a picture that is cut."""
    from analysis import Roi, ZoiGrid

    roi, (rows, columns) = grid.roi, cut
    place = Roi(roi.x - columns.start, roi.y - rows.start, roi.width, roi.height)
    return ZoiGrid(place, grid.size, grid.step, grid.active)


def _inner_halves(grid: ZoiGrid, inside: Bools) -> Bools:
    """(H, W) bool: the middle of each active ZOI, half as wide; the region where there is none."""
    found = np.zeros(inside.shape, bool)
    half, quarter = grid.size // 2, grid.size // 4
    for row, column in np.argwhere(grid.active):
        top, left = grid.first_y[row] + quarter, grid.first_x[column] + quarter
        found[top : top + half, left : left + half] = True
    return found if found.any() else inside
