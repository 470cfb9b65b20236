"""What stands before the first burst is measured: the specimen, the ZOIs and the kernel on the reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.events import EventSink
from acquire.frame import Burst
from acquire.load_cell import LoadLog
from live.measure import Correction, Measurement, Screen, averaged, kinds_of, measure, prepare
from live.replay.material import Material, Work
from live.setup import (
    AUTO,
    Config,
    compile_ahead,
    correction,
    gauges_for,
    grid_for,
    kernel_settings,
    read_mask,
)
from live.specimen import Look, placed_on

if TYPE_CHECKING:
    from analysis import PhaseKernel, ZoiGrid


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """Ready to measure; ``config`` says where the specimen was found, if it was looked for.

    Attributes
    ----------
    mask : (H, W) bool or None
    noise_GL : float or None, GL
        Of one frame.
    """

    config: Config
    mask: NDArray[np.bool_] | None
    grid: ZoiGrid
    kernel: PhaseKernel
    noise_GL: float | None
    correct: Correction
    gauges: tuple[Any, ...]
    timer: Callable[[], float] = time.perf_counter

    def measurements(
        self, work: Iterable[Work], loads: LoadLog, on_event: EventSink
    ) -> Iterator[Measurement]:
        """One burst of ``work`` after the other."""
        return measure(
            work,
            self.kernel,
            loads,
            noise_GL=self.noise_GL,
            correct=self.correct,
            gauges=self.gauges,
            renew_at=self.config.measure.renew_at,
            strain=cast(Any, self.config.measure.strain),
            on_event=on_event,
            timer=self.timer,
        )


def prepared(
    material: Material,
    config: Config,
    source: str,
    screen: Screen,
    stopped: Callable[[], bool] = lambda: False,
) -> Prepared:
    """Look for the specimen where that is asked for, and prepare the kernel; raises as ``replay``."""
    camera = material.camera
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    if AUTO in (config.measure.roi, config.measure.gauges):
        seen = Look(material.reference.mean, _noise_of(material.reference), camera)
        config, mask = placed_on(config, seen, screen.say)
    grid = grid_for(config, camera.width, camera.height, mask)
    correct, gauges = correction(config, camera), gauges_for(config.gauges, config.specimen.first_axis, grid)
    settings, stated = kernel_settings(config), config.measure.noise_GL
    phase = settings.estimator == "phase"
    compile_ahead(kinds_of(camera), phase=phase, say=screen.status, stopped=stopped)
    what = f"the reference of {source}"
    kernel, noise_GL = prepare(material.reference, grid, settings, stated, correct, what)
    return Prepared(config, mask, grid, kernel, noise_GL, correct, gauges)


def _noise_of(reference: Burst) -> float | None:
    """Of the mean, GL; None where one frame tells nothing."""
    return averaged(reference.noise, reference.n) if reference.noise > 0 else None
