"""The section of a cyclic test: the figures of its cycles against their number, on a logarithmic axis."""

from __future__ import annotations

import math

import numpy as np

from live.results.figures import value_text
from live.results.finished.cycles import FILE, Cycles
from live.results.report.curves import force_unit, strain_unit
from live.results.report.page import Html, paragraph, table
from live.results.report.svg import Plot, PlotLine

_ROWS = 12  # of the table
_HEADS = ("cycle", "peak, valley of the force", "range of the strain", "secant modulus", "loop area", "phase")


def cycle_plots(cycles: Cycles) -> tuple[Plot, ...]:
    """Modulus with its sigma, ranges, peaks and valleys over the cycles."""
    column, (unit, one) = cycles.table.column, cycles.unit
    x, axis = np.log10(column("number")), "cycle, power of 10"
    e, force = (
        strain_unit(column("range_strain"), column("peak_strain")),
        column("peak_load") * (cycles.area_m2 or 1.0),
    )
    n, valley = force_unit(force), column("valley_load") * (cycles.area_m2 or 1.0)
    modulus = PlotLine("", x, column("modulus") / one, column("sigma_modulus") / one)
    strains = [
        PlotLine(name, x, column(f"{name}_strain") * e.factor, colour=k)
        for k, name in enumerate(("range", "peak", "valley"))
    ]
    forces = [PlotLine("peak", x, force * n.factor), PlotLine("valley", x, valley * n.factor, colour=1)]
    found = [
        Plot("cycles-modulus", "Secant modulus of the cycles", axis, f"modulus, {unit}", (modulus,)),
        Plot("cycles-strain", "Strain of the cycles", axis, f"strain, {e.name}", tuple(strains)),
        Plot("cycles-force", "Force of the cycles", axis, f"force, {n.name}", tuple(forces)),
    ]
    return tuple(one for one in found if any(np.isfinite(line.y).any() for line in one.curves))


def cycle_table(cycles: Cycles) -> list[Html]:
    """The figures of some cycles, at equal distances of the logarithm of their number."""
    last = len(cycles.table) - 1
    rows = np.unique(np.rint(np.geomspace(1, last + 1, _ROWS)).astype(int) - 1)
    words = (
        f"±: 1 sigma, of the scatter of bursts in the cycle. Area and phase hold what the force comes late beside the"
        f" pictures. {FILE} has all cycles."
    )
    lines = [paragraph(line) for line in cycles.lines()]
    return [
        *lines,
        table(_HEADS, (_row(cycles, int(k)) for k in rows), range(len(_HEADS))),
        paragraph(words, "dim"),
    ]


def _row(cycles: Cycles, k: int) -> tuple[str, ...]:
    def value(name: str) -> float:
        return float(cycles.table.column(name)[k])

    def text(name: str, unit_is: float, unit: str) -> str:
        return value_text(value(name) / unit_is, value(f"sigma_{name}") / unit_is, unit)

    area, (unit, one) = cycles.area_m2 or 1.0, cycles.unit
    forces = f"{value('peak_load') * area:.5g}, {value('valley_load') * area:.5g} N"
    energy = "J/m³" if cycles.area_m2 else "J/m"
    return (
        f"{k + 1}", forces, text("range_strain", 1e-6, "µm/m"), text("modulus", one, unit), text("area", 1, energy),
        text("phase", math.pi / 180, "°"),
    )  # fmt: skip
