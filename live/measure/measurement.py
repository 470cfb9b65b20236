"""One measured instant: what the pipeline hands to the results, the view and the screen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from acquire.frame import Burst
from analysis.evaluate import Gauge
from analysis.field import StrainField
from live.measure.instant import Instant, instant_of


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """A burst, its strain field, and the means of that with the force at its time.

    Attributes
    ----------
    number : int
        0, 1, 2 ... of the measured bursts.
    burst : Burst
    field : StrainField
    instant : Instant
    """

    number: int
    burst: Burst
    field: StrainField
    instant: Instant

    @classmethod
    def of(
        cls, number: int, burst: Burst, field: StrainField, force: float, measure_s: float = 0.0,
        gauges: Sequence[Gauge] = (),
    ) -> Measurement:  # fmt: skip
        """The same with its means and ``gauges``.

        ``force`` (N) is NaN where it is not known, ``measure_s`` (s) the kernel's time.
        """
        read = {gauge.name: gauge.measure(field) for gauge in gauges}
        return cls(number, burst, field, replace(instant_of(burst, field, force, measure_s), gauges=read))

    @property
    def t(self) -> float:
        """Time of the burst in monotonic seconds."""
        return self.burst.t

    @property
    def force(self) -> float:
        """Force at that time, N; NaN where no load is known (yet)."""
        return self.instant.force

    def with_latency(self, latency_s: float) -> Measurement:
        """The same once it is known how long it took, from the stamp of the last frame."""
        return replace(self, instant=replace(self.instant, latency_s=latency_s))

    def with_force(self, force: float, raw: float = math.nan, zero: float = 0.0) -> Measurement:
        """The same once the force is known; ``raw`` as stamped, where a lag was taken off; ``zero`` by tares."""
        return replace(self, instant=replace(self.instant, force=force, force_raw=raw, zero=zero))
