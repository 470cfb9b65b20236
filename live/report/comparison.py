"""Several tests in one report: their curves, and mean and scatter of what they tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from acquire.errors import ConfigError, DataError
from analysis.evaluate import Figure as Evaluated
from live.finished import RunFolder
from live.report.curves import load_unit, strain_unit
from live.report.evaluation import Curve
from live.report.page import Part, element, joined, page, paragraph, section, table
from live.report.report import Report, plots
from live.report.svg import Curve as Line
from live.report.svg import Figure

_FEWEST = 2
_ROOM = 50  # letters above the curves; numbers stand for longer names


@dataclass(frozen=True, slots=True, eq=False)
class Test:
    """One of the tests compared."""

    title: str
    path: str
    curve: Curve


def tests_of(runs: Sequence[RunFolder]) -> list[Test]:
    """The curves of ``runs``.

    Raises
    ------
    ConfigError
        Fewer than two, or some with stresses and some with forces alone.
    DataError
        One holds no measurement.
    """
    if len(runs) < _FEWEST:
        raise ConfigError("--compare needs at least two runs")
    for run in runs:
        if not run.strain.n:
            raise DataError(f"{run.strain.path}: holds no measurement, there is nothing to compare")
    found = [Test(run.title, str(run.path), Curve.of(run)) for run in runs]
    if len({test.curve.is_stress for test in found}) > 1:
        without = ", ".join(test.path for test in found if not test.curve.is_stress)
        raise ConfigError(
            f"{without}: no section is known, the other runs have stresses; replay it with --section W,T to compare"
        )
    return found


def quantities(tests: Sequence[Test]) -> dict[str, list[float]]:
    """Name with unit -> value of each test; NaN where it tells nothing."""
    stress = tests[0].curve.is_stress
    figures = [test.curve.figures for test in tests]
    if stress:
        return {
            "E_GPa": [f.E.value / 1e9 for f in figures],
            "half_E_GPa": [_half(f.E) / 1e9 for f in figures],
            "nu": [f.nu.value for f in figures],
            "half_nu": [_half(f.nu) for f in figures],
            "Rp0.2_MPa": [f.Rp02.value / 1e6 for f in figures],
            "Rm_MPa": [f.Rm.value / 1e6 for f in figures],
        }
    return {
        "EA_kN": [f.E.value / 1e3 for f in figures],
        "half_EA_kN": [_half(f.E) / 1e3 for f in figures],
        "nu": [f.nu.value for f in figures],
        "half_nu": [_half(f.nu) for f in figures],
        "Fp0.2_kN": [f.Rp02.value / 1e3 for f in figures],
        "Fm_kN": [f.Rm.value / 1e3 for f in figures],
    }


def _half(figure: Evaluated) -> float:
    """Half of the interval of confidence."""
    return (figure.high - figure.low) / 2


def summary(values: Sequence[float]) -> tuple[float, float, int]:
    """Mean, standard deviation (n - 1) and number of those that are known."""
    known = [value for value in values if math.isfinite(value)]
    mean = float(np.mean(known)) if known else math.nan
    return mean, float(np.std(known, ddof=1)) if len(known) > 1 else math.nan, len(known)


def compare(tests: Sequence[Test]) -> Report:
    """The page; the curves over one pair of axes, and the table."""
    figures = (_together(tests),)
    words = (
        "E, nu and the strengths of each test as its own report has them; the scatter is that between tests."
    )
    parts = [
        element("h1", f"Comparison of {len(tests)} tests"),
        section("Curves", plots(figures)),
        section("Figures", paragraph(words, "dim"), _table(tests)),
    ]
    return Report(page("Comparison of tests", parts), figures)


def write_table(tests: Sequence[Test], file: TextIO) -> None:
    """The figures as CSV: a line a test, then mean, standard deviation and number."""
    found = quantities(tests)
    file.write("test,path," + ",".join(found) + "\n")
    for k, test in enumerate(tests):
        values = ",".join(f"{column[k]:.8g}" for column in found.values())
        file.write(f"{_quoted(test.title)},{_quoted(test.path)},{values}\n")
    for name, part in (("mean", 0), ("standard deviation", 1), ("n", 2)):
        values = ",".join(
            "" if column.startswith("sigma") else f"{summary(numbers)[part]:.8g}"
            for column, numbers in found.items()
        )
        file.write(f"{name},,{values}\n")


def _quoted(words: str) -> str:
    """A field of a CSV; no program takes it for a formula."""
    plain = words.lstrip("=+-@\t ") or "-"
    return '"' + plain.replace('"', '""') + '"'


def _together(tests: Sequence[Test]) -> Figure:
    e = strain_unit(*(test.curve.axial for test in tests))
    load = load_unit(max((test.curve for test in tests), key=lambda c: np.nanmax(c.load, initial=0.0)))
    names = [test.title for test in tests]
    if sum(len(name) for name in names) > _ROOM:
        names = [str(k + 1) for k in range(len(tests))]
    lines = tuple(
        Line(names[k], test.curve.axial * e.factor, test.curve.load * load.factor, colour=k)
        for k, test in enumerate(tests)
    )
    what = "stress" if tests[0].curve.is_stress else "force"
    return Figure("comparison", f"{what.capitalize()} against strain", f"axial strain, {e.name}",
                  f"{what}, {load.name}", lines)  # fmt: skip


def _table(tests: Sequence[Test]) -> Part:
    found = {name: column for name, column in quantities(tests).items() if not name.startswith("sigma")}
    heads = ["", *(name.replace("_", ", ") for name in found)]
    rows = [
        [f"{k + 1} {test.title}", *(_number(column[k]) for column in found.values())]
        for k, test in enumerate(tests)
    ]
    told = [summary(column) for column in found.values()]
    rows.append(["mean", *(_number(mean) for mean, _, _ in told)])
    rows.append(["standard deviation", *(_number(deviation) for _, deviation, _ in told)])
    rows.append(["n", *(str(n) for _, _, n in told)])
    return joined([table(heads, rows, tuple(range(1, len(heads))))])


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "not known"
