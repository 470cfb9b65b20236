"""Several tests in one report: their curves, and mean and scatter of their figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from acquire.errors import ConfigError, DataError
from acquire.text import Message
from analysis.evaluate import CONFIDENCE
from live.results.figures import NOT_KNOWN, TensileRow, figure_text, headline
from live.results.report.curves import axial_label, load_labels, load_unit, plots, strain_unit
from live.results.report.evaluation import EvaluatedCurve
from live.results.report.page import Html, element, joined, page, paragraph, safe, section, table
from live.results.report.report import Report
from live.results.report.svg import Plot, PlotLine
from live.results.run_folder import RunFolder
from live.words.language import told

_MIN_RUNS = 2
_MAX_LABELS = 50  # letters above the curves; longer names are replaced by numbers


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
        if not run.strain.n:
            raise DataError("{path}: holds no measurement, there is nothing to compare", run.strain.path)
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
    figures = (_together(tests),)
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


def _together(tests: Sequence[ComparedTest]) -> Plot:
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
    return Plot("comparison", title, axial_label(e), up, lines)


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
