"""The budget of E: what its uncertainty is made of, before a test (``phasedic check``) and after it (the report).

Standard uncertainties combine as the GUM has it (JCGM 100:2008, 5.1.2); stated limits of error are taken as even
distributions (4.3.7). What is not stated is named, and is not in the sum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from live.config.sections import CameraConfig, ScaleConfig

MOTION_MM = 0.1
"""Towards the camera, that the budget gives the strain of."""
LENS = "lens"
_KEYS = {
    "load cell": "specimen.force_error_percent",
    "section": "specimen.section_error_percent",
    "strain": "specimen.strain_error_um_m",
}


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One cause of the uncertainty of E, or all together: standard uncertainties, or why there is none.

    Attributes
    ----------
    cause : str
    strain : float
        At the end of the elastic interval; NaN where it is not counted.
    modulus : float
        In the unit of E.
    words : str
        Why it is not counted, and which key states it; else empty.
    """

    cause: str
    strain: float = math.nan
    modulus: float = math.nan
    words: str = ""


@dataclass(frozen=True, slots=True)
class CameraView:
    """What is known of a camera's view of the specimen.

    Attributes
    ----------
    stand_off_mm : float or None, mm
    readout_ms : float or None, ms
        None: not stated.
    plates : bool
        Plates remove the motion off the plane.
    both_sides : bool
        The strain is the mean of front and back.
    """

    stand_off_mm: float | None = None
    readout_ms: float | None = None
    plates: bool = False
    both_sides: bool = False

    @classmethod
    def of(cls, camera: CameraConfig, scale: ScaleConfig, *, plates: bool) -> CameraView:
        """As configured."""
        return cls(scale.stand_off_mm, camera.readout_ms, plates)


def budget_rows(
    shares: Mapping[str, float], strain: float, modulus: float, view: CameraView, *, stresses: bool
) -> list[BudgetRow]:
    """The budget of E, the combined uncertainty last.

    Parameters
    ----------
    shares : mapping of str to float
        Relative standard uncertainties: scatter, what is stated of load cell, section and strain, and of a lens
        that is corrected.
    strain : float
        End of the elastic interval.
    modulus : float
        E in any unit.
    view : CameraView
    stresses : bool
        The section is known.
    """
    left_out = ({"section"} if not stresses else set()) | ({LENS} - shares.keys())
    causes = [cause for cause in ("scatter", *_KEYS, LENS) if cause not in left_out]
    rows = [
        BudgetRow(cause, shares[cause] * strain, shares[cause] * modulus)
        if cause in shares
        else BudgetRow(cause, words=f"not stated: {_KEYS.get(cause, 'not known')}")
        for cause in causes
    ]
    combined = math.hypot(*shares.values())
    seen = _optics(view, stated="strain" in shares)
    optics = (BudgetRow(cause, words=words) for cause, words in seen if cause not in shares)
    return [*rows, *optics, BudgetRow("combined", combined * strain, combined * modulus)]


def _optics(view: CameraView, *, stated: bool) -> Iterator[tuple[str, str]]:
    """What the view adds to strains, in words: removed, in the row strain where that is ``stated``, or not counted."""
    yield "motion off the plane", _motion(view, stated=stated)
    yield LENS, "in strain" if stated else "not stated: --lens, specimen.strain_error_um_m"
    shutter = "not stated: camera.readout_ms" if view.readout_ms is None else "removed"
    yield "rolling shutter", shutter if view.readout_ms != 0 else "none"


def _motion(view: CameraView, *, stated: bool) -> str:
    if view.both_sides:
        return "not in the mean of both sides"
    if view.plates:
        return "removed by plates; their noise is in scatter"
    if stated:
        return "in strain"
    if view.stand_off_mm is None:
        return "not stated: scale.stand_off_mm"
    per = MOTION_MM / view.stand_off_mm * 1e6
    return f"not counted: {MOTION_MM:g} mm at {view.stand_off_mm:g} mm is {per:.0f} µm/m"
