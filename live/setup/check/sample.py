"""The sample of a check: frames of the still specimen, and the region with its ZOIs in which they are judged."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.events import EventSink, ignore_event
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.text.message import printable
from analysis.picture.pattern import noise_of_picture
from live.config.loading import Config
from live.config.sections import DEFAULT_BURST, DEFAULT_REFERENCE_BURST
from live.pipeline.reference import Correction, averaged
from live.setup.grid import kernel_settings
from live.setup.pictures import camera_of, correction, frames_of
from live.setup.region import Region

if TYPE_CHECKING:
    from analysis import KernelSettings, ZoiGrid

Bools = NDArray[np.bool_]
Cut = tuple[slice, slice]

MIN_FRAMES = 8
"""Frames of a check of what changes in time; recorded pictures can be fewer."""
MAX_BYTES = 1_500_000_000  # of frames
MAX_PIXELS = 200_000  # of each frame, for light, bits and noise
MARGIN = 24  # px around the region: the range of the spline


@dataclass(frozen=True, slots=True, eq=False)
class FrameStack:
    """Frames in their order.

    Attributes
    ----------
    frames : (N, H, W) uint8 or uint16, GL
    times : (N,) float64, s
    lost : int
        Lost or damaged frames between the first and the last.
    camera : CameraInfo
    """

    frames: NDArray[Any]
    times: NDArray[np.float64]
    lost: int
    camera: CameraInfo

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def few(self) -> bool:
        """Whether there are too few frames for figures of what changes in time."""
        return len(self) < MIN_FRAMES

    @property
    def count_text(self) -> str:
        """The number of pictures as text."""
        return f"{len(self)} picture{'s' if len(self) > 1 else ''}"

    def cut(self, rows: slice, columns: slice) -> FrameStack:
        """These rows and columns of each frame."""
        return replace(self, frames=self.frames[:, rows, columns])

    def mean(self, first: int = 0, count: int | None = None) -> Burst:
        """The frames from ``first`` as one burst, without its noise and motion."""
        part = self.frames[first:] if count is None else self.frames[first : first + count]
        times = self.times[first : first + len(part)]
        mean = part.sum(axis=0, dtype=np.uint32) / len(part) if len(part) > 1 else part[0]
        return Burst(
            mean=frozen(mean.astype(np.float32)),
            n=len(part),
            noise=math.nan,
            clipped=frozen(part.max(axis=0) >= self.camera.saturation),
            bits=self.camera.bits,
            t=float(times.mean()),
            duration=float(times[-1] - times[0]),
            first_index=first,
            last_index=first + len(part) - 1,
            lost=0,
            clock=self.camera.clock,
        )

    def pixels(self, inside: NDArray[np.bool_] | None = None) -> NDArray[Any]:
        """Some of the pixels ``inside`` (H, W) of every frame, (N, P): enough for light, bits and noise."""
        where = np.ones(self.frames.shape[1:], bool) if inside is None else inside
        index = np.flatnonzero(where)
        index = index[:: max(1, len(index) // MAX_PIXELS)]
        return np.asarray(self.frames.reshape(len(self), -1)[:, index])

    def noise(self) -> float | None:
        """Temporal standard deviation of the mean of the frames, GL; None if they are too few or all the same."""
        return averaged(None if self.few else temporal_noise(self.pixels()) or None, len(self))


def temporal_noise(pixels: NDArray[Any]) -> float:
    """Standard deviation of one frame, GL, from pixels in all frames, (N, P).

    From successive differences, so that a slow drift of the light does not count; 0 if all frames
    are the same.
    """
    steps = [b.astype(np.float32) - a for a, b in itertools.pairwise(pixels)]
    return math.sqrt(float(np.mean([np.mean((step - step.mean()) ** 2) for step in steps])) / 2)


def take(config: Config, on_event: EventSink = ignore_event) -> FrameStack:
    """Take twice as many frames as the reference, so that one half can be measured against the other.

    A folder with fewer pictures gives all of them. Frames lost in between are counted.

    Raises
    ------
    DataError
        The camera gave too few frames.
    DeviceError
        See ``frames_of``.
    """
    reference = config.measure.reference_burst or DEFAULT_REFERENCE_BURST
    frames: list[Frame] = []
    lost = 0
    with camera_of(config.camera.address, on_event, crop=config.camera.crop) as camera:
        n = max(min(2 * reference, MAX_BYTES // (camera.info.width * camera.info.height * 2)), MIN_FRAMES)
        for frame in frames_of(camera):
            lost += (frame.lost_before if frames else 0) + frame.damaged
            frames += [] if frame.damaged else [frame]
            if len(frames) == n:
                break
    return stack_of(frames, camera.info, lost, config.camera.address)


def stack_of(frames: Sequence[Frame], camera: CameraInfo, lost: int, address: str) -> FrameStack:
    """Whole frames as a stack; DataError for fewer than ``MIN_FRAMES`` of a live camera, or none of pictures."""
    needed = MIN_FRAMES if camera.live else 1
    if len(frames) < needed:
        raise DataError(
            "{address}: gave {n} whole frames, a check needs {needed}; look at the camera, or give more pictures",
            printable(address),
            len(frames),
            needed,
        )
    return FrameStack(np.stack([f.image for f in frames]), np.array([f.t for f in frames]), lost, camera)


@dataclass(frozen=True, slots=True, eq=False)
class CheckRegion:
    """A region with its ZOIs, for any number of samples.

    Attributes
    ----------
    config : Config
    camera : CameraInfo
    region : Region
    grid : ZoiGrid
        On the whole picture.
    cut : (slice, slice)
        Rows and columns of the region with a margin; ``zois`` and ``inside`` are cut to it.
    zois : ZoiGrid
        The same ZOIs on the cut.
    inside : (h, w) bool
        The region.
    at_zois : (H, W) bool
        The inner halves of the ZOIs on the whole picture: the pixels for light and noise.
    correct : callable
        Corrects the fixed pattern of the sensor in a cut burst.
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
    def of(cls, region: Region, config: Config, camera: CameraInfo) -> CheckRegion:
        """Place the ZOIs; raises ConfigError or DataError if region, mask, dark or flat frame do not fit."""
        inside = region.inside(camera.width, camera.height, config.measure.zoi)
        grid, cut = region.grid(config, camera.width, camera.height), around(inside)
        correct = correction(config, camera, cut)
        at_zois = _inner_halves(grid, inside)
        return cls(config, camera, region, grid, cut, moved(grid, cut), inside[cut], at_zois, correct)


