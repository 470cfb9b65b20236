"""The curves of a report, by value: force, strains, stress, neck and lag."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.text.quantity import GAP
from analysis.evaluate import Figure, true_curve
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.results.finished.finished_test import FinishedTest
from live.results.maps.colours import MICROSTRAIN
from live.results.report import curves
from live.results.report import several as comparison
from live.results.report.curves import (
    force_unit,
    load_unit,
    strain_unit,
    stress_strain,
    true_stress_strain,
    valid_share,
)
from live.results.report.evaluation import EvaluatedCurve, nearest_rows, neck_line, time_steps
from live.results.report.record import PracticeValues, reporting_table, times
from live.results.report.report import Report, ReportRequest, make_report
from live.results.report.several import _quoted as quoted
from live.results.report.several import summary
from live.results.run_folder import RunFolder, open_run
from live.results.stored_fields import Readings
from live.ui.terminal.screen import TerminalScreen
from tests.live.made_run import CONFIG, E_PA, GAUGES, PULLED, YIELD, force_of, make_run
from tests.live.made_up import in_ascii
from tests.live.results.report.test_sections import plain

AREA_M2 = 20e-6


def test_the_force_over_time_is_that_of_the_load_cell(run_dir: Path, tmp_path: Path) -> None:
    """Of the samples of the recording, else of the results; in N up to 10 kN."""
    with open_run(run_dir) as run:
        samples, unit = curves.force(run), "force, N"
        run.__dict__["readings"] = Readings(lambda: iter(()))
        stored = curves.force(run)
        run.strain.values["force_N"][:] = np.nan
        assert curves.force(run) is None
    for plot in (samples, stored):
        assert plot is not None and plot.y_label == unit and plot.x_label == "time, s"
        np.testing.assert_allclose(plot.curves[0].x, 0.1 * np.arange(len(PULLED)), atol=1e-9)
        np.testing.assert_allclose(plot.curves[0].y, [force_of(e) for e in PULLED], rtol=1e-6)
        assert plot.x_range == (0.0, pytest.approx(0.1 * (len(PULLED) - 1)))


def test_the_strains_of_the_region_have_their_sigma_as_band(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        plot, values = curves.mean_strains(run), run.strain.values
    assert [line.label for line in plot.curves] == ["exx", "eyy", "exy"]
    assert [line.colour for line in plot.curves] == [0, 1, 2]
    for line in plot.curves:
        assert line.sigma is not None
        np.testing.assert_allclose(line.y, 1e6 * values[line.label])
        np.testing.assert_allclose(line.sigma, 1e6 * values[f"sigma_{line.label}"])
    assert plot.y_label == "strain, µm/m"


def test_the_axis_of_time_begins_at_zero_and_has_a_length() -> None:
    def ranged(*times: float) -> tuple[float, float]:
        run: Any = SimpleNamespace(strain=SimpleNamespace(time_s=np.array(times)))
        return curves.time_range(run)

    assert ranged(2.0, 5.0) == (0.0, 5.0)
    assert ranged(-1.0, 5.0) == (-1.0, 5.0)
    assert ranged(0.0) == (0.0, 1.0) and ranged(-2.0) == (-2.0, -1.0)


def test_strains_for_a_part_of_their_area_are_told() -> None:
    def told(**values: list[float]) -> str:
        columns = {name: np.array(column) for name, column in values.items()}
        run: Any = SimpleNamespace(
            strain=SimpleNamespace(values=columns, time_s=np.array([0.0, 1.5, 2.5, 3.5]))
        )
        return curves.parts(run)

    whole = [1.0, 1.0, 1.0, 1.0]
    assert told(area_share=whole) == told(eyy=whole) == ""
    words = told(area_share=[1.0, 0.9, 1.0, 1.0], share_gauge_a=[1.0, 1.0, 0.62, 1.0])
    assert words.startswith("A block of ZOIs had no value at 2 of 4 instants, from 1.5 to 2.5 s:")
    assert words.endswith("at least 62 %.")
    assert told(share_gauge_off=[0.4, 0.4, 0.4, 0.4]) == ""


def test_units_of_strain_and_load() -> None:
    assert strain_unit(np.array([0.001, np.nan]), np.array([-0.01])).name == "%"
    assert strain_unit(np.array([0.0099, -0.0099])) == strain_unit(np.array([np.nan])) == MICROSTRAIN
    curve: Any = SimpleNamespace(is_stress=True, load=np.array([1e3]))
    assert (load_unit(curve).name, load_unit(curve).factor) == ("MPa", 1e-6)
    curve.is_stress = False
    assert (load_unit(curve).name, load_unit(curve).factor) == ("N", 1.0)


def test_the_highest_stress_and_the_lines_of_e(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        curve = EvaluatedCurve.of(run)
    plot, top = stress_strain(curve), force_of(PULLED[-1]) / AREA_M2
    highest = plot.marks[-1]
    assert (highest.name, highest.value) == ("Rm", "210.5 MPa") and highest.y == pytest.approx(
        1e-6 * top, rel=1e-6
    )
    assert highest.x == pytest.approx(1e6 * curve.axial[-1]) and highest.is_bound
    elastic = plot.curves[1]
    assert elastic.label == "E" and elastic.dashed and elastic.y.tolist() == pytest.approx([0, 1.05e-6 * top])
    assert np.diff(elastic.y)[0] / np.diff(elastic.x)[0] == pytest.approx(E_PA * 1e-12, rel=0.01)
    assert elastic.x[0] == pytest.approx(0.0, abs=30.0)
    assert (plot.x_label, plot.y_label) == ("axial strain, µm/m", "stress, MPa")
    forces = stress_strain(replace(curve, is_stress=False))
    assert forces.curves[1].label == "EA" and forces.marks[-1].name == "Fm"
    assert forces.y_label == "force, kN"


def test_true_stress_is_known_up_to_the_highest_force(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        curve = EvaluatedCurve.of(run)
    axial, load = np.array([0.0, 0.01, 0.03, 0.06]), np.array([0.0, 2e8, 3e8, 1e8])
    past = replace(curve, axial=axial, load=load, figures=replace(curve.figures, Ag=Figure(0.02, 0.01, 0.03)))
    plot = true_stress_strain(past)
    assert plot is not None and (plot.x_label, plot.y_label) == ("true strain, %", "true stress, MPa")
    strain, stress = true_curve(axial, load)
    np.testing.assert_allclose(plot.curves[0].x, 100 * strain)
    np.testing.assert_allclose(plot.curves[0].y, 1e-6 * stress)
    assert np.nanmax(plot.curves[0].y) == pytest.approx(300 * 1.03)
    assert true_stress_strain(replace(past, is_stress=False)) is None
    unknown = replace(past.figures, Ag=Figure.none("not passed"))
    assert true_stress_strain(replace(past, figures=unknown)) is None


def test_the_instants_without_a_force(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        run.strain.values["force_N"][:] = np.nan
        run.strain.values["stress_Pa"][:] = np.nan
        curve = EvaluatedCurve.of(run)
        axial = curve.axial.copy()
        axial[40] = -0.5
        assert time_steps(run, replace(curve, axial=axial)) == {
            0: "first", 40: "largest strain", len(PULLED) - 1: "last",
        }  # fmt: skip
    assert not curve.has_load and not curve.elastic.any() and np.isnan(curve.intercept)


def test_the_neck_is_told_between_the_highest_force_and_the_break(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below 2 % of the highest force there is no specimen any more."""
    asked: list[tuple[int, int, str]] = []
    grown = SimpleNamespace(x=80.4, y=40.6, growth=0.123, elsewhere=0.0045)
    monkeypatch.setattr(
        "live.results.report.evaluation.neck",
        lambda top, last, axis: asked.append((top, last, axis)) or grown,
    )
    with open_run(run_dir) as run:
        curve = EvaluatedCurve.of(run)
        curve = replace(curve, figures=replace(curve.figures, Ag=Figure(0.02, 0.01, 0.03)))
        load = curve.load.copy()
        load[50], load[80:90], load[90:] = 1e9, 0.021e9, 0.019e9
        monkeypatch.setattr(type(run), "field", lambda self, row: row)
        past = replace(curve, load=load)
        words = neck_line(run, past)
        run.strain.config["scale"] = {"mm_per_px": 0.1}
        with_scale = neck_line(run, past)
        unknown = replace(past, figures=replace(past.figures, Ag=Figure.none("")))
        assert neck_line(run, unknown) == ""
        load[51:] = 0.0
        assert neck_line(run, replace(past, load=load)) == "", "it broke at once"
        run.strain.values["n_valid"][50] = 0
        load[49] = 0.9e9
        assert neck_line(run, replace(past, load=load)) == ""
    assert asked == [(50, 89, "y")] * 2
    assert words == (
        "neck at x, y = 80, 41 px: from 5 s (highest force) to 8.9 s the strain grew there by 12 %,"
        " elsewhere by 0.45 %"
    )
    assert "80, 41 px (8.0, 4.1 mm): " in with_scale


