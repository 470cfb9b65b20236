"""The cycles of a finished test: ``cycles.csv``, and what summary, page, report and figures.json say of them.

What they say of the creep of a finished test is here too.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.text import Amount, Message, joined
from analysis.evaluate import Curve, Figure, Track
from analysis.evaluate.curve import broken_at
from analysis.evaluate.cyclic.cycles import CycleTable
from analysis.evaluate.cyclic.loop import BurstStrains
from analysis.evaluate.figure import quantile
from analysis.evaluate.programme import Creep
from live.config.new_files import new_file
from live.results.figures import figure_text
from live.results.stored_fields import Readings

Floats = NDArray[np.float64]
FILE = "cycles.csv"
COLUMNS = {
    "cycle": ("", "number, from 1"),
    "time_s": (
        "s",
        "beginning, since the start of the test: half a cycle before the middle of its upper half",
    ),
    "duration_s": ("s", "from the middle of the upper half before"),
    "bursts": ("", "measured bursts with a strain"),
    "peak_N": ("N", "highest force"),
    "valley_N": ("N", "lowest force"),
    "mean_N": ("N", "middle of the two"),
    "range_N": ("N", "difference of the two"),
    "sigma_range_N": ("N", "its standard uncertainty"),
    "peak_strain": ("", "highest axial strain, as all others without the drift over the cycle"),
    "valley_strain": ("", "lowest axial strain"),
    "mean_strain": ("", "middle of the two"),
    "range_strain": ("", "difference of the two"),
    "sigma_range_strain": ("", "its standard uncertainty"),
    "secant_modulus_Pa": (
        "Pa",
        "range of the stress over the change of the strain between its peak and valley",
    ),
    "sigma_secant_modulus_Pa": ("Pa", "its standard uncertainty"),
    "loop_area_J_per_m3": ("J/m3", "energy that the cycle leaves in the volume"),
    "sigma_loop_area_J_per_m3": ("J/m3", "its standard uncertainty"),
    "phase_rad": ("rad", "by which the first harmonic of the strain comes after that of the stress"),
    "sigma_phase_rad": ("rad", "its standard uncertainty"),
    "reason": ("", "why strain or modulus are not known; mostly empty"),
}
"""Of ``cycles.csv``: unit and meaning. Without a section the modulus is in N, the area in J/m."""
_FORCES = slice(4, 9)


@dataclass(frozen=True, slots=True, eq=False)
class Cycles:
    """The cycles of a test.

    Attributes
    ----------
    table : CycleTable
        Loads in Pa, or N where the section is not known; none where the test is not cyclic.
    area_m2 : float or None
    """

    table: CycleTable
    area_m2: float | None = None

    @classmethod
    def none(cls) -> Cycles:
        """A test that is not cyclic."""
        return cls(CycleTable.none())

    @property
    def any(self) -> bool:
        """Whether there are cycles."""
        return len(self.table) > 0

    @classmethod
    def of(
        cls,
        curve: Curve,
        strain: Floats,
        width: Floats,
        samples: Readings,
        area_m2: float | None,
        start_t: float = 0.0,
    ) -> Cycles:
        """Cycles in the ``strain`` (T,) of bursts that are means over ``width`` (s), and ``samples`` of the force (N).

        Both on one clock, of which ``start_t`` (s) is the zero of the table.
        """
        stop = broken_at(curve.stress, curve.strain)
        bursts = BurstStrains(curve.t, strain, width).part(slice(None if stop is None else stop + 1))
        step = float(np.median(np.diff(curve.t, prepend=curve.t[:1]))) if len(curve.t) else 0.0
        ends = bursts.t[:1].sum() - step, bursts.t[-1:].sum() + step

        def load(piece: Track) -> Track:
            known = piece.known()
            first, last = np.searchsorted(known.t, ends)
            return Track(known.t[first:last], known.values[first:last] / (area_m2 or 1.0))

        loaded = any(len(piece.known().t) for piece in samples.pieces())
        return cls(CycleTable.of(map(load, samples.pieces()) if loaded else None, bursts, start_t), area_m2)

    @property
    def moduli(self) -> dict[int, Figure]:
        """The secant moduli of the first and the last cycle that have one, by their numbers."""
        modulus, sigma = (self.table.column(name).tolist() for name in ("modulus", "sigma_modulus"))
        known = np.flatnonzero(np.isfinite(modulus))
        return {int(k) + 1: Figure.about(modulus[k], sigma[k]) for k in (*known[:1], *known[-1:])}

    @property
    def change(self) -> Figure:
        """Change of the secant modulus from the first cycle to the last, over that of the first."""
        if len(self.moduli) < 2:
            return Figure.none(Message("two cycles with a secant modulus are needed"))
        first, last = self.moduli.values()
        share = last.value / first.value
        relative = (abs((one.high - one.value) / quantile() / one.value) for one in (first, last))
        return Figure.about(share - 1, abs(share) * math.hypot(*relative))

    @property
    def unit(self) -> tuple[str, float]:
        """Unit of the modulus for a person, and what it is in that of the table."""
        return ("GPa", 1e9) if self.area_m2 else ("kN", 1e3)

    @property
    def _why(self) -> str:
        return next(filter(None, reversed(self.table.why)), "")

    def figures(self) -> Iterator[tuple[str, Figure, str]]:
        """Name, figure and SI unit of what other programs get; nothing of a test that is not cyclic."""
        if not self.any:
            return
        n, none, moduli = len(self.table), Figure.none(self._why), [*self.moduli.values()]
        yield "cycles", Figure(n, n, n), "1"
        for k, words in ((0, "first"), (-1, "last")):
            found = moduli[k] if moduli else none
            yield f"secant modulus of the {words} cycle", found, "Pa" if self.area_m2 else "N"
        yield "change of the secant modulus", self.change, "1"
        value, sigma = (float(self.table.column(f"{name}range_strain")[-1]) for name in ("", "sigma_"))
        ranged = Figure.about(value, sigma) if math.isfinite(value) else none
        yield "strain range of the last cycle", ranged, "1"

    def lines(self) -> list[str]:
        """What a person reads; nothing of a test that is not cyclic."""
        if not self.any:
            return []
        text = Message("{count} cycles of {duration:.4g} s", len(self.table), self._duration)
        if not self.moduli:
            return [text + Message("; secant modulus not known: {why}", self._why)]
        found = [
            Message("{modulus} in cycle {number}", figure_text(one, *self.unit[::-1]), k)
            for k, one in self.moduli.items()
        ]
        if self.change.known:
            found.append(Message("a change of {change}", figure_text(self.change, 0.01, "%")))
        return [text + Message("; secant modulus {found}", joined(", ", found))]

    @property
    def _duration(self) -> float:
        return float(np.median(self.table.column("duration")))

    def write(self, folder: Path) -> None:
        """Write ``cycles.csv`` of a cyclic test; raises DataError or ConfigError where that cannot be done."""
        if not self.any:
            return
        of_force = [name.replace("_Pa", "_N").replace("_m3", "_m") for name in COLUMNS]
        factors = np.ones(len(COLUMNS) - 1)
        factors[_FORCES] = self.area_m2 or 1.0
        with new_file(folder / FILE) as part, part.open("x", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(COLUMNS if self.area_m2 else of_force)
            for values, why in zip(self.table.values, self.table.why, strict=True):
                rows.writerow([*(f"{value:.10g}" for value in values * factors), why])


def shown_figures(cycles: Cycles) -> list[dict[str, object]]:
    """The cycles as rows of figures of the page; none of a test that is not cyclic."""
    kind = "stress" if cycles.area_m2 else "force"
    found = [
        {
            "name": Message("secant modulus of cycle {number}", number),
            "text": Amount(kind, one.value, one.high - one.value, 2),
        }
        for number, one in cycles.moduli.items()
    ]
    words = {"name": Message("cycles"), "text": str(len(cycles.table)), "words": True}
    return [words, *found] if cycles.any else []


def creep_figures(creep: Creep | None) -> Iterator[tuple[str, Figure, str]]:
    """Name, figure and SI unit of what other programs get; nothing of a test whose force is not held."""
    if creep is not None:
        yield "creep rate", creep.rate, "1/s"
        for strain, time in creep.times:
            yield f"time to a strain of {strain:.6g}", time, "s"


def creep_lines(creep: Creep | None, *, stresses: bool) -> list[str]:
    """What a person reads; nothing of a test whose force is not held."""
    if creep is None:
        return []
    rate = joined("/", [_amount("strain", creep.rate), "s"]) if creep.rate.known else creep.rate.why
    found = [
        Message("{strain} after {time}", Amount.rough("strain", strain, 4), _amount("time", time))
        for strain, time in creep.times
    ]
    load, duration = Amount.rough("stress" if stresses else "force", creep.load, 4), creep.t[-1:].sum()
    held = Message(
        "{load} held from {since:.4g} s on: mean strain rate in the last half of {duration:.4g} s: {rate}",
        load, creep.since, duration, rate,
    )  # fmt: skip
    return [joined(", ", [held, *found])]


def _amount(kind: str, figure: Figure) -> Amount:
    return Amount(kind, figure.value, figure.high - figure.value, 2)
