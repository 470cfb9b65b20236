"""The report of a test with several cameras: the figures by each; of sides mean and bending, the budget of the mean."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acquire.text import Message
from live.config.cameras import SIDES
from live.pipeline.measurement import AXIAL
from live.results.figures import headline
from live.results.report.curves import (
    TIME,
    axial_label,
    force_unit,
    load_labels,
    plots,
    strain_label,
    strain_unit,
)
from live.results.report.evaluation import EvaluatedCurve, intercept_of
from live.results.report.page import Html, element, page, paragraph, section, table
from live.results.report.report import Report, budget_table
from live.results.report.svg import COLOURS, Plot, PlotLine
from live.results.run_folder import RunFolder
from live.results.sides.together import SidesOfTest

ALIKE = Message(
    "The mean of both sides has neither bending nor motion towards a camera; front minus mean has both, which one "
    "camera a side cannot tell apart."
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
        element("h1", Message("{title}: front and back", front.title)),
        paragraph(Message("Test of {start}. {alike}", front.strain.start_utc, ALIKE), "dim"),
        section(Message("Curves"), plots(figures)),
        section(Message("Figures of the test"), _figures(sides, stresses)),
        section(Message("Strains at the end"), _strains(sides)),
        section(
            Message("Budget of E of the mean"),
            *budget_table(front, _evaluated(sides, stresses), both_sides=True),
        ),
        section(Message("The sides"), *_links(reports)),
    ]
    return Report(page(Message("{title}: phasedic report of two cameras", front.title), parts), figures)


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
    figures = (Plot("strain-time", Message("Strain along the load"), TIME, strain_label(e), lines),)
    heads = (Message("field"), *(row.name for row in next(iter(found.values()))))
    rows = [(name, *(row.text for row in one)) for name, one in found.items()]
    budgets = [
        section(Message("Budget of E, {name}", name), *budget_table(runs[name], curve))
        for name, curve in curves.items()
    ]
    parts = [
        element("h1", Message("{title}: {n} fields of view", first.title, len(runs))),
        paragraph(
            Message("Test of {start}, with one load cell and one clock.", first.strain.start_utc), "dim"
        ),
        section(Message("Curves"), plots(figures)),
        section(Message("Figures of the test"), table(heads, rows)),
        *budgets,
        section(Message("The fields"), *_links(reports)),
    ]
    return Report(
        page(Message("{title}: phasedic report of {n} fields", first.title, len(runs)), parts), figures
    )


def _links(reports: Mapping[str, str]) -> list[Html]:
    links = (
        (Message("report of the {side}", Message("{side}", side)), name) for side, name in reports.items()
    )
    return [element("p", element("a", words, href=name)) for words, name in links]


def _evaluated(sides: SidesOfTest, stresses: bool) -> EvaluatedCurve:
    curve, figures = sides.curve, sides.both
    nothing = np.full(len(curve.t), np.nan)
    across = nothing if curve.transverse is None else curve.transverse
    at = intercept_of(curve.strain, curve.stress, figures)
    return EvaluatedCurve(curve.strain, across, curve.stress, stresses, figures, at)


def _figures(sides: SidesOfTest, stresses: bool) -> Html:
    found = {where: headline(getattr(sides, where), stresses=stresses) for where in ("both", *SIDES)}
    heads = (Message("by the strain of"), *(row.name for row in found["both"]))
    return table(
        heads, [(Message("{where}", where), *(row.text for row in rows)) for where, rows in found.items()]
    )


def _strains(sides: SidesOfTest) -> Html:
    rows = []
    for name, one in sides.courses.items():
        known = np.flatnonzero(np.isfinite(one.mean))
        if len(known):
            k = known[-1]
            ends = (values[k] * 1e6 for values in (one.mean, one.bending, one.sigma))
            rows.append((name, *(Message("{strain:.1f}", end) for end in ends)))
    heads = "µm/m", Message("mean"), Message("front minus mean"), Message("sigma of either")
    return table(heads, rows, (1, 2, 3))


def _over_time(sides: SidesOfTest, part: str) -> Plot:
    found = {name: getattr(one, part) for name, one in sides.courses.items()}
    e = strain_unit(*found.values())
    lines = tuple(
        PlotLine(
            name, sides.courses[name].t, value * e.factor, sides.courses[name].sigma * e.factor, k % COLOURS
        )
        for k, (name, value) in enumerate(found.items())
    )
    title = Message("Mean of front and back") if part == "mean" else Message("Front minus mean")
    return Plot(f"{part}-time", title, TIME, strain_label(e), lines)


def _stress_strain(sides: SidesOfTest, stresses: bool) -> Plot:
    """The load over the axial strain of each side and of the mean, at the instants of the front."""
    axial, load = sides.courses[AXIAL], sides.curve.stress
    name, factor = ("MPa", 1e-6) if stresses else _force(load)
    strains = {
        "mean": axial.mean,
        "front": axial.mean + axial.bending,
        "back": axial.mean - axial.bending,
    }
    e = strain_unit(*strains.values())
    lines = tuple(
        PlotLine(Message("{side}", side), strain * e.factor, load * factor, colour=k)
        for k, (side, strain) in enumerate(strains.items())
    )
    title, up = load_labels(name, stresses=stresses)
    return Plot("stress-strain", title, axial_label(e), up, lines)


def _force(load: np.ndarray) -> tuple[str, float]:
    unit = force_unit(load)
    return unit.name, unit.factor