def test_the_lag_is_found_from_readings_since_the_start(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []
    monkeypatch.setattr(
        "live.results.stored_fields.find_lag",
        lambda *tracks: given.append(tracks) or Figure.none(""),
    )
    with open_run(run_dir) as run:
        FinishedTest.of_folder(run)
        axial = run.axial_strain
    ((strain, load),) = given
    for track in (strain, load):
        np.testing.assert_allclose(track.t, 0.1 * np.arange(len(PULLED)), atol=1e-9)
    np.testing.assert_array_equal(strain.values, axial)
    np.testing.assert_allclose(load.values, [force_of(e) for e in PULLED])


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
    assert [(curve.label, curve.colour) for curve in figure.curves] == [("axial", 0), ("shear", 1)]
    assert figure.y_label == "strain, µm/m"
    for curve, gauge in zip(figure.curves, run.gauges.values(), strict=True):
        assert curve.sigma is not None
        np.testing.assert_allclose(curve.y, 1e6 * gauge.value)
        np.testing.assert_allclose(curve.sigma, 1e6 * gauge.sigma)
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
        assert curves.gauge_strains(plain) is None


def test_without_readings_the_lag_is_not_known(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0, 1e-3], session=False)) as bare:
        assert "no readings of a load cell are there" in times(bare, FinishedTest.of_folder(bare))


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
