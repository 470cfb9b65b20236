"""The plan of a measurement for the pictures of one camera, and the kernel on a reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.events import EventSink
from acquire.frame import QUANTISATION, Burst, CameraInfo
from acquire.load_cell import LoadLog
from acquire.text import Message
from analysis.optics import LensCorrection, LensModel, PlateFit, ShutterCorrection
from live.config.gauges import gauges_for, partly
from live.config.loading import Config
from live.pipeline.consumer import Screen
from live.pipeline.guards import DilatationGuard, StartGuard, TiltGuard, standard_guards
from live.pipeline.measure import Corrections, NewReference, OnFailure, PlateCorrection, Tracker, measure
from live.pipeline.measurement import Measurement
from live.pipeline.reference import Correction, prepare
from live.setup.compiling import Stopping, compile_ahead
from live.setup.dry_run import picture_kinds
from live.setup.grid import grid_for, kernel_settings, plates_for
from live.setup.lens import lens_for
from live.setup.pictures import correction

if TYPE_CHECKING:
    from analysis import KernelSettings, PhaseKernel, ZoiGrid
    from analysis.evaluate import Gauge

ASSUMED_FOCAL = 4.0
"""Distance of the camera over the width of its view, where the stand-off is not given."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasurePlan:
    """All that is fixed before there is a reference.

    Attributes
    ----------
    config : Config
    mask : (H, W) bool or None
    grid : ZoiGrid
    gauges : tuple of Gauge
    plates : PlateFit or None
    lens : LensModel or None
    settings : KernelSettings
    correct : callable
        Corrects the fixed pattern of the sensor in a burst.
    width, height : int, px
        Of the picture.
    quantisation : 64 floats, GL, or None
        ``CameraInfo.controls`` of compressed pictures.
    """

    config: Config
    mask: NDArray[np.bool_] | None
    grid: ZoiGrid
    gauges: tuple[Gauge, ...]
    plates: PlateFit | None
    lens: LensModel | None
    settings: KernelSettings
    correct: Correction
    width: int
    height: int
    quantisation: Sequence[float] | None = None

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
        layout = plates_for(config, grid, camera.width, camera.height)
        middle = ((camera.width - 1) / 2, (camera.height - 1) / 2)
        plates = None if layout is None else PlateFit(layout, middle)
        lens = lens_for(config, camera.width, camera.height, grid if layout is None else layout.whole)
        settings, correct = kernel_settings(config), correction(config, camera)
        steps = camera.controls.get(QUANTISATION)
        return cls(
            config, mask, grid, gauges, plates, lens, settings, correct, camera.width, camera.height, steps
        )

    @property
    def shutter(self) -> ShutterCorrection | None:
        """A new correction of the rolling shutter; None without its readout time."""
        readout_ms, sigma_ms = self.config.camera.readout_ms, self.config.camera.sigma_readout_ms or 0.0
        return None if not readout_ms else ShutterCorrection(1e-3 * readout_ms, self.height, 1e-3 * sigma_ms)

    @property
    def lens_correction(self) -> LensCorrection | None:
        """The correction of the lens; None where there is none to correct."""
        layout = None if self.plates is None else self.plates.layout
        return None if self.lens is None else LensCorrection(self.lens, self.kernel_grid, layout)

    @property
    def focal_px(self) -> float:
        """Distance of the camera over the size of a pixel on the specimen; assumed where it is not known."""
        known = _focal_px(self.config)
        return ASSUMED_FOCAL * self.width if known is None else known

    @property
    def kernel_grid(self) -> ZoiGrid:
        """The ZOIs that the kernel measures: those of the test, and of plates."""
        return self.grid if self.plates is None else self.plates.layout.whole

    def compile(self, camera: CameraInfo, screen: Screen, stopping: Stopping | None) -> float:
        """Compile what is not compiled yet (``compile_ahead``); returns the seconds that took."""
        phase = self.settings.estimator == "phase"
        return compile_ahead(picture_kinds(camera), phase=phase, screen=screen, stopping=stopping)

    def on(self, reference: Burst, what: str = Message("the reference")) -> PreparedKernel:
        """The kernel on ``reference``, named ``what`` in errors; raises as ``live.pipeline.reference.prepare``."""
        stated = self.config.measure.noise_GL
        grid, settings, steps = self.kernel_grid, self.settings, self.quantisation
        kernel, noise_GL = prepare(reference, grid, settings, stated, self.correct, what, steps)
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
        self,
        bursts: Iterable[Burst | NewReference],
        loads: LoadLog,
        on_event: EventSink,
        on_failure: OnFailure | None = None,
    ) -> Iterator[Measurement]:
        """The measurement of each burst (``live.pipeline.measure.measure``)."""
        plan, config = self.plan, self.plan.config
        settings, nu = config.measure, config.specimen.nu
        strain = cast(Any, settings.strain)
        guards = [
            StartGuard("gauges", [partly(one, plan.grid) for one in plan.gauges], on_event),
            *standard_guards(self.kernel, strain, on_event),
            DilatationGuard(nu, config.scale.stand_off_mm, on_event),
            TiltGuard(_focal_px(config), on_event, dilatation=nu is None),
        ]
        plates = None if plan.plates is None else PlateCorrection(plan.plates, plan.focal_px, on_event)
        return measure(
            bursts,
            Tracker(self.kernel, self.noise_GL, settings.renew_at, on_event),
            loads,
            corrections=Corrections(plan.correct, plan.shutter, plan.lens_correction, plates),
            gauges=plan.gauges,
            strain=strain,
            guards=guards,
            timer=self.timer,
            on_failure=on_failure,
        )


def _focal_px(config: Config) -> float | None:
    """Distance of the camera over the size of a pixel on the specimen, px; None where it is not known."""
    scale = config.scale
    if scale.mm_per_px is None or scale.stand_off_mm is None:
        return None
    return scale.stand_off_mm / scale.mm_per_px
