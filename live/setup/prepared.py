"""The plan of a measurement for the pictures of one camera, and the kernel on a reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.events import EventSink
from acquire.frame import Burst, CameraInfo
from acquire.load_cell import LoadLog
from live.config.gauges import gauges_for
from live.config.loading import Config
from live.pipeline.measure import NewReference, measure
from live.pipeline.measurement import Measurement
from live.pipeline.reference import Correction, prepare
from live.pipeline.warm_up import picture_kinds
from live.setup.compiling import compile_ahead
from live.setup.grid import grid_for, kernel_settings
from live.setup.pictures import correction

if TYPE_CHECKING:
    from analysis import KernelSettings, PhaseKernel, ZoiGrid
    from analysis.evaluate import Gauge


@dataclass(frozen=True, slots=True, eq=False)
class MeasurePlan:
    """All that is fixed before there is a reference.

    Attributes
    ----------
    config : Config
    mask : (H, W) bool or None
    grid : ZoiGrid
    gauges : tuple of Gauge
    settings : KernelSettings
    correct : callable
        Corrects the fixed pattern of the sensor in a burst.
    """

    config: Config
    mask: NDArray[np.bool_] | None
    grid: ZoiGrid
    gauges: tuple[Gauge, ...]
    settings: KernelSettings
    correct: Correction

    @classmethod
    def of(cls, config: Config, camera: CameraInfo, mask: NDArray[np.bool_] | None) -> MeasurePlan:
        """The plan for pictures of ``camera``, with ZOIs where ``mask`` is True.

        Raises
        ------
        ConfigError, DataError
            The grid, a gauge or a correction does not fit, or a file cannot be read.
        """
        grid = grid_for(config, camera.width, camera.height, mask)
        gauges = gauges_for(config.gauges, config.specimen.first_axis, grid)
        return cls(config, mask, grid, gauges, kernel_settings(config), correction(config, camera))

    def compile(
        self, camera: CameraInfo, show: Callable[[str], object], stopped: Callable[[], bool]
    ) -> float:
        """Compile what is not compiled yet (``compile_ahead``); returns the seconds that took."""
        phase = self.settings.estimator == "phase"
        return compile_ahead(picture_kinds(camera), phase=phase, show=show, stopped=stopped)

    def on(self, reference: Burst, what: str = "the reference") -> PreparedKernel:
        """The kernel on ``reference``, named ``what`` in errors; raises as ``live.pipeline.reference.prepare``."""
        stated = self.config.measure.noise_GL
        kernel, noise_GL = prepare(reference, self.grid, self.settings, stated, self.correct, what)
        return PreparedKernel(self, kernel, noise_GL)


@dataclass(frozen=True, slots=True, eq=False)
class PreparedKernel:
    """A kernel on its reference: ready to measure.

    Attributes
    ----------
    plan : MeasurePlan
    kernel : PhaseKernel
    noise_GL : float or None, GL
        Of one frame.
    timer : callable giving s
    """

    plan: MeasurePlan
    kernel: PhaseKernel
    noise_GL: float | None
    timer: Callable[[], float] = time.perf_counter

    def measurements(
        self, bursts: Iterable[Burst | NewReference], loads: LoadLog, on_event: EventSink
    ) -> Iterator[Measurement]:
        """The measurement of each burst (``live.pipeline.measure.measure``)."""
        settings = self.plan.config.measure
        return measure(
            bursts,
            self.kernel,
            loads,
            noise_GL=self.noise_GL,
            correct=self.plan.correct,
            gauges=self.plan.gauges,
            renew_at=settings.renew_at,
            strain=cast(Any, settings.strain),
            on_event=on_event,
            timer=self.timer,
        )
