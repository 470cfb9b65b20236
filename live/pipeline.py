"""The measuring path: one plain generator for live and replay.

``measure`` takes bursts (and commands among them) and gives measurements. It knows nothing of
threads, files, devices or clocks, so a replay of the same bursts is bit-equal to the live run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from acquire.events import Event, EventKind, EventSink, Level, ignore_event
from acquire.frame import Burst
from acquire.load_log import LoadLog
from live.measurement import Measurement

if TYPE_CHECKING:
    from analysis import KernelSettings, PhaseKernel, StrainField, ZoiGrid


@dataclass(frozen=True, slots=True, eq=False)
class NewReference:
    """A command among the bursts: this burst becomes the reference; results stay composed."""

    burst: Burst


Timer = Callable[[], float]
Correction = Callable[[Burst], Burst]


def unchanged(burst: Burst) -> Burst:
    """The correction of those who have none."""
    return burst


def frame_noise(burst: Burst, stated_GL: float | None) -> float | None:
    """The noise of one frame, GL: as measured within the burst, else as stated, else None.

    A burst without any scatter (noise-free pictures) tells nothing, and what was stated counts.
    """
    if stated_GL is not None:
        return stated_GL
    return burst.noise if math.isfinite(burst.noise) and burst.noise > 0 else None


def averaged(noise_GL: float | None, n: int) -> float | None:
    """The noise of the mean of n frames; quantisation, 1/12 GL^2, is the least there is of one frame."""
    return None if noise_GL is None else max(noise_GL, 12**-0.5) / math.sqrt(n)


def measure(
    bursts: Iterable[Burst | NewReference],
    kernel: PhaseKernel,
    loads: LoadLog,
    *,
    noise_GL: float | None = None,
    correct: Correction = unchanged,
    renew_at: float = 1.0,
    on_event: EventSink = ignore_event,
    timer: Timer = lambda: 0.0,
) -> Iterator[Measurement]:
    """Measure one burst after the other.

    Parameters
    ----------
    bursts : iterable of Burst or NewReference
    kernel : PhaseKernel
        Prepared on the reference.
    loads : LoadLog
        Gives the force at a burst's time.
    noise_GL : float or None, GL
        Noise of one frame; None: estimated by the kernel from the residual.
    correct : callable
        Takes the fixed pattern of the sensor out of a burst.
    renew_at : float
        The reference is renewed when more than this share of the ZOIs is lost from one burst to
        the next, and renewing finds most of them again; 1 for never.
    on_event : callable taking an Event
        Told when the reference is renewed.
    timer : callable
        Gives seconds; only for ``Measurement.measure_s``.

    Yields
    ------
    Measurement
        One a burst, in order.
    """
    tracker = _Tracker(kernel, noise_GL, renew_at, on_event)
    number = 0
    for item in bursts:
        if isinstance(item, NewReference):
            tracker.renew_on_demand(correct(item.burst))
            continue
        began = timer()
        field = tracker.measure(correct(item))
        yield Measurement(number, item, field, loads.force_at(item.t), timer() - began)
        number += 1


class _Tracker:
    """The kernel in force, the field before, and the renewal of the reference.

    All of it depends on the bursts alone, so that a replay of the same bursts does the same.
    """

    def __init__(
        self, kernel: PhaseKernel, noise_GL: float | None, renew_at: float, on_event: EventSink
    ) -> None:
        self._kernel, self._noise_GL, self._renew_at, self._on_event = kernel, noise_GL, renew_at, on_event
        self._field: StrainField | None = None
        self._burst: Burst | None = None

    def measure(self, burst: Burst) -> StrainField:
        """The field of ``burst``."""
        field = self._against(self._kernel, burst, self._field)
        if self._field is not None and self._burst is not None:
            lost = _share(self._field) - _share(field)
            if lost > self._renew_at:
                field = self._renewed_for(burst, field, lost, self._field, self._burst)
        self._field, self._burst = field, burst
        return field

    def renew_on_demand(self, burst: Burst) -> None:
        """Make ``burst`` the reference; told and left where nothing ties it to the first one."""
        here = self._against(self._kernel, burst, self._field)
        try:
            self._kernel = self._kernel.renewed(burst.mean, here, noise=averaged(self._noise_GL, burst.n))
        except ValueError as error:
            text = f"the reference was not renewed: {error}"
            self._on_event(Event(burst.t, EventKind.MEASUREMENT, "measurement", text, "warning"))
            return
        self._field = None
        self._on_event(_renewal(burst, automatic=False))

    def _renewed_for(
        self, burst: Burst, field: StrainField, lost: float, last: StrainField, last_burst: Burst
    ) -> StrainField:
        """Measure again from the burst before as the reference; kept where it finds most of what was lost."""
        try:
            kernel = self._kernel.renewed(last_burst.mean, last, noise=averaged(self._noise_GL, last_burst.n))
        except ValueError:
            return field
        again = self._against(kernel, burst, None)
        if _share(again) - _share(field) < 0.5 * lost:
            return field
        self._kernel = kernel
        self._on_event(_renewal(last_burst, automatic=True))
        return again

    def _against(self, kernel: PhaseKernel, burst: Burst, start: StrainField | None) -> StrainField:
        clipped = burst.clipped if burst.clipped.any() else None
        return kernel.measure(
            burst.mean, start=start, noise=averaged(self._noise_GL, burst.n), clipped=clipped
        )


def _share(field: StrainField) -> float:
    """The share of the active ZOIs that could be measured."""
    return float(np.isfinite(field.u).sum() / max(int(field.grid.active.sum()), 1))


def _renewal(burst: Burst, *, automatic: bool) -> Event:
    data = {"first": burst.first_index, "last": burst.last_index, "n": burst.n, "automatic": automatic}
    why = "since the pattern had changed too much" if automatic else "as asked"
    text = f"the reference was renewed {why}; results stay composed on the first one"
    level: Level = "warning" if automatic else "info"
    return Event(burst.t, EventKind.REFERENCE, "measurement", text, level, data | {"renewed": True})


def prepare(
    reference: Burst,
    grid: ZoiGrid,
    settings: KernelSettings,
    stated_noise_GL: float | None,
    correct: Correction = unchanged,
) -> tuple[PhaseKernel, float | None]:
    """The kernel on ``reference``, and the noise of one frame that goes with it.

    Raises
    ------
    ValueError
        The grid leaves the picture, or the reference has no pattern.
    """
    from analysis import PhaseKernel

    noise_GL = frame_noise(reference, stated_noise_GL)
    kernel = PhaseKernel(correct(reference).mean, grid, settings, noise=averaged(noise_GL, reference.n))
    return kernel, noise_GL


def motion_between(
    kernel: PhaseKernel, first: Burst, second: Burst, correct: Correction = unchanged
) -> float:
    """How far the picture moved from one half of the reference burst to the other, px.

    The median over the ZOIs of the displacement between the two; NaN where none can be measured.
    """
    a = kernel.measure(correct(first).mean)
    b = kernel.measure(correct(second).mean, start=a)
    moved = np.hypot(b.u - a.u, b.v - a.v)
    return float(np.median(moved[np.isfinite(moved)])) if np.isfinite(moved).any() else math.nan
