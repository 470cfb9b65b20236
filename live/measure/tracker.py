"""The kernel in force from burst to burst, and the renewal of its reference."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acquire.events import Event, EventKind, EventSink, Level
from acquire.frame import Burst
from live.measure.preparation import averaged

if TYPE_CHECKING:
    from analysis import PhaseKernel, StrainField


class Tracker:
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
