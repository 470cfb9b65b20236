"""The budget of E: what its uncertainty is made of, before a test (``phasedic check``) and after it (the report).

Standard uncertainties combine as the GUM has it (JCGM 100:2008, 5.1.2); stated limits of error are taken as even
distributions (4.3.7). What is not stated is named, and is not in the sum.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from acquire.text import Message, word
from live.config.sections import CameraConfig, ScaleConfig

MOTION_MM = 0.1
"""Towards the camera, that the budget gives the strain of."""
LENS, BLUR = "lens", "blur"
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
    share : float
        Of E.
    modulus : float
        In the unit of E; NaN where E is not known.
    words : str
        Why it is not counted, and which key states it; else empty.
    """

    cause: str
    strain: float = math.nan
    share: float = math.nan
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
    sharpness : str
        What is known of a change of sharpness that is not counted, in words.
    """

    stand_off_mm: float | None = None
    readout_ms: float | None = None
    plates: bool = False
    both_sides: bool = False
    sharpness: str = Message("not known")

    @classmethod
    def of(cls, camera: CameraConfig, scale: ScaleConfig, *, plates: bool) -> CameraView:
        """As configured, before a test."""
        return cls(scale.stand_off_mm, camera.readout_ms, plates, sharpness=Message("the test shows it"))


def budget_rows(
    shares: Mapping[str, float], strain: float, modulus: float, view: CameraView, *, stresses: bool
) -> list[BudgetRow]:
    """The budget of E, the combined uncertainty last.

    Parameters
    ----------
    shares : mapping of str to float
        Relative standard uncertainties: scatter, what is stated of load cell, section and strain, of a lens that is
        corrected, and of a blur that came with the load.
    strain : float
        End of the elastic interval.
    modulus : float
        E in any unit; NaN where it is not known.
    view : CameraView
    stresses : bool
        The section is known.
    """

    def row(cause: str, share: float) -> BudgetRow:
        return BudgetRow(cause, share * strain, share, share * modulus)

    left_out = ({"section"} if not stresses else set()) | ({LENS, BLUR} - shares.keys())
    causes = [cause for cause in ("scatter", *_KEYS, LENS, BLUR) if cause not in left_out]
    rows = [
        row(cause, shares[cause])
        if cause in shares
        else BudgetRow(cause, words=Message("not stated: {key}", _KEYS.get(cause, "")))
        for cause in causes
    ]
    seen = _optics(view, stated="strain" in shares)
    optics = (BudgetRow(cause, words=words) for cause, words in seen if cause not in shares)
    return [*rows, *optics, row("combined", math.hypot(*shares.values()))]


def budget_cells(rows: Iterable[BudgetRow], unit: str, one: float) -> list[tuple[str, ...]]:
    """The table of a budget, heads first: um/m, % of E, and E where it is known, in ``unit``, ``one`` in that of E."""
    rows = list(rows)
    known = math.isfinite(rows[-1].modulus)

    def cells(row: BudgetRow) -> tuple[str, ...]:
        numbers = row.strain * 1e6, row.share * 100, row.modulus / one
        texts = (row.words, "", "") if row.words else tuple(Message("{number:.3g}", n) for n in numbers)
        return (word(row.cause), *texts[: 3 if known else 2])

    return [("", "µm/m", Message("% of E"), unit)[: 4 if known else 3], *map(cells, rows)]


def _optics(view: CameraView, *, stated: bool) -> Iterator[tuple[str, str]]:
    """What the view adds to strains, in words: removed, in the row strain where that is ``stated``, or not counted."""
    yield "motion off the plane", _motion(view, stated=stated)
    lens = Message("not stated: {key}", "--lens, specimen.strain_error_um_m")
    yield LENS, Message("in strain") if stated else lens
    yield BLUR, view.sharpness
    unknown = Message("not stated: {key}", "camera.readout_ms")
    shutter = unknown if view.readout_ms is None else Message("removed")
    yield "rolling shutter", shutter if view.readout_ms != 0 else Message("none")


def _motion(view: CameraView, *, stated: bool) -> str:
    if view.both_sides:
        return Message("not in the mean of both sides")
    if view.plates:
        return Message("removed by plates; their noise is in scatter")
    if stated:
        return Message("in strain")
    if view.stand_off_mm is None:
        return Message("not stated: {key}", "scale.stand_off_mm")
    per = MOTION_MM / view.stand_off_mm * 1e6
    return Message(
        "not counted: {motion:g} mm at {stand_off:g} mm is {per:.0f} µm/m", MOTION_MM, view.stand_off_mm, per
    )
