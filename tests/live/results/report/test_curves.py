"""The curves of a report, by value: force, strains, stress, neck and lag."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.evaluate import Figure, true_curve
from live.results.finished.finished_test import FinishedTest
from live.results.maps.colours import MICROSTRAIN
from live.results.report import curves
from live.results.report.curves import load_unit, strain_unit, stress_strain, true_stress_strain
from live.results.report.evaluation import EvaluatedCurve, neck_line, time_steps
from live.results.run_folder import open_run
from live.results.stored_fields import Readings
from tests.live.made_run import CONFIG, E_PA, GAUGES, PULLED, force_of, make_run

N = len(PULLED)


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
        np.testing.assert_allclose(plot.curves[0].x, 0.1 * np.arange(N), atol=1e-9)
        np.testing.assert_allclose(plot.curves[0].y, [force_of(e) for e in PULLED], rtol=1e-6)
        assert plot.x_range == (0.0, pytest.approx(0.1 * (N - 1)))


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
            0: "first", 40: "largest strain", N - 1: "last",
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
        np.testing.assert_allclose(track.t, 0.1 * np.arange(N), atol=1e-9)
    np.testing.assert_array_equal(strain.values, axial)
    np.testing.assert_allclose(load.values, [force_of(e) for e in PULLED])


def test_gauges_are_drawn_in_their_order(tmp_path: Path, run_dir: Path) -> None:
    with open_run(make_run(tmp_path, PULLED[:12], config={**CONFIG, "gauges": GAUGES})) as run:
        plot = curves.gauge_strains(run)
        assert plot is not None and plot.y_label == "strain, µm/m"
        for k, (line, (name, gauge)) in enumerate(zip(plot.curves, run.gauges.items(), strict=True)):
            assert (line.label, line.colour) == (name, k)
            np.testing.assert_allclose(line.y, 1e6 * gauge.value)
    with open_run(run_dir) as run:
        assert curves.gauge_strains(run) is None
