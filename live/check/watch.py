"""The check over and over while lens, light and exposure are turned: ``Rolling`` frames, ``Watch`` judges them."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Self

import numpy as np

from acquire.camera import Camera
from acquire.errors import DataError
from acquire.frame import Frame
from live.check.figures import Figures, examine
from live.check.shots import FEWEST, Shots
from live.measure import averaged
from live.setup import Config
from live.specimen import Region, region_of

GLANCE = 8  # frames
SEARCH_EVERY = 10
"""The specimen is looked for anew at every tenth glance, and at each while none is found."""


class Rolling:
    """The newest frames of a camera, drained by a thread of its own from ``start`` to ``stop``."""

    def __init__(self, camera: Camera, length: int) -> None:
        self._camera = camera
        self._frames: deque[Frame] = deque(maxlen=max(length, FEWEST))
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._drain, name="check", daemon=True)
        self._failed: Exception | None = None
        self.seen = 0

    def __enter__(self) -> Self:
        self._camera.__enter__()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._camera.stop()
        self._thread.join(5.0)

    @property
    def over(self) -> bool:
        """Whether the camera has ended."""
        return not self._thread.is_alive()

    def newest(self, count: int) -> Shots | None:
        """The newest ``count`` frames; None while there are fewer than a check needs.

        Raises
        ------
        PhasedicError
            Whatever ended the camera.
        """
        if self._failed is not None:
            raise self._failed
        with self._lock:
            frames = list(self._frames)[-count:]
        if len(frames) < FEWEST:
            return None
        lost = sum(frame.lost_before for frame in frames[1:])
        times = np.array([frame.t for frame in frames])
        return Shots(np.stack([frame.image for frame in frames]), times, lost, self._camera.info)

    def frame(self) -> Frame | None:
        """The newest one."""
        with self._lock:
            return self._frames[-1] if self._frames else None

    def _drain(self) -> None:
        try:
            for frame in self._camera:
                if not frame.damaged:
                    with self._lock:
                        self._frames.append(frame)
                        self.seen += 1
        except Exception as error:
            self._failed = error


@dataclass(frozen=True, slots=True, eq=False)
class Glance:
    """The figures of some frames, and the best sharpness there was since the specimen was found."""

    figures: Figures
    peak: float

    @property
    def of_peak(self) -> float:
        """Sharpness as a part of its peak; NaN without pattern."""
        return self.figures.sharpness / self.peak if self.peak > 0 else math.nan


class Watch:
    """Judges one set of frames after the other, and holds the peak of the sharpness."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._region: Region | None = None
        self._peak = 0.0
        self._glances = 0

    def glance(self, shots: Shots) -> Glance:
        """The figures without the noises that take long; raises as ``examine``."""
        if self._region is None or not self._region.found or self._glances % SEARCH_EVERY == 0:
            noise = averaged(shots.noise() or None, len(shots))
            self._region = region_of(self._config, shots.mean().mean, noise)
        self._glances += 1
        figures = examine(shots, self._config, table=False, region=self._region)
        if math.isfinite(figures.sharpness):
            self._peak = max(self._peak, figures.sharpness)
        return Glance(figures, self._peak)

    def last(self, shots: Shots | None) -> Figures:
        """All figures with the table; raises DataError where there were too few frames."""
        if shots is None:
            raise DataError(
                f"{self._config.camera.address}: gave fewer than {FEWEST} whole frames; look at the camera"
            )
        return examine(shots, self._config)
