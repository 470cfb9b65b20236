"""One measured instant: what the pipeline hands to the results, the view and the screen."""

from __future__ import annotations

from dataclasses import dataclass

from acquire.frame import Burst
from analysis.field import StrainField


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """A burst, its strain field and the force at its time.

    Attributes
    ----------
    number : int
        0, 1, 2 ... of the measured bursts.
    burst : Burst
    field : StrainField
    force : float, N
        At the burst's time by interpolation; NaN where no load is known (yet).
    measure_s : float, s
        Time the kernel took, for the status line; 0.0 where nobody measured it.
    """

    number: int
    burst: Burst
    field: StrainField
    force: float
    measure_s: float = 0.0

    @property
    def t(self) -> float:
        """Time of the burst in monotonic seconds."""
        return self.burst.t
