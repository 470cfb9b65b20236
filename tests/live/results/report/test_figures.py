"""Evaluation in the report against known truth: elastic line, instants, gauges, lag; tests that are compared."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.text.quantity import GAP
from analysis.evaluate import Figure
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.results.finished.finished_test import FinishedTest
from live.results.report import several as comparison
from live.results.report.curves import force_unit, stress_strain, valid_share
from live.results.report.evaluation import EvaluatedCurve, nearest_rows, time_steps
from live.results.report.record import PracticeValues, reporting_table, times
from live.results.report.report import Report, ReportRequest, make_report
from live.results.report.several import _quoted as quoted
from live.results.report.several import summary
from live.results.run_folder import RunFolder, open_run
from live.ui.terminal.screen import TerminalScreen
from tests.live.made_run import CONFIG, E_PA, GAUGES, PULLED, YIELD, make_run
from tests.live.made_up import in_ascii
from tests.live.results.report.test_sections import plain


def test_the_line_and_the_instants(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        curve = EvaluatedCurve.of(run)
        found = time_steps(run, curve)
    assert pytest.approx(E_PA, rel=0.01) == curve.figures.E.value
    assert curve.figures.Rp02.value == pytest.approx(E_PA * YIELD, rel=3e-3)
    # The line goes through the origin of a curve that does.
    assert abs(curve.intercept) < 0.005 * E_PA * YIELD
    words = {word: row for row, name in found.items() for word in name.split(", ")}
    assert words["first"] == 0
    assert words["last"] == len(PULLED) - 1
    assert 0.1 * YIELD <= PULLED[words["elastic"]] <= 0.6 * YIELD
    # 0.2 % of plastic strain beyond the yield of an ideally plastic curve.
    step = PULLED[-1] - PULLED[-2]
    assert YIELD + 0.002 - step <= PULLED[words["yield (0.2 %)"]] <= YIELD + 0.002 + 2 * step


def test_the_construction_of_the_yield_point(run_dir: Path) -> None:
    """The line of E through the curve, the same line beyond by 0.2 %, the point where that meets the curve."""
    with open_run(run_dir) as run:
        plot = stress_strain(EvaluatedCurve.of(run))
        share = valid_share(run).curves[0].y
        valid = run.strain.values["n_valid"] / run.strain.values["n_zoi"]
    measured, elastic, offset = plot.curves
    factor = measured.x[-1] / PULLED[-1]
    assert offset.label == "0.2 % offset"
    np.testing.assert_allclose((offset.x - elastic.x) / factor, 0.002, rtol=1e-4)
    (yielded,) = (mark for mark in plot.marks if mark.name == "Rp0.2")
    assert np.interp(yielded.y, offset.y, offset.x) == pytest.approx(yielded.x)
    assert yielded.x / factor == pytest.approx(YIELD + 0.002, abs=1e-4)
    np.testing.assert_allclose(share, 100 * valid)
    assert 50 < share.min() < 100


def test_chosen_instants(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        assert nearest_rows(run, (2.04, 0.0)) == {0: "chosen", 20: "chosen"}


def test_without_section_there_are_forces(tmp_path: Path) -> None:
    config = {**CONFIG, "specimen": {"axis": "y"}}
    with open_run(make_run(tmp_path, config=config)) as run:
        curve = EvaluatedCurve.of(run)
    assert not curve.is_stress
    assert curve.figures.E.value == pytest.approx(E_PA * 20e-6, rel=0.01)


def test_mean_and_scatter() -> None:
    mean, deviation, n = summary([1.0, float("nan"), 3.0])
    assert (mean, deviation, n) == (2.0, pytest.approx(np.sqrt(2)), 2)


@pytest.mark.parametrize(("radius", "is_wanted"), [(1.0, False), (2.0, True)])
def test_the_report_has_the_limit_of_the_check(run_dir: Path, radius: float, is_wanted: bool) -> None:
    picture = 255 * Speckle((192, 256), radius=radius, seed=3).render(Affine(), (192, 256))
    with open_run(run_dir) as run:
        text = str(reporting_table(PracticeValues(run, None, picture[:96, :128], {}, None)))
    assert "32 px, gaussian weight of standard deviation 5.3 px" in text
    found = re.search(r"autocorrelation; radius ([\d.]+) px", text)
    assert found is not None and float(found[1]) == pytest.approx(radius, rel=0.3)
    assert ("(LOOK: wanted are 1.5 to 4 px)" not in text) is is_wanted


@pytest.fixture(scope="module")
def gauged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("gauged"), config={**CONFIG, "gauges": GAUGES})


def test_the_report_shows_every_gauge_with_its_band(gauged: Path) -> None:
    with open_run(gauged) as run:
        report = make_report(run, ReportRequest(), TerminalScreen(quiet=True))
        axial = run.gauges["axial"]
    figure = next(figure for figure in report.figures if figure.name == "gauges-time")
    assert [curve.label for curve in figure.curves] == ["axial", "shear"]
    for curve, gauge in zip(figure.curves, run.gauges.values(), strict=True):
        assert curve.sigma is not None
        np.testing.assert_allclose(curve.sigma / curve.y, gauge.sigma / gauge.value)
    assert "kind line; start 64, 20; end 64, 76" in report.html
    shown = re.search(r"([0-9.]+) ± ([0-9.]+) µm/m", report.html.replace(GAP, ""))
    assert shown is not None
    assert [float(word) for word in shown.groups()] == pytest.approx(
        [1e6 * axial.value[-1], 1e6 * axial.sigma[-1]], rel=0.1
    )
    assert report.html.count('class="band') >= 5  # two gauges, three means


def test_the_curve_is_that_of_the_gauge_axial(gauged: Path, run_dir: Path) -> None:
    with open_run(gauged) as run, open_run(run_dir) as plain:
        np.testing.assert_array_equal(EvaluatedCurve.of(run).axial, run.strain.values["gauge_axial"])
        np.testing.assert_array_equal(EvaluatedCurve.of(plain).axial, plain.strain.values["extension_y"])


def test_the_lag_is_told_or_why_not(gauged: Path, tmp_path: Path) -> None:
    with open_run(gauged) as run:
        words = times(run, FinishedTest.of_folder(run))
        assert "lag of the load behind the frames" in words
        assert "not known: " in words or " ms (95% interval" in words
    with open_run(make_run(tmp_path, [0.0, 1e-3], session=False)) as bare:
        assert "no readings of a load cell are there" in times(bare, FinishedTest.of_folder(bare))


def _means(folder: Path, *more: str) -> tuple[str, dict[str, np.ndarray]]:
    out = folder / f"means{len(more)}.csv"
    assert main(["export", str(folder), "--to", "csv", "--layout", "means", "--out", str(out), *more]) == 0
    text = out.read_text(encoding="utf-8")
    lines = "".join(line for line in io.StringIO(text) if not line.startswith("#"))
    rows = list(csv.DictReader(io.StringIO(lines)))
    return text, {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_exported_gauges_are_in_the_units_and_axes_asked_for(gauged: Path) -> None:
    words, plain = _means(gauged)
    _, turned = _means(gauged, "--y-up", "--percent")
    assert "strain of the virtual gauge 'axial'; nan where it was lost (kind line" in words
    np.testing.assert_allclose(turned["gauge_axial_percent"], 100 * plain["gauge_axial"], rtol=1e-6)
    np.testing.assert_allclose(turned["gauge_shear_percent"], -100 * plain["gauge_shear"], rtol=1e-6)
    np.testing.assert_allclose(
        turned["sigma_gauge_shear_percent"], 100 * plain["sigma_gauge_shear"], rtol=1e-6
    )


def test_forces_are_in_kilonewton_from_ten_thousand_on() -> None:
    assert force_unit(np.array([0.0, -9999.0])).name == "N"
    assert force_unit(np.array([np.nan, -10000.0])) == force_unit(np.array([50000.0]))
    assert (force_unit(np.array([10000.0])).name, force_unit(np.array([10000.0])).factor) == ("kN", 1e-3)
    assert force_unit(np.array([np.nan])).name == "N"


@pytest.mark.parametrize("title", ["=1+2", "+1", "-1", "@cell", "\t=1", " =1"])
def test_no_title_of_a_comparison_is_a_formula(title: str) -> None:
    assert quoted(title).strip('"')[0] not in "=+-@\t "


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
        pytest.raises(DataError, match="holds no measurement"),
    ):
        comparison.tests_of([run, empty])
