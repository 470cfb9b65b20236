"""The few figures that are shown large."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

from live.view.exchange.wire import WireError


@dataclass(frozen=True, slots=True)
class Figures:
    """Where a test stands, for a look of two seconds.

    Attributes
    ----------
    t : float, s
        Monotonic.
    state : str
        What is done with the frames: "REC", "ARMED" ...
    axial, sigma : float
        Strain along the load and its standard uncertainty.
    force_N, stress_MPa : float
        NaN where not known.
    valid, zois : int
        ZOIs with a value, and all.
    alarms : tuple of str
        Words of the alarms that are on.
    """

    t: float
    state: str
    axial: float
    sigma: float
    force_N: float
    stress_MPa: float
    valid: int
    zois: int
    alarms: tuple[str, ...] = ()

    def as_meta(self) -> dict[str, Any]:
        """Plain values, fit for JSON; what is not a number is left out."""
        plain = asdict(self)
        return {k: v for k, v in plain.items() if not (isinstance(v, float) and math.isnan(v))}

    @classmethod
    def from_meta(cls, meta: Mapping[str, Any]) -> Self:
        """What ``as_meta`` was made of; raises WireError."""
        try:
            numbers = {
                name: float(meta.get(name, math.nan))
                for name in ("t", "axial", "sigma", "force_N", "stress_MPa")
            }
            alarms = tuple(str(alarm) for alarm in meta["alarms"])
            return cls(
                state=str(meta["state"]),
                valid=int(meta["valid"]),
                zois=int(meta["zois"]),
                alarms=alarms,
                **numbers,
            )
        except (KeyError, TypeError, ValueError) as error:
            raise WireError(f"figures to the view are damaged: {error}") from error
