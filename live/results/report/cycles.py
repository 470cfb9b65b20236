"""The sections of cyclic tests, figures of cycles against the logarithm of their number, and of a creep."""

from __future__ import annotations

import math

import numpy as np

from acquire.text import Message
from acquire.text.message import joined
from acquire.text.quantity import Amount
from live.results.finished.cycles import FILE, Cycles
from live.results.finished.finished_test import FinishedTest
from live.results.report.curves import creep_plot, force_unit, plots, strain_unit
from live.results.report.page import Html, paragraph, section, table
from live.results.report.page import joined as joined_html
from live.results.report.svg import Plot, PlotLine

_ROWS = 12  # of the table
_HEADS = (
    Message("cycle"), Message("peak, valley of the force"), Message("range of the strain"), Message("secant modulus"),
    Message("loop area"), Message("phase"),
)  # fmt: skip


def long_sections(test: FinishedTest) -> Html:
    """The section of the cycles, or of the creep, of a test that has them."""
    found, creep = [], test.creep
    if test.cycles.any:
        found.append(section(Message("Cycles"), plots(cycle_plots(test.cycles)), *cycle_table(test.cycles)))
    if creep is not None and len(creep.t):
        found.append(section(Message("Creep"), plots((creep_plot(creep),)), *map(paragraph, test.longer[:1])))
    return joined_html(found)


def cycle_plots(cycles: Cycles) -> tuple[Plot, ...]:
    """Modulus with its sigma, ranges, peaks and valleys over the cycles."""
    column, (unit, one) = cycles.table.column, cycles.unit
    x, axis = np.log10(column("number")), Message("cycle, power of 10")
    e, force = (
        strain_unit(column("range_strain"), column("peak_strain")),
        column("peak_load") * (cycles.area_m2 or 1.0),
    )
    n, valley = force_unit(force), column("valley_load") * (cycles.area_m2 or 1.0)
    modulus = PlotLine("", x, column("modulus") / one, column("sigma_modulus") / one)
    names = {"range": Message("range"), "peak": Message("peak"), "valley": Message("valley")}
    strains = [
        PlotLine(words, x, column(f"{name}_strain") * e.factor, colour=k)
        for k, (name, words) in enumerate(names.items())
    ]
    forces = [
        PlotLine(names["peak"], x, force * n.factor),
        PlotLine(names["valley"], x, valley * n.factor, colour=1),
    ]
    heads = (
        Message("modulus, {unit}", unit),
        Message("strain, {unit}", e.name),
        Message("force, {unit}", n.name),
    )
    found = [
        Plot("cycles-modulus", Message("Secant modulus of the cycles"), axis, heads[0], (modulus,)),
        Plot("cycles-strain", Message("Strain of the cycles"), axis, heads[1], tuple(strains)),
        Plot("cycles-force", Message("Force of the cycles"), axis, heads[2], tuple(forces)),
    ]
    return tuple(one for one in found if any(np.isfinite(line.y).any() for line in one.curves))


def cycle_table(cycles: Cycles) -> list[Html]:
    """The figures of some cycles, at equal distances of the logarithm of their number."""
    last = len(cycles.table) - 1
    rows = np.unique(np.rint(np.geomspace(1, last + 1, _ROWS)).astype(int) - 1)
    words = Message(
        "±: 1 sigma, of the scatter of bursts in the cycle. A force later than the pictures adds to area and phase."
        " {file} has all cycles.",
        FILE,
    )
    lines = [paragraph(line) for line in cycles.lines()]
    return [
        *lines,
        table(_HEADS, (_row(cycles, int(k)) for k in rows), range(len(_HEADS))),
        paragraph(words, "dim"),
    ]


def _row(cycles: Cycles, k: int) -> tuple[object, ...]:
    def value(name: str) -> float:
        return float(cycles.table.column(name)[k])

    def amount(name: str, kind: str = "", one: float = 1.0) -> Amount:
        return Amount(kind, value(name) / one, value(f"sigma_{name}") / one, 2)

    area, kind = cycles.area_m2 or 1.0, "stress" if cycles.area_m2 else "force"
    forces = [Amount.rough("force", value(f"{end}_load") * area, 5) for end in ("peak", "valley")]
    energy = "J/m³" if cycles.area_m2 else "J/m"
    return (
        f"{k + 1}", joined(", ", forces), amount("range_strain", "strain"), amount("modulus", kind),
        joined(" ", [amount("area"), energy]), joined(" ", [amount("phase", one=math.pi / 180), "°"]),
    )  # fmt: skip
