"""The check, repeated several times a second while lens, light and exposure are adjusted.

Meanwhile it says how much less sharp the picture is than the sharpest one so far.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from acquire.camera import Camera
from acquire.errors import DataError
from acquire.frame import Frame
from analysis.field import Blur, mean_blur
from live.config.loading import Config
from live.pipeline.reference import averaged, prepare
from live.setup.check.check_list import CheckFigures, KernelFigures, examine, figures_of, find_region
from live.setup.check.noise_floor import predict_noise
from live.setup.check.sample import MIN_FRAMES, CheckRegion, CheckSample, FrameStack, around, moved, stack_of
from live.setup.check.stillness import covered, middle, stillness
from live.setup.pictures import correction
from live.setup.region import Region

if TYPE_CHECKING:
    from analysis import PhaseKernel

NOT_KNOWN = Blur(math.nan, math.nan)
SHARPER = 3.0
"""Sigmas by which a picture is sharper than the reference and takes its place."""

QUICK_FRAMES = 8
"""Frames of one quick check."""
RENEW_EVERY = 8
"""Quick checks after which noise and motion are measured again, and a specimen not yet found is searched."""
SEARCH_EVERY = 16
"""Quick checks after which a found specimen is searched again."""
SAME_REGION = 0.02  # share of a region by which a new one may differ without replacing it


class SharpestPicture:
    """The sharpest picture of one region so far, as a reference for those that follow."""

    def __init__(self) -> None:
        self._kernel: PhaseKernel | None = None
        self._peak = math.nan  # sharpness figure of the reference

    def compare(self, sample: CheckSample, measurable: NDArray[np.bool_], sharpness: float) -> Blur:
        """The blur of a sample since the sharpest picture, over some dozens of ZOIs about the middle.

        Parameters
        ----------
        sample : CheckSample
        measurable : (R, C) bool
            ZOIs with a pattern. Without any the blur is NaN.
        sharpness : float
            Figure of the sample; decides where the blur has changed too much to be measured (NaN).
        """
        measurable = measurable & sample.check_region.grid.active
        if not measurable.any():
            return NOT_KNOWN
        chosen = middle(sample.check_region.grid.subset(active=measurable))
        cut = around(covered(chosen, sample.check_region.at_zois.shape))
        correct = correction(sample.check_region.config, sample.check_region.camera, cut)
        burst = correct(sample.stack.cut(*cut).mean())
        if self._kernel is None or burst.mean.shape != self._kernel.reference.prepared.shape:
            try:
                self._kernel, _ = prepare(burst, moved(chosen, cut), sample.settings, sample.noise)
            except DataError:
                return NOT_KNOWN
            self._peak = sharpness
        found = mean_blur(self._kernel.measure(burst.mean, noise=averaged(sample.noise, burst.n)))
        too_sharp = math.isnan(found.px) and sharpness > self._peak
        if too_sharp or found.px < -SHARPER * found.sigma:
            self._peak = sharpness
            self._kernel, _ = prepare(burst, self._kernel.grid, sample.settings, sample.noise)
        return found


class RollingFrames:
    """The newest frames of a camera; within the context, a thread takes them."""

    def __init__(self, camera: Camera, length: int, address: str) -> None:
        self._camera, self._address = camera, address
        self._frames: deque[Frame] = deque(maxlen=max(length, MIN_FRAMES))
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._drain, name="check", daemon=True)
        self._failed: Exception | None = None
        self.received = 0

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
        """The newest ``count`` frames; None while there are too few for a check.

        Raises
        ------
        PhasedicError
            The error that ended the camera.
        """
        frames = self._newest(count)
        return None if len(frames) < MIN_FRAMES else self._stack(frames)

    def last(self, count: int) -> FrameStack:
        """The newest frames of a camera that has ended; raises as ``stack_of``."""
        return self._stack(self._newest(count))

    def _newest(self, count: int) -> list[Frame]:
        if self._failed is not None:
            raise self._failed
        with self._lock:
            return list(self._frames)[-count:]

    def _stack(self, frames: list[Frame]) -> FrameStack:
        lost = sum(frame.lost_before for frame in frames[1:])
        return stack_of(frames, self._camera.info, lost, self._address)

    def frame(self) -> Frame | None:
        """The newest frame; None before the first."""
        with self._lock:
            return self._frames[-1] if self._frames else None

    def _drain(self) -> None:
        try:
            for frame in self._camera:
                if not frame.damaged:
                    with self._lock:
                        self._frames.append(frame)
                        self.received += 1
        except Exception as error:
            self._failed = error


@dataclass(frozen=True, slots=True, eq=False)
class QuickCheck:
    """The figures of some frames, the highest sharpness since the specimen was found, and the blur since then."""

    figures: CheckFigures
    peak: float
    blur: Blur

    @property
    def of_peak(self) -> float:
        """Sharpness over its peak; NaN without pattern."""
        return self.figures.sharpness / self.peak if self.peak > 0 else math.nan


class QuickChecker:
    """Checks one stack of frames after the other, and holds the peak of the sharpness.

    Light, contrast, sharpness, radius and flicker are new at every check. Figures that need the kernel, and the
    search for the specimen, take turns: at most one of them at a check.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._check_region: CheckRegion | None = None
        self._measured: KernelFigures | None = None
        self._peak, self._sharpest = 0.0, SharpestPicture()
        self._checks = 0

    def check(self, stack: FrameStack) -> QuickCheck:
        """The figures without the table of strain noise; raises as ``examine``."""
        turn = self._checks
        self._checks += 1
        check_region = self._region_at(stack, turn)
        sample = CheckSample.of(stack, check_region)
        self._measured = measured = self._renewed(sample, turn)
        figures = figures_of(sample, measured)
        if math.isfinite(figures.sharpness):
            self._peak = max(self._peak, figures.sharpness)
        blur = self._sharpest.compare(sample, measured.predicted.measurable, figures.sharpness)
        return QuickCheck(figures, self._peak, blur)

    def full(self, stack: FrameStack) -> CheckFigures:
        """All figures with the table of strain noise."""
        return examine(stack, self._config)

    def _region_at(self, stack: FrameStack, turn: int) -> CheckRegion:
        """The region, renewed if the specimen is found elsewhere; its rim alone varies from search to search."""
        now = self._check_region
        due = SEARCH_EVERY if now is not None and now.region.found else RENEW_EVERY
        if now is None or turn % due == 0:
            region = find_region(stack, self._config)
            if now is None or not _same_region(region, now.region, now):
                now = CheckRegion.of(region, self._config, stack.camera)
                self._check_region, self._measured = now, None
                self._sharpest = SharpestPicture()
        return now

    def _renewed(self, sample: CheckSample, turn: int) -> KernelFigures:
        before = self._measured
        if before is None:
            return KernelFigures.of(sample)
        if turn % RENEW_EVERY == 3:
            return replace(before, predicted=predict_noise(sample))
        if turn % RENEW_EVERY == 6:
            return replace(before, still=stillness(sample, before.predicted.measurable))
        return before


def _same_region(one: Region, other: Region, check_region: CheckRegion) -> bool:
    """Whether two regions are the same except for a rim."""
    size = check_region.camera.width, check_region.camera.height, check_region.config.measure.zoi
    first, second = (region.inside(*size) for region in (one, other))
    return one.found == other.found and bool((first ^ second).sum() <= SAME_REGION * (first | second).sum())
