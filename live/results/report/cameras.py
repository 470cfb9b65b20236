"""The report of a test with several cameras: the figures by each; of sides mean and bending, the budget of the mean."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acquire.text import Message
from acquire.text.message import word
from analysis.evaluate import TensileFigures
from live.config.cameras import BACK, FRONT
from live.pipeline.measurement import AXIAL
from live.results.figures import headline
from live.results.maps.colours import Unit
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
from live.results.report.svg import COLOURS, Array, Plot, PlotLine
from live.results.run_folder import RunFolder
from live.results.sides import SidesOfTest, at_end

ALIKE = Message(
    "The mean of both sides has neither bending nor motion towards a camera; front minus mean has both, which one "
    "camera a side cannot tell apart."
)


_Parts = tuple[str, str, tuple[Plot, ...], Mapping[str, TensileFigures], list[Html]]
"""What sides and fields have of their own: title, words on the test, plots, figures by whose strain, sections."""


def report_of_cameras(runs: Mapping[str, RunFolder], reports: Mapping[str, str]) -> Report:
    """The report of all cameras of a test: the figures by each; of sides mean and bending, and the budget of the mean.

    Parameters
    ----------
    runs : mapping of str to RunFolder
        By the names of the cameras.
    reports : mapping of str to str
        Relative addresses of the report of each.

    Raises
    ------
    DataError
        They are not of one test, or cannot be read.
    """
    first = next(iter(runs.values()))
    stresses = first.specimen.area_m2 is not None
    title, words, figures, by_strain, sections = (_of_sides if FRONT in runs else _of_fields)(runs, stresses)
    found = {name: headline(one, stresses=stresses) for name, one in by_strain.items()}
    heads = (Message("by the strain of"), *(row.name for row in next(iter(found.values()))))
    rows = [(word(name), *(row.text for row in one)) for name, one in found.items()]
    links = (
        element("p", element("a", Message("report of the {side}", word(side)), href=name))
        for side, name in reports.items()
    )
    content = [
        element("h1", title),
        paragraph(words, "dim"),
        section(Message("Curves"), plots(figures)),
        section(Message("Figures of the test"), table(heads, rows)),
        *sections,
        section(Message("The cameras"), *links),
    ]
    head = Message("{title}: phasedic report of {n} cameras", first.title, len(runs))
    return Report(page(head, content), figures)


def _of_sides(runs: Mapping[str, RunFolder], stresses: bool) -> _Parts:
    front = runs[FRONT]
    sides = SidesOfTest.of_folders(front, runs[BACK])
    budget = budget_table(front, _evaluated(sides, stresses), both_sides=True)
    means = {name: (one.t, one.mean, one.sigma) for name, one in sides.courses.items()}
    bending = {name: (one.t, one.bending, one.sigma) for name, one in sides.courses.items()}
    return (
        Message("{title}: front and back", front.title),
        Message("Test of {start}. {alike}", front.strain.start_utc, ALIKE),
        (
            _stress_strain(sides, stresses),
            _over_time("mean-time", Message("Mean of front and back"), means),
            _over_time("bending-time", Message("Front minus mean"), bending),
        ),
        sides.figures,
        [
            section(Message("Strains at the end"), _strains(sides)),
            section(Message("Budget of E of the mean"), *budget),
        ],
    )


def _of_fields(runs: Mapping[str, RunFolder], stresses: bool) -> _Parts:
    """Several fields of view, each with its own strains."""
    first = next(iter(runs.values()))
    curves = {name: EvaluatedCurve.of(run) for name, run in runs.items()}
    axial: dict[str, tuple[Array, Array, None]] = {
        word(name): (np.asarray(runs[name].strain.time_s, np.float64), curve.axial, None)
        for name, curve in curves.items()
    }
    return (
        Message("{title}: {n} fields of view", first.title, len(runs)),
        Message("Test of {start}, with one load cell and one clock.", first.strain.start_utc),
        (_over_time("strain-time", Message("Strain along the load"), axial),),
        {name: curve.figures for name, curve in curves.items()},
        [
            section(Message("Budget of E, {name}", name), *budget_table(runs[name], curve))
            for name, curve in curves.items()
        ],
    )


def _evaluated(sides: SidesOfTest, stresses: bool) -> EvaluatedCurve:
    curve, figures = sides.curve, sides.figures["both"]
    nothing = np.full(len(curve.t), np.nan)
    across = nothing if curve.transverse is None else curve.transverse
    at = intercept_of(curve.strain, curve.stress, figures)
    return EvaluatedCurve(curve.strain, across, curve.stress, stresses, figures, at)


def _strains(sides: SidesOfTest) -> Html:
    ends = at_end(sides.courses).items()
    rows = [(name, *(Message("{strain:.1f}", value * 1e6) for value in one[:3])) for name, one in ends]
    heads = "µm/m", Message("mean"), Message("front minus mean"), Message("sigma of either")
    return table(heads, rows, (1, 2, 3))


def _over_time(name: str, title: str, courses: Mapping[str, tuple[Array, Array, Array | None]]) -> Plot:
    """Strains over time by their labels: time, value, and sigma where it is shown, each (N,)."""
    e = strain_unit(*(strain for _, strain, _ in courses.values()))
    lines = tuple(
        PlotLine(label, t, strain * e.factor, None if sigma is None else sigma * e.factor, k % COLOURS)
        for k, (label, (t, strain, sigma)) in enumerate(courses.items())
    )
    return Plot(name, title, TIME, strain_label(e), lines)


def _stress_strain(sides: SidesOfTest, stresses: bool) -> Plot:
    """The load over the axial strain of each side and of the mean, at the instants of the front."""
    axial, load = sides.courses[AXIAL], sides.curve.stress
    unit = Unit("MPa", 1e-6) if stresses else force_unit(load)
    strains = {"mean": axial.mean, "front": axial.mean + axial.bending, "back": axial.mean - axial.bending}
    e = strain_unit(*strains.values())
    lines = tuple(
        PlotLine(word(side), strain * e.factor, load * unit.factor, colour=k)
        for k, (side, strain) in enumerate(strains.items())
    )
    title, up = load_labels(unit.name, stresses=stresses)
    return Plot("stress-strain", title, axial_label(e), up, lines)
