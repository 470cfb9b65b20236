"""Several runs in one report: tests compared, or the cameras of one test."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from acquire.errors import ConfigError
from acquire.text import Message, word
from analysis.evaluate import CONFIDENCE, TensileFigures
from live.config.cameras import BACK, FRONT
from live.pipeline.measurement import AXIAL
from live.results.figures import NOT_KNOWN, TensileRow, figure_text, headline
from live.results.maps.colours import Unit
from live.results.report.curves import (
    TIME,
    axial_label,
    force_unit,
    load_labels,
    load_unit,
    plots,
    strain_label,
    strain_unit,
)
from live.results.report.evaluation import EvaluatedCurve, intercept_of
from live.results.report.page import Html, element, joined, page, paragraph, safe, section, table
from live.results.report.report import Report, budget_table
from live.results.report.svg import COLOURS, Array, Plot, PlotLine
from live.results.run_folder import RunFolder
from live.results.sides import SidesOfTest, at_end
from live.words.language import told

ALIKE = Message(
    "The mean of both sides has neither bending nor motion towards a camera; front minus mean has both, which one "
    "camera a side cannot tell apart."
)


_Parts = tuple[str, str, tuple[Plot, ...], Mapping[str, TensileFigures], list[Html]]
"""What sides and fields have of their own: title, words on the test, plots, figures by whose strain, sections."""


_MIN_RUNS = 2
_MAX_LABELS = 50  # letters above the curves; longer names are replaced by numbers


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


@dataclass(frozen=True, slots=True, eq=False)
class ComparedTest:
    """One of the tests compared."""

    title: str
    path: str
    curve: EvaluatedCurve


def tests_of(runs: Sequence[RunFolder]) -> list[ComparedTest]:
    """The curves of ``runs``.

    Raises
    ------
    ConfigError
        Fewer than two, or some with stresses and some with forces alone.
    DataError
        One holds no measurement.
    """
    if len(runs) < _MIN_RUNS:
        raise ConfigError("--compare needs at least two runs")
    for run in runs:
        run.strain.check_measured()
    found = [ComparedTest(run.title, str(run.path), EvaluatedCurve.of(run)) for run in runs]
    if len({test.curve.is_stress for test in found}) > 1:
        without = ", ".join(test.path for test in found if not test.curve.is_stress)
        raise ConfigError(
            "{runs}: no section is known, the other runs have stresses; replay it with --section W,T to compare",
            without,
        )
    return found


def _rows(tests: Sequence[ComparedTest]) -> list[tuple[TensileRow, ...]]:
    """For each figure, the rows of all tests."""
    found = (headline(test.curve.figures, stresses=test.curve.is_stress) for test in tests)
    return list(zip(*found, strict=True))


def summary(values: Sequence[float]) -> tuple[float, float, int]:
    """Mean, standard deviation (n - 1) and number of the values that are known."""
    known = [value for value in values if math.isfinite(value)]
    mean = float(np.mean(known)) if known else math.nan
    return mean, float(np.std(known, ddof=1)) if len(known) > 1 else math.nan, len(known)


def compare(tests: Sequence[ComparedTest]) -> Report:
    """The report: the curves in one plot, and the table."""
    e = strain_unit(*(test.curve.axial for test in tests))
    load = load_unit(max((test.curve for test in tests), key=lambda c: np.nanmax(c.load, initial=0.0)))
    names = [test.title for test in tests]
    if sum(len(name) for name in names) > _MAX_LABELS:
        names = [str(k + 1) for k in range(len(tests))]
    lines = tuple(
        PlotLine(names[k], test.curve.axial * e.factor, test.curve.load * load.factor, colour=k)
        for k, test in enumerate(tests)
    )
    title, up = load_labels(load.name, stresses=tests[0].curve.is_stress)
    figures = (Plot("comparison", title, axial_label(e), up, lines),)
    words = Message(
        "E, nu and the strengths of each test, as in its own report, with half of the interval ({CONFIDENCE:.0%}); "
        "mean and standard deviation are over the tests.",
        CONFIDENCE,
    )
    parts = [
        element("h1", Message("Comparison of {n} tests", len(tests))),
        section(Message("Curves"), plots(figures)),
        section(Message("Figures"), paragraph(words, "dim"), _table(tests)),
    ]
    return Report(page(Message("Comparison of tests"), parts), figures)


def write_table(tests: Sequence[ComparedTest], file: TextIO) -> None:
    """The figures as CSV, each beside half of its interval: a line a test, then mean, standard deviation and n."""
    figures = _rows(tests)
    heads = [f"{end}{row.column}" for row, *_ in figures for end in ("", "half_")]
    file.write(f"test,path,{','.join(heads)},strain of E and nu\n")
    for k, test in enumerate(tests):
        values = ",".join(f"{rows[k].figure.value:.8g},{rows[k].figure.half:.8g}" for rows in figures)
        file.write(
            f"{_quoted(test.title)},{_quoted(test.path)},{values},{_quoted(test.curve.figures.elastic_strain)}\n"
        )
    found = [_summary(rows) for rows in figures]
    for name, part in (("mean", 0), ("standard deviation", 1), ("n", 2)):
        file.write(f"{name},,{','.join(f'{one[part]:.8g},' for one in found)},\n")


def _summary(rows: Sequence[TensileRow]) -> tuple[float, float, int]:
    """Mean, scatter and number of the values; a bound is none."""
    return summary([math.nan if row.figure.is_bound else row.figure.value for row in rows])


def _quoted(words: str) -> str:
    """A field of a CSV that no spreadsheet reads as a formula."""
    plain = words.lstrip("=+-@\t ") or "-"
    return '"' + plain.replace('"', '""') + '"'


def _table(tests: Sequence[ComparedTest]) -> Html:
    figures = _rows(tests)
    heads = ["", *(row.column.replace("_", ", ") for row, *_ in figures), Message("strain of E and nu")]
    rows: list[list[object]] = [
        [
            f"{k + 1} {test.title}",
            *(_cell(of_tests[k]) for of_tests in figures),
            test.curve.figures.elastic_strain,
        ]
        for k, test in enumerate(tests)
    ]
    found = [_summary(of_tests) for of_tests in figures]
    rows.append([Message("mean"), *(_number(mean) for mean, _, _ in found), ""])
    rows.append([Message("standard deviation"), *(_number(deviation) for _, deviation, _ in found), ""])
    rows.append(["n", *(str(n) for _, _, n in found), ""])
    return joined([table(heads, rows, tuple(range(1, len(heads))))])


def _cell(row: TensileRow) -> Html:
    """Value and half of the interval in the unit of the column; where it is not known, the reason as a tooltip."""
    if not row.figure.known:
        return element("span", NOT_KNOWN, title=told(row.figure.why))
    return safe(figure_text(row.figure))


def _number(value: float) -> str:
    return Message("{value:.4g}", value) if math.isfinite(value) else NOT_KNOWN
