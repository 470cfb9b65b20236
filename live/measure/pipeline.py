"""The measuring path: one plain generator for live and replay.

``measure`` takes bursts (and commands among them) and gives measurements. It knows nothing of
threads, files, devices or clocks, so a replay of the same bursts is bit-equal to the live run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from acquire.events import EventSink, ignore_event
from acquire.frame import Burst
from acquire.load_cell import LoadLog
from live.measure.guards import StrainGuard
from live.measure.measurement import Measurement
from live.measure.preparation import Correction, unchanged
from live.measure.tracker import Tracker

if TYPE_CHECKING:
    from analysis import PhaseKernel
    from analysis.evaluate import Gauge
    from analysis.field import Measure


@dataclass(frozen=True, slots=True, eq=False)
class NewReference:
    """A command among the bursts: this burst becomes the reference; results stay composed."""

    burst: Burst


Timer = Callable[[], float]


def measure(
    bursts: Iterable[Burst | NewReference],
    kernel: PhaseKernel,
    loads: LoadLog,
    *,
    noise_GL: float | None = None,
    correct: Correction = unchanged,
    gauges: Sequence[Gauge] = (),
    renew_at: float = 1.0,
    strain: Measure = "small",
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
        Noise of one frame (``frame_noise``); None: estimated by the kernel from the residual.
    correct : callable
        Takes the fixed pattern of the sensor out of a burst.
    gauges : sequence of Gauge
        Read on every field.
    renew_at : float
        The reference is renewed when more than this share of the ZOIs is lost from one burst to
        the next, and renewing finds most of them again; 1 for never.
    strain : "small", "engineering", "green" or "hencky"
        The measure of strain of the fields and means.
    on_event : callable taking an Event
        Told when the reference is renewed.
    timer : callable
        Gives seconds; only for ``Measurement.measure_s``.

    Yields
    ------
    Measurement
        One a burst, in order.
    """
    tracker, guard = Tracker(kernel, noise_GL, renew_at, on_event), StrainGuard(strain, on_event)
    number = 0
    for item in bursts:
        if isinstance(item, NewReference):
            tracker.renew_on_demand(correct(item.burst))
            continue
        began = timer()
        field = replace(tracker.measure(correct(item)), measure=strain)
        took = timer() - began
        guard.look(field, item.t)
        yield Measurement.of(number, item, field, loads.force_at(item.t), took, gauges)
        number += 1
