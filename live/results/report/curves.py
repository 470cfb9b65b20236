"""The plots of a report: those of every test, of cycles against the logarithm of their number, and of a creep."""

from __future__ import annotations

import math

import numpy as np

from acquire.text import Amount, Message, joined
from acquire.text.quantity import unit_of
from analysis.evaluate import true_curve
from analysis.evaluate.programme import Creep
from live.config.figures import FIGURES
from live.config.gauges import gauge_colours
from live.results.finished.cycles import FILE, Cycles
from live.results.finished.finished_test import FinishedTest
from live.results.maps.colours import Unit, unit_for
from live.results.report.evaluation import EvaluatedCurve
from live.results.report.page import Html, captioned, element, paragraph, section, table
from live.results.report.page import joined as joined_html
from live.results.report.svg import Array, Mark, Plot, PlotLine, draw
from live.results.run_folder import RunFolder

_NAMES = ("exx", "eyy", "exy")
TIME = Message("time, s")
_ROUNDING = 1e-9  # of a figure: changes below are none

_ROWS = 12  # of the table
_HEADS = (
    Message("cycle"), Message("peak, valley of the force"), Message("range of the strain"), Message("secant modulus"),
    Message("loop area"), Message("phase"),
)  # fmt: skip


def load_unit(curve: EvaluatedCurve) -> Unit:
    """The unit of the load axis: MPa of stresses, N or kN of forces."""
    if curve.is_stress:
        return Unit("MPa", 1e-6)
    return force_unit(curve.load)


def force_unit(force: Array) -> Unit:
    """N or kN, from the largest."""
    largest = float(np.nanmax(np.abs(force))) if np.isfinite(force).any() else 0.0
    return unit_for(largest, "force")


def strain_label(e: Unit) -> str:
    """An axis of strains."""
    return Message("strain, {unit}", e.name)


def strain_unit(*strains: Array) -> Unit:
    """% or µm/m, from the largest of ``strains``."""
    values = [np.abs(e[np.isfinite(e)]) for e in strains]
    return unit_for(max((float(v.max()) for v in values if v.size), default=0.0))


def stress_strain(curve: EvaluatedCurve) -> Plot:
    """Stress (or force) over axial strain with the line of E and the construction of Rp0.2."""
    e, load, figures = strain_unit(curve.axial), load_unit(curve), curve.figures
    curves = [PlotLine(Message("measured"), curve.axial * e.factor, curve.load * load.factor)]
    marks = []
    if figures.E.known and math.isfinite(curve.intercept):
        label = "E" if curve.is_stress else "EA"
        curves.append(_straight(curve, label, 0.0, e, load))
    if figures.Rp02.known:
        curves.append(_straight(curve, Message("{offset:g} % offset", 0.2), 0.002, e, load))
        strain = 0.002 + (figures.Rp02.value - curve.intercept) / figures.E.value
        name = "Rp0.2" if curve.is_stress else "Fp0.2"
        proof = figures.Rp02.value * load.factor
        marks.append(Mark(strain * e.factor, proof, name, Message("{proof:.4g} {unit}", proof, load.name)))
    if figures.Rm.known:
        marks.append(_highest(curve, e, load))
    title, up = load_labels(load.name, stresses=curve.is_stress)
    return Plot("stress-strain", title, axial_label(e), up, tuple(curves), tuple(marks))


def load_labels(unit: str, *, stresses: bool) -> tuple[str, str]:
    """The title of a curve of the test, and its upward axis."""
    if stresses:
        return Message("Stress against strain"), Message("stress, {unit}", unit)
    return Message("Force against strain"), Message("force, {unit}", unit)


def axial_label(e: Unit) -> str:
    """The axis of the strain along the load."""
    return Message("axial strain, {unit}", e.name)


def true_stress_strain(curve: EvaluatedCurve) -> Plot | None:
    """True stress over true strain up to the highest stress; None without a section, or before that was passed."""
    if not (curve.is_stress and curve.figures.Ag.known):
        return None
    strain, stress = true_curve(curve.axial, curve.load)
    e, unit = strain_unit(strain), load_unit(curve)
    line = PlotLine("", strain * e.factor, stress * unit.factor)
    heads = Message("true strain, {unit}", e.name), Message("true stress, {unit}", unit.name)
    title = Message("True stress against true strain up to the highest force")
    return Plot("true-stress-strain", title, *heads, (line,))


def _highest(curve: EvaluatedCurve, e: Unit, load: Unit) -> Mark:
    """The point of the highest stress or force."""
    highest, name = curve.figures.Rm, "Rm" if curve.is_stress else "Fm"
    top = highest.value * load.factor
    strain = curve.axial[int(np.nanargmax(np.where(np.isfinite(curve.axial), curve.load, np.nan)))]
    return Mark(
        strain * e.factor, top, name, Message("{top:.4g} {unit}", top, load.name), is_bound=highest.is_bound
    )


def _straight(curve: EvaluatedCurve, label: str, offset: float, e: Unit, load: Unit) -> PlotLine:
    top = 1.05 * curve.figures.Rm.value
    y = np.array([0.0, top])
    x = offset + (y - curve.intercept) / curve.figures.E.value
    return PlotLine(label, x * e.factor, y * load.factor, colour=1 if not offset else 3, dashed=True)


