"""The state of a test at one time: what status line, status card, view and page show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from live.pipeline.measurement import TimeStep


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of a test at one time; NaN where a number is not known.

    Attributes
    ----------
    t : float, s
        Monotonic.
    state : str
        What is done with the frames: "REC", "ARMED" ...
    elapsed_s : float, s
        Since the test began.
    fps : float, 1/s
        Rate of the frames as they arrive.
    force_N, stress_Pa : float
        The newest force, and the force divided by the section.
    peak_N : float, N
        The force of largest magnitude so far, with its sign.
    axial_name : str
        What ``axial`` is: a gauge, "exx" or "eyy".
    axis : "x" or "y"
        Of the load.
    axis_assumed : bool
        It is neither given nor found yet.
    axial, sigma_axial : float
        Strain along the load and its standard uncertainty.
    valid, zois : int
        ZOIs with a value, and all.
    area_share : float
        The smallest share of an area that the strains stand for (``TimeStep.least_share``).
    latency_p95_s : float, s
        Of the last seconds.
    disk_s : float, s
        Until the disk is full; infinite where nothing is written.
    alarms : tuple of str
        Texts of the alarms that are on.
    frames : mapping of str to int
        The counts of frames by name.
    time_step : TimeStep or None
        The last one measured.
    """

    t: float
    state: str = ""
    elapsed_s: float = math.nan
    fps: float = math.nan
    force_N: float = math.nan
    stress_Pa: float = math.nan
    peak_N: float = math.nan
    axial_name: str = ""
    axis: str = "y"
    axis_assumed: bool = False
    axial: float = math.nan
    sigma_axial: float = math.nan
    valid: int = 0
    zois: int = 0
    area_share: float = 1.0
    latency_p95_s: float = math.nan
    disk_s: float = math.inf
    alarms: tuple[str, ...] = ()
    frames: Mapping[str, int] = field(default_factory=dict)
    time_step: TimeStep | None = None

    @property
    def lost(self) -> int:
        """Frames that the camera lost, or that could not be recorded."""
        return self.frames.get("lost", 0) + self.frames.get("unrecorded", 0)


def peak_force(peak_N: float, force_N: float) -> float:
    """The force of larger magnitude, with its sign, N; ``peak_N`` is NaN before the first force."""
    if not math.isfinite(force_N) or abs(force_N) <= abs(peak_N):
        return peak_N
    return force_N
