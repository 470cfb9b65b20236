"""What stands beside the numbers of a test in its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from live.results.row import StrainMeasure

if TYPE_CHECKING:
    from acquire.frame import CameraInfo

FORMAT, FORMAT_VERSION = "phasedic-strain", 1


@dataclass(frozen=True, slots=True, eq=False)
class ResultsInfo:
    """What stands beside the numbers.

    Attributes
    ----------
    start_monotonic : float, s
        Zero of ``time_s``.
    start_utc : str
        The same instant, ISO 8601.
    config, metadata, versions : mapping to JSON values
        In force, free words of the user, and of the programs.
    camera : CameraInfo or None
    strain_measure : "small" | "engineering" | "green" | "hencky"
    area_m2 : float or None, m^2
        Cross-section of the specimen; with it the rows have a stress.
    gauges : mapping of name to JSON values
        The virtual gauges, each as it was described.
    axis : "x", "y" or "auto"
        Of the load; auto: as the means tell it, y until then.
    lagged : bool
        A lag of the load was taken off, so that rows have the force without it too.
    """

    start_monotonic: float
    start_utc: str
    config: Mapping[str, Any]
    metadata: Mapping[str, Any]
    versions: Mapping[str, Any]
    camera: CameraInfo | None
    strain_measure: StrainMeasure = "small"
    area_m2: float | None = None
    gauges: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    axis: str = "y"
    lagged: bool = False

    @property
    def extras(self) -> tuple[str, ...]:
        """The columns that not every test has, but for those of gauges."""
        stress = ("stress_Pa", "true_strain", "true_stress_Pa") if self.area_m2 is not None else ()
        return (*stress, *(("force_raw_N",) if self.lagged else ()))