def mean_strains(run: RunFolder) -> Plot:
    """Strains of the region against time, each in a band of one standard uncertainty."""
    values, t = run.strain.values, run.strain.time_s
    found = [np.asarray(values[name], np.float64) for name in _NAMES]
    e = strain_unit(*found)
    curves = tuple(
        PlotLine(name, t, mean * e.factor, np.asarray(values[f"sigma_{name}"], np.float64) * e.factor, colour)
        for colour, (name, mean) in enumerate(zip(_NAMES, found, strict=True))
    )
    title = Message("Strains of the region")
    return Plot("strain-time", title, TIME, strain_label(e), curves, x_range=time_range(run))


def gauge_strains(run: RunFolder) -> Plot | None:
    """Virtual gauges against time, each in a band of one standard uncertainty; None without any."""
    found = run.gauges
    if not found:
        return None
    e = strain_unit(*(gauge.value for gauge in found.values()))
    colours = gauge_colours({name: gauge.described for name, gauge in found.items()})
    curves = tuple(
        PlotLine(name, run.strain.time_s, gauge.value * e.factor, gauge.sigma * e.factor, colours[name])
        for name, gauge in found.items()
    )
    title = Message("Virtual gauges")
    return Plot("gauges-time", title, TIME, strain_label(e), curves, x_range=time_range(run))


def force(run: RunFolder) -> Plot | None:
    """Force against time, with every reading of the load cell where a session has them; None without force."""
    readings = run.readings.curve
    t, f = (readings.t, readings.values) if len(readings.t) else (run.strain.time_s, run.force)
    if not np.isfinite(f).any():
        return None
    unit = force_unit(f)
    curve = PlotLine("", t, f * unit.factor)
    up = Message("force, {unit}", unit.name)
    return Plot("force-time", Message("Force"), TIME, up, (curve,), x_range=time_range(run))


def others(run: RunFolder) -> list[Plot]:
    """The figures of the table that have a curve in the report, of a test in which they change."""
    found = []
    for one in FIGURES:
        values = np.asarray(run.strain.values.get(one.name, math.nan), np.float64)
        if not one.report or not np.isfinite(values).any():
            continue
        largest = float(np.nanmax(np.abs(values)))
        if np.nanmax(values) - np.nanmin(values) <= _ROUNDING * largest:
            continue
        unit, sigma = unit_of(one.kind, largest), run.strain.values.get(f"sigma_{one.name}")
        band = None if sigma is None else np.asarray(sigma, np.float64) / unit.one
        curve = PlotLine("", run.strain.time_s, values / unit.one, band)
        up = joined(", ", (one.said, unit.name or one.unit))
        found.append(Plot(f"{one.plain}-time", one.said, TIME, up, (curve,), x_range=time_range(run)))
    return found


def valid_share(run: RunFolder) -> Plot:
    """Share of ZOIs with a value against time."""
    values = run.strain.values
    share = 100.0 * np.asarray(values["n_valid"], np.float64) / np.maximum(values["n_zoi"], 1)
    curve = PlotLine("", run.strain.time_s, share)
    return Plot(
        "valid-time", Message("ZOIs with a value"), TIME, Message("share, %"), (curve,), (), time_range(run),
        (0.0, 100.0),
    )  # fmt: skip


def parts(run: RunFolder) -> str:
    """When the strains of the region and of gauges stand for a part of their area; empty where they never do."""
    names = [name for name in run.strain.values if name == "area_share" or name.startswith("share_gauge_")]
    columns = [np.asarray(run.strain.values[name], np.float64) for name in names] or [np.ones(1)]
    # A gauge that lies partly off the region has a share below 1 throughout: a remark of its own says so.
    shares = np.min([column / np.nanmax(column, initial=1e-9) for column in columns], axis=0)
    rows = np.flatnonzero(shares < 1)
    if not rows.size:
        return ""
    first, last = (float(run.strain.time_s[row]) for row in (rows[0], rows[-1]))
    return Message(
        "A block of ZOIs had no value at {rows} of {all} instants, from {first:.4g} to {last:.4g} s: strains there "
        "stand for part of their area, at least {least:.0f} %.",
        rows.size, len(shares), first, last, 100 * shares.min(),
    )  # fmt: skip


def time_range(run: RunFolder) -> tuple[float, float]:
    """The time axis of all plots against time."""
    t = run.strain.time_s
    first, last = float(min(0.0, t[0])), float(t[-1])
    return (first, last) if last > first else (first, first + 1.0)


def creep_plot(found: Creep) -> Plot:
    """Strain over the logarithm of the time since the force is held."""
    e, axis = strain_unit(found.strain), Message("time since the force is held, power of 10 of 1 s")
    line = PlotLine("", np.log10(found.t), found.strain * e.factor)
    return Plot("creep", Message("Strain of the hold"), axis, strain_label(e), (line,))


def plots(figures: tuple[Plot, ...]) -> Html:
    """Plots side by side, as many as the width allows."""
    found = [
        captioned(Html(draw(figure).replace("<svg ", '<svg class="plot" ', 1)), figure.title)
        for figure in figures
    ]
    return element("div", joined_html(found), class_="plots")


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
