"""The check over and over while lens, light and exposure are turned."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass, replace
from typing import Self

from acquire.camera import Camera
from acquire.frame import Frame
from live.config.loading import Config
from live.setup.check.check_list import CheckFigures, Measured, examine, figures_of, sought
from live.setup.check.noise_floor import predicted
from live.setup.check.sample import FEWEST, CheckRegion, CheckSample, FrameStack, taken
from live.setup.check.stillness import stillness
from live.setup.region import Region

GLANCE = 8  # frames
TURNS = 8
"""Glances after which noise and motion are predicted and followed anew; searched, while nothing is found."""
SEARCH_EVERY = 16
"""Glances after which the specimen that was found is looked for anew."""
RIM = 0.02  # of a region: where it is found a little otherwise, the old one stays


class RollingFrames:
    """The newest frames of a camera, drained by a thread of its own from ``start`` to ``stop``."""

    def __init__(self, camera: Camera, length: int, address: str) -> None:
        self._camera, self._address = camera, address
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

    def newest(self, count: int) -> FrameStack | None:
        """The newest ``count`` frames; None while there are fewer than a check needs.

        Raises
        ------
        PhasedicError
            Whatever ended the camera.
        """
        frames = self._newest(count)
        return None if len(frames) < FEWEST else self._shots(frames)

    def last(self, count: int) -> FrameStack:
        """The same of a camera that has ended, however few of pictures; DataError where it gave too few."""
        return self._shots(self._newest(count))

    def _newest(self, count: int) -> list[Frame]:
        if self._failed is not None:
            raise self._failed
        with self._lock:
            return list(self._frames)[-count:]

    def _shots(self, frames: list[Frame]) -> FrameStack:
        lost = sum(frame.lost_before for frame in frames[1:])
        return taken(frames, self._camera.info, lost, self._address)

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
class QuickCheck:
    """The figures of some frames, and the best sharpness there was since the specimen was found."""

    figures: CheckFigures
    peak: float

    @property
    def of_peak(self) -> float:
        """Sharpness as a part of its peak; NaN without pattern."""
        return self.figures.sharpness / self.peak if self.peak > 0 else math.nan


class QuickChecker:
    """Judges one set of frames after the other, and holds the peak of the sharpness.

    What is read off the frames (light, contrast, sharpness, radius, flicker) is new at every glance. What
    takes the kernel takes turns, and so does the search for the specimen: at most one of them at a glance.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._ground: CheckRegion | None = None
        self._measured: Measured | None = None
        self._peak = 0.0
        self._glances = 0

    def glance(self, shots: FrameStack) -> QuickCheck:
        """The figures without the noises that take long; raises as ``examine``."""
        turn = self._glances
        self._glances += 1
        ground = self._ground_at(shots, turn)
        bench = CheckSample.of(shots, ground)
        self._measured = measured = self._renewed(bench, turn)
        figures = figures_of(bench, measured)
        if math.isfinite(figures.sharpness):
            self._peak = max(self._peak, figures.sharpness)
        return QuickCheck(figures, self._peak)

    def last(self, shots: FrameStack) -> CheckFigures:
        """All figures with the table."""
        return examine(shots, self._config)

    def _ground_at(self, shots: FrameStack, turn: int) -> CheckRegion:
        """Laid anew where the specimen is found elsewhere; its rim alone is never quite the same."""
        now = self._ground
        due = SEARCH_EVERY if now is not None and now.region.found else TURNS
        if now is None or turn % due == 0:
            region = sought(shots, self._config)
            if now is None or not _alike(region, now.region, now):
                now = CheckRegion.of(region, self._config, shots.camera)
                self._ground, self._measured = now, None
        return now

    def _renewed(self, bench: CheckSample, turn: int) -> Measured:
        before = self._measured
        if before is None:
            return Measured.of(bench)
        if turn % TURNS == 3:
            return replace(before, predicted=predicted(bench))
        return replace(before, still=stillness(bench, before.predicted.able)) if turn % TURNS == 6 else before


def _alike(one: Region, other: Region, ground: CheckRegion) -> bool:
    """Whether both are the same place, but for a rim."""
    size = ground.camera.width, ground.camera.height, ground.config.measure.zoi
    first, second = (region.inside(*size) for region in (one, other))
    return one.found == other.found and bool((first ^ second).sum() <= RIM * (first | second).sum())
