"""Tests that are compared in one report, by value."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquire.errors import DataError
from analysis.evaluate import Figure
from live.results.report import comparison
from live.results.report.report import Report
from live.results.run_folder import RunFolder, open_run
from tests.live.made_run import CONFIG, PULLED, make_run
from tests.live.made_up import in_ascii
from tests.live.results.report.test_sections import plain


def compared(tmp_path: Path) -> list[comparison.ComparedTest]:
    config = {**CONFIG, "specimen": {"axis": "y"}}
    folders = [make_run(tmp_path / str(k), PULLED, config=config, session=False) for k in range(2)]
    found = []
    for k, folder in enumerate(folders):
        with open_run(folder) as one:
            test = comparison.tests_of([one, one])[0]
        found.append(
            replace(
                test,
                curve=replace(
                    test.curve, load=test.curve.load * (1 - 0.6 * k), axial=test.curve.axial * (1 + 9 * k)
                ),
            )
        )
    return found


def test_all_tests_are_drawn_in_one_unit(tmp_path: Path) -> None:
    """In the unit for the strongest, in % for the longest."""
    tests = compared(tmp_path)
    made = comparison.compare(tests)
    assert isinstance(made, Report)
    (plot,) = made.figures
    assert (plot.x_label, plot.y_label) == ("axial strain, %", "force, N")
    assert [line.label for line in plot.curves] == ["S1", "S1"] and [line.colour for line in plot.curves] == [
        0,
        1,
    ]
    for line, test in zip(plot.curves, tests, strict=True):
        np.testing.assert_allclose(line.x, 100 * test.curve.axial)
        np.testing.assert_allclose(line.y, test.curve.load)
    long = [replace(test, title="a name of more than 25 letters") for test in tests]
    assert [line.label for line in comparison.compare(long).figures[0].curves] == ["1", "2"]
    fits = [replace(test, title="a name of just 25 letters") for test in tests]
    assert comparison.compare(fits).figures[0].curves[0].label == "a name of just 25 letters"


def test_mean_and_scatter_stand_in_their_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tests = compared(tmp_path)
    for k, test in enumerate(tests):
        figures = replace(test.curve.figures, E=Figure(1e6 + 2e6 * k, 0.9e6 + 2e6 * k, 1.2e6 + 2e6 * k),
                          nu=Figure.none("no"))  # fmt: skip
        tests[k] = replace(test, curve=replace(test.curve, figures=figures))
    shown = in_ascii(plain(comparison.compare(tests).html))
    assert "|1 S1|1000 +- 200|not known|" in shown and "|2 S1|3000 +- 200|" in shown
    assert (
        "|mean|2000|not known|" in shown
        and "|standard deviation|1414|not known|" in shown
        and "|n|2|0|" in shown
    )
    file = io.StringIO()
    comparison.write_table(tests, file)
    heads, first, _, mean, deviation, n = (line.split(",") for line in file.getvalue().splitlines())
    assert heads[:6] == ["test", "path", "EA_kN", "half_EA_kN", "nu", "half_nu"]
    assert (first[2:4], mean[2:4], deviation[2], n[2:5]) == (
        ["1000", "200"],
        ["2000", ""],
        "1414.2136",
        ["2", "", "0"],
    )


def test_what_holds_nothing_is_not_compared(tmp_path: Path, run: RunFolder) -> None:
    with (
        open_run(make_run(tmp_path, [], session=False)) as empty,
        pytest.raises(DataError, match="to compare"),
    ):
        comparison.tests_of([run, empty])
