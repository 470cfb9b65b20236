"""The report of a test with several cameras: the figures by each; of sides mean and bending, the budget of the mean."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from live.config.cameras import SIDES
from live.pipeline.measurement import AXIAL
from live.results.figures import headline
from live.results.report.curves import force_unit, strain_unit
from live.results.report.evaluation import EvaluatedCurve, intercept_of
from live.results.report.page import Html, element, page, paragraph, section, table
from live.results.report.report import Report, budget_table, plots
from live.results.report.svg import COLOURS, Plot, PlotLine
from live.results.run_folder import RunFolder
from live.results.sides.together import SidesOfTest

ALIKE = (
    "The mean of both sides has neither bending nor motion towards a camera; front minus mean has both, which one"
    " camera on each side cannot tell apart."
)


def report_of_sides(front: RunFolder, back: RunFolder, reports: dict[str, str]) -> Report:
    """The report of both sides.

    Parameters
    ----------
    front, back : RunFolder
    reports : mapping of side to str
        Relative addresses of the reports of the sides.

    Raises
    ------
    DataError
        They are not of one test, or cannot be read.
    """
    sides = SidesOfTest.of_folders(front, back)
    stresses = front.specimen.area_m2 is not None
    figures = _stress_strain(sides, stresses), _over_time(sides, "mean"), _over_time(sides, "bending")
    parts = [
        element("h1", f"{front.title}: front and back"),
        paragraph(f"Test of {front.strain.start_utc}. {ALIKE}", "dim"),
        section("Curves", plots(figures)),
        section("Figures of the test", _figures(sides, stresses)),
        section("Strains at the end", _strains(sides)),
        section(
            "Budget of E of the mean", *budget_table(front, _evaluated(sides, stresses), both_sides=True)
        ),
        section("The sides", *_links(reports)),
    ]
    return Report(page(f"{front.title}: phasedic report of two cameras", parts), figures)


def report_of_fields(runs: Mapping[str, RunFolder], reports: Mapping[str, str]) -> Report:
    """The report of several fields of view, each with its own strains; parameters as of ``report_of_sides``."""
    first = next(iter(runs.values()))
    stresses = first.specimen.area_m2 is not None
    curves = {name: EvaluatedCurve.of(run) for name, run in runs.items()}
    found = {name: headline(curve.figures, stresses=stresses) for name, curve in curves.items()}
    e = strain_unit(*(curve.axial for curve in curves.values()))
    lines = tuple(
        PlotLine(name, np.asarray(runs[name].strain.time_s, np.float64), curve.axial * e.factor, colour=k)
        for k, (name, curve) in enumerate(curves.items())
    )
    figures = (Plot("strain-time", "Strain along the load", "time, s", f"strain, {e.name}", lines),)
    heads = ("field", *(row.name for row in next(iter(found.values()))))
    rows = [(name, *(row.text for row in one)) for name, one in found.items()]
    budgets = [
        section(f"Budget of E, {name}", *budget_table(runs[name], curve)) for name, curve in curves.items()
    ]
    parts = [
        element("h1", f"{first.title}: {len(runs)} fields of view"),
        paragraph(f"Test of {first.strain.start_utc}, with one load cell and one clock.", "dim"),
        section("Curves", plots(figures)),
        section("Figures of the test", table(heads, rows)),
        *budgets,
        section("The fields", *_links(reports)),
    ]
    return Report(page(f"{first.title}: phasedic report of {len(runs)} fields", parts), figures)


def _links(reports: Mapping[str, str]) -> list[Html]:
    return [element("p", element("a", f"report of the {side}", href=name)) for side, name in reports.items()]


def _evaluated(sides: SidesOfTest, stresses: bool) -> EvaluatedCurve:
    curve, figures = sides.curve, sides.both
    nothing = np.full(len(curve.t), np.nan)
    across = nothing if curve.transverse is None else curve.transverse
    at = intercept_of(curve.strain, curve.stress, figures)
    return EvaluatedCurve(curve.strain, across, curve.stress, stresses, figures, at)


def _figures(sides: SidesOfTest, stresses: bool) -> Html:
    found = {where: headline(getattr(sides, where), stresses=stresses) for where in ("both", *SIDES)}
    heads = ("by the strain of", *(row.name for row in found["both"]))
    return table(heads, [(where, *(row.text for row in rows)) for where, rows in found.items()])


def _strains(sides: SidesOfTest) -> Html:
    rows = []
    for name, one in sides.courses.items():
        known = np.flatnonzero(np.isfinite(one.mean))
        if len(known):
            k = known[-1]
            rows.append((name, *(f"{values[k] * 1e6:.1f}" for values in (one.mean, one.bending, one.sigma))))
    return table(("µm/m", "mean", "front minus mean", "sigma of either"), rows, (1, 2, 3))


def _over_time(sides: SidesOfTest, part: str) -> Plot:
    found = {name: getattr(one, part) for name, one in sides.courses.items()}
    e = strain_unit(*found.values())
    lines = tuple(
        PlotLine(
            name, sides.courses[name].t, value * e.factor, sides.courses[name].sigma * e.factor, k % COLOURS
        )
        for k, (name, value) in enumerate(found.items())
    )
    title = "Mean of front and back" if part == "mean" else "Front minus mean"
    return Plot(f"{part}-time", title, "time, s", f"strain, {e.name}", lines)


def _stress_strain(sides: SidesOfTest, stresses: bool) -> Plot:
    """The load over the axial strain of each side and of the mean, at the instants of the front."""
    axial, load = sides.courses[AXIAL], sides.curve.stress
    what, name, factor = ("stress", "MPa", 1e-6) if stresses else ("force", *_force(load))
    strains = {
        "mean": axial.mean,
        "front": axial.mean + axial.bending,
        "back": axial.mean - axial.bending,
    }
    e = strain_unit(*strains.values())
    lines = tuple(
        PlotLine(side, strain * e.factor, load * factor, colour=k)
        for k, (side, strain) in enumerate(strains.items())
    )
    title = f"{what.capitalize()} against strain"
    return Plot("stress-strain", title, f"axial strain, {e.name}", f"{what}, {name}", lines)


def _force(load: np.ndarray) -> tuple[str, float]:
    unit = force_unit(load)
    return unit.name, unit.factor
