"""A few frames of the still specimen, held for the check, and the region they are judged in."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.events import EventSink, ignore_event
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.printable import printable
from live.measure import averaged
from live.setup import DEFAULT_REFERENCE_BURST, Config, open_rig

FEWEST = 8  # frames
MOST_BYTES = 1_500_000_000
PIXELS_LOOKED_AT = 200_000  # of each frame, for light, bits and noise


@dataclass(frozen=True, slots=True, eq=False)
class Shots:
    """Frames in the order they came.

    Attributes
    ----------
    frames : (N, H, W) uint8 or uint16, GL
    times : (N,) float64, s
    lost : int
        Frames that the camera gave between the first and the last and that did not come whole.
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
        """Whether there are too few of them to tell what changes in time."""
        return len(self) < FEWEST

    @property
    def said(self) -> str:
        """How many, in words."""
        return f"{len(self)} picture{'s' if len(self) > 1 else ''}"

    def cut(self, rows: slice, columns: slice) -> Shots:
        """A part of each."""
        return replace(self, frames=self.frames[:, rows, columns])

    def mean(self, first: int = 0, count: int | None = None) -> Burst:
        """The frames from ``first`` as one burst; its noise and motion are not looked at here."""
        part = self.frames[first:] if count is None else self.frames[first : first + count]
        times = self.times[first : first + len(part)]
        mean = part.sum(axis=0, dtype=np.uint32) / len(part) if len(part) > 1 else part[0]
        return Burst(
            mean=frozen(mean.astype(np.float32)),
            n=len(part),
            noise=math.nan,
            clipped=frozen(part.max(axis=0) >= 2**self.camera.bits - 1),
            bits=self.camera.bits,
            t=float(times.mean()),
            duration=float(times[-1] - times[0]),
            first_index=first,
            last_index=first + len(part) - 1,
            lost=0,
            clock=self.camera.clock,
        )

    def pixels(self, inside: NDArray[np.bool_] | None = None) -> NDArray[Any]:
        """Some of the pixels ``inside`` (H, W) in every frame, (N, P): enough for light, bits and noise."""
        where = np.ones(self.frames.shape[1:], bool) if inside is None else inside
        index = np.flatnonzero(where)
        index = index[:: max(1, len(index) // PIXELS_LOOKED_AT)]
        return np.asarray(self.frames.reshape(len(self), -1)[:, index])

    def noise(self) -> float | None:
        """Temporal standard deviation of their mean, GL; None where they tell nothing."""
        return averaged(None if self.few else temporal_noise(self.pixels()) or None, len(self))


def temporal_noise(pixels: NDArray[Any]) -> float:
    """Standard deviation of one frame, GL, from pixels in all frames, (N, P).

    From successive differences, so that a slow drift of the light does not count; 0 where every
    frame is the same.
    """
    steps = [b.astype(np.float32) - a for a, b in itertools.pairwise(pixels)]
    return math.sqrt(float(np.mean([np.mean((step - step.mean()) ** 2) for step in steps])) / 2)


def take(config: Config, on_event: EventSink = ignore_event) -> Shots:
    """Twice as many frames as the reference has, so that one half can be measured against the other.

    A folder that has fewer is judged by what it has. Frames that are lost in between are counted.

    Raises
    ------
    DataError
        The camera gave too few frames.
    """
    reference = config.measure.reference_burst or DEFAULT_REFERENCE_BURST
    rig = open_rig(config.camera.address, "none:", on_event, crop=config.camera.crop)
    frames: list[Frame] = []
    lost = 0
    try:
        camera = rig.camera.info
        n = max(min(2 * reference, MOST_BYTES // (camera.width * camera.height * 2)), FEWEST)
        with rig.camera:
            for frame in rig.camera:
                lost += (frame.lost_before if frames else 0) + frame.damaged
                frames += [] if frame.damaged else [frame]
                if len(frames) == n:
                    break
    finally:
        rig.close()
    return taken(frames, camera, lost, config.camera.address)


def taken(frames: Sequence[Frame], camera: CameraInfo, lost: int, address: str) -> Shots:
    """Whole frames as what is judged: of a camera ``FEWEST`` at least, of pictures one; else DataError."""
    least = FEWEST if camera.live else 1
    if len(frames) < least:
        raise DataError(
            f"{printable(address)}: gave {len(frames)} whole frames, a check needs {least};"
            " look at the camera, or give more pictures"
        )
    return Shots(np.stack([f.image for f in frames]), np.array([f.t for f in frames]), lost, camera)
