"""A few frames of the still specimen, held for the check, and the region they are judged in."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.events import EventSink, ignore_event
from acquire.frame import Burst, CameraInfo, Frame, frozen
from live.setup import DEFAULT_REFERENCE_BURST, Config, open_rig

FEWEST = 8  # frames
MOST_BYTES = 1_500_000_000


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

    def mean(self, first: int = 0, count: int | None = None) -> Burst:
        """The frames from ``first`` as one burst; its noise and motion are not looked at here."""
        part = self.frames[first:] if count is None else self.frames[first : first + count]
        clipped = (part >= 2**self.camera.bits - 1).any(axis=0)
        times = self.times[first : first + len(part)]
        return Burst(
            mean=frozen(part.mean(axis=0, dtype=np.float64).astype(np.float32)),
            n=len(part),
            noise=math.nan,
            clipped=frozen(clipped),
            bits=self.camera.bits,
            t=float(times.mean()),
            duration=float(times[-1] - times[0]),
            first_index=first,
            last_index=first + len(part) - 1,
            lost=0,
            clock=self.camera.clock,
        )

    def noise(self, inside: NDArray[np.bool_] | None = None) -> float:
        """Temporal standard deviation of one frame, GL, over the pixels ``inside`` (H, W).

        From successive differences, so that a slow drift of the light does not count; 0 where every
        frame is the same.
        """
        where = np.ones(self.frames.shape[1:], bool) if inside is None else inside
        total = 0.0
        for first, second in itertools.pairwise(self.frames):
            step = second[where].astype(np.float32) - first[where]
            total += float(np.mean((step - step.mean()) ** 2))
        return math.sqrt(total / (2 * (len(self) - 1)))


def take(config: Config, on_event: EventSink = ignore_event) -> Shots:
    """Twice as many frames as the reference has, so that one half can be measured against the other.

    A folder that has fewer is judged by what it has. Frames that are lost in between are counted.

    Raises
    ------
    ConfigError
        The reference is too short.
    DataError
        The camera gave too few frames.
    """
    reference = config.measure.reference_burst or DEFAULT_REFERENCE_BURST
    if reference < FEWEST:
        raise ConfigError(
            f"measure.reference_burst = {reference} is too short for a check; allowed: from {FEWEST}"
        )
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
    if len(frames) < FEWEST:
        raise DataError(
            f"{config.camera.address}: gave {len(frames)} whole frames, a check needs {FEWEST};"
            " look at the camera, or give more pictures"
        )
    return Shots(np.stack([f.image for f in frames]), np.array([f.t for f in frames]), lost, camera)