@dataclass(frozen=True, slots=True, eq=False)
class CheckSample:
    """Frames on a region, with the settings of the measurement.

    Attributes
    ----------
    stack : FrameStack
    check_region : CheckRegion
    settings : KernelSettings
    picture : Burst
        The picture of the pattern, cut and corrected: the mean of all frames, or the first of too few.
    raw : (h, w) float32, GL
        The same without correction.
    pixels : (N, P), GL
        Some pixels at the ZOIs of every frame.
    noise : float, GL
        Of one frame: as given, from the changes in time, or of too few frames from the spectrum of the picture.
    reference, burst : int
        Frames in each, for the test; by default one if the pictures are few.
    """

    stack: FrameStack
    check_region: CheckRegion
    settings: KernelSettings
    picture: Burst
    raw: NDArray[np.float32]
    pixels: NDArray[Any]
    noise: float
    reference: int
    burst: int

    @classmethod
    def of(cls, stack: FrameStack, check_region: CheckRegion) -> CheckSample:
        """The sample of these frames."""
        m = check_region.config.measure
        raw = stack.cut(*check_region.cut).mean(0, 1 if stack.few else None)
        picture, pixels = check_region.correct(raw), stack.pixels(check_region.at_zois)
        if m.noise_GL is not None:
            noise = m.noise_GL
        else:
            noise = noise_of_picture(picture.mean) if stack.few else temporal_noise(pixels)
        reference = m.reference_burst or (1 if stack.few else DEFAULT_REFERENCE_BURST)
        burst, settings = m.burst or (1 if stack.few else DEFAULT_BURST), kernel_settings(check_region.config)
        return cls(stack, check_region, settings, picture, raw.mean, pixels, noise, reference, burst)

    @property
    def half(self) -> int:
        """Frames of the reference of the check."""
        return 1 if self.stack.few else len(self.stack) // 2

    def mean(self, first: int, count: int) -> Burst:
        """A corrected burst, cut to the region."""
        return self.check_region.correct(self.stack.cut(*self.check_region.cut).mean(first, count))

    def halves(self) -> tuple[Burst, Burst]:
        """The reference of the check and the burst measured against it; of too few frames the first twice."""
        first = self.mean(0, self.half)
        return first, first if self.stack.few else self.mean(self.half, self.half)


def around(inside: Bools) -> Cut:
    """Rows and columns of the True part of (H, W), with a margin; all if nothing is True."""
    if not inside.any():
        return slice(0, inside.shape[0]), slice(0, inside.shape[1])
    spans = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    rows, columns = (slice(max(int(s[0]) - MARGIN, 0), int(s[-1]) + 1 + MARGIN) for s in spans)
    return rows, columns


def moved(grid: ZoiGrid, cut: Cut) -> ZoiGrid:
    """The same ZOIs on a cut picture."""
    from analysis import Roi, ZoiGrid

    roi, (rows, columns) = grid.roi, cut
    cut_roi = Roi(roi.x - columns.start, roi.y - rows.start, roi.width, roi.height)
    return ZoiGrid(cut_roi, grid.size, grid.step, grid.active)


def _inner_halves(grid: ZoiGrid, inside: Bools) -> Bools:
    """(H, W) bool: the middle of each active ZOI, half as wide; the region if there is no ZOI."""
    found = np.zeros(inside.shape, bool)
    half, quarter = grid.size // 2, grid.size // 4
    for row, column in np.argwhere(grid.active):
        top, left = grid.first_y[row] + quarter, grid.first_x[column] + quarter
        found[top : top + half, left : left + half] = True
    return found if found.any() else inside
