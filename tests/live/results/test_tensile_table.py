"""One table of tensile figures: names, units, intervals, reasons; and all that show it agree."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.evaluate import Curve, Figure, evaluate_test
from hw_mocks.machine import PowerLaw
from live.config.loading import load_config
from live.config.sections import SpecimenConfig
from live.pipeline.event_log import EventLog
from live.pipeline.run_state import FrameCounts, RunState
from live.replay.batch.row import COLUMNS
from live.replay.batch.row import _figures as batch_figures
from live.results.figures import TensileRow, evaluate, figure_lines, headline, tensile_table
from live.results.report import several as comparison
from live.results.report.evaluation import EvaluatedCurve as RunCurve
from live.results.report.report import budget_table, tensile
from live.results.run_folder import open_run
from live.results.summary import summary_lines
from live.ui.web.run_result import run_result
from tests.analysis.curves import noisy, ramberg_osgood
from tests.live.made_run import CONFIG, GAUGES, PULLED, finished, make_run
from tests.live.made_up import in_ascii
from tests.live.results.test_figures import AREA_M2, FLAT, kept

FORCES = {**CONFIG, "specimen": {"axis": "y"}}


@pytest.mark.parametrize("stresses", [True, False])
def test_names_and_units(stresses: bool) -> None:
    curve = noisy(ramberg_osgood(), 0)
    scaled = Curve(curve.t, curve.strain, curve.stress * (1 if stresses else AREA_M2), curve.transverse)
    figures = evaluate_test(scaled)
    rows = headline(figures, stresses=stresses)
    columns = ["E_GPa", "nu", "Rp0.2_MPa", "Rm_MPa"] if stresses else ["EA_kN", "nu", "Fp0.2_kN", "Fm_kN"]
    assert [row.column for row in rows] == columns
    assert {row.column + end for row in rows for end in ("", "_low", "_high")} <= set(COLUMNS)
    one = 1 if stresses else AREA_M2
    for row, true in zip(rows, (70e9 * one, 0.33, 250e6 * one), strict=False):
        si = {"GPa": 1e9, "MPa": 1e6, "kN": 1e3, "": 1.0}[row.unit]
        assert row.figure.value * si == pytest.approx(true, rel=0.03)
        assert 0 < row.figure.half < 0.1 * row.figure.value
    names = [row.name for row in tensile_table(figures, stresses=stresses).values()]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("value", "text"), [(12.345, "12.345 ± 0.020 kN"), (1.2345, "1\u202f235 ± 20 N"), (math.nan, "not known")]
)
def test_small_forces_are_shown_in_newtons(value: float, text: str) -> None:
    assert TensileRow("Fm", "kN", Figure(value, value - 0.02, value + 0.01)).text == text


@pytest.mark.parametrize("specimen", [FLAT, SpecimenConfig()])
def test_summary_and_page_agree(specimen: SpecimenConfig) -> None:
    history, loads = kept(ramberg_osgood())
    run_state = RunState(EventLog(), FrameCounts(), loads, history)
    summary = "\n".join(summary_lines(run_state, finished(run_state, specimen)))
    figures = run_result(run_state, finished(run_state, specimen), Path("runs"), "")["figures"]
    shown = [one for one in figures if re.search(rf"(?<!\w){re.escape(one['name'])} = ", summary)]
    assert len(shown) >= 5 and "nu" in {one["name"] for one in shown}
    for one in shown:
        assert f"{one['name']} = {'at least ' * one['bound']}{one['text']}" in summary
    (strength,) = (one for one in figures if one["name"] in ("Rm", "Fm"))
    assert strength["bound"] and strength["remark"] == "the test ended before the stress fell"


def read(folders: list[Path]) -> tuple[list[dict[str, str]], str]:
    """The CSV and the page of a comparison."""
    runs = [open_run(folder) for folder in folders]
    tests = comparison.tests_of(runs)
    file = io.StringIO()
    comparison.write_table(tests, file)
    html = comparison.compare(tests).html
    for run in runs:
        run.close()
    return list(csv.DictReader(io.StringIO(file.getvalue()))), html


def test_a_comparison_has_no_mean_of_half_widths(tmp_path: Path) -> None:
    folders = [make_run(tmp_path / str(share), [share * e for e in PULLED]) for share in (1.0, 0.9)]
    rows, html = read(folders)
    assert "half, E" not in html and "half_" not in html
    for folder, row in zip(folders, rows, strict=False):
        with open_run(folder) as run:
            figures = headline(RunCurve.of(run).figures, stresses=True)
        for figure in figures:
            if figure.figure.known:
                assert float(row[figure.column]) == pytest.approx(figure.figure.value)
                assert float(row[f"half_{figure.column}"]) == pytest.approx(figure.figure.half)
                value, _, unit = figure.text.partition(" ± ")[2].partition(" ")
                assert f"± {value}" in html and unit != "not"
    mean = next(row for row in rows if row["test"] == "mean")
    assert float(mean["E_GPa"]) == pytest.approx(np.mean([float(row["E_GPa"]) for row in rows[:2]]))
    assert {mean[name] for name in mean if name.startswith("half_")} == {""}


@pytest.mark.parametrize("config", [CONFIG, FORCES])
def test_a_comparison_has_what_the_single_report_has(tmp_path: Path, config: dict) -> None:
    """Of three instants there is a highest force, and no modulus, in both."""
    folders = [make_run(tmp_path / str(k), [0.0, 1e-3, k * 1e-3], config=config) for k in (2, 1)]
    rows, html = read(folders)
    name, column = ("Rm", "Rm_MPa") if config is CONFIG else ("Fm", "Fm_kN")
    for folder, row in zip(folders, rows, strict=False):
        with open_run(folder) as run:
            found = tensile(RunCurve.of(run))
        assert list(found) == [name], "no modulus, and no strain that made it"
        shown, *_, unit = in_ascii(found[name]).removeprefix("at least ").partition(" (")[0].split()
        assert float(row[column]) * (1e3 if unit == "N" else 1) == pytest.approx(float(shown), rel=0.01)
    assert 'title="3 measurements in all, 8 are needed: more pictures">not known<' in html


def test_without_a_modulus_the_summary_has_the_strength_and_the_reason() -> None:
    history, loads = kept(ramberg_osgood())
    few = type(history)()
    for time_step in history.time_steps[::150]:
        few.add(time_step)
    state = RunState(EventLog(), FrameCounts(), loads, few)
    text = "\n".join(summary_lines(state, finished(state, FLAT)))
    assert "Rm = " in text
    assert "not known: E, " in text


def test_what_the_interval_of_e_holds_is_named_wherever_e_shows(tmp_path: Path) -> None:
    stated = {**CONFIG, "specimen": {**CONFIG["specimen"], "force_error_percent": 1.0}}  # type: ignore[dict-item]
    with open_run(make_run(tmp_path / "run", config=stated)) as run:
        curve = RunCurve.of(run)
        words, table = "".join(budget_table(run, curve)), "\n".join(figure_lines(curve.figures, run.specimen))
        assert f"95 % of E = {tensile(curve)['E']} is that of all together".replace("95 %", "95%") in words
    assert "95% interval, of E with limits of load cell)" in table
    history, loads = kept(ramberg_osgood())
    for specimen, text in (
        (FLAT, "scatter; no limits of error are stated"),
        (replace(FLAT, force_error_percent=1.0), "scatter; load cell"),
    ):
        state = RunState(EventLog(), FrameCounts(), loads, history)
        page = run_result(state, finished(state, specimen), Path("runs"), "")["figures"]
        assert [one["text"] for one in page if one["name"] == "interval of E"] == [text]


def test_the_strain_of_e_is_named_wherever_e_shows(tmp_path: Path) -> None:
    folders = [make_run(tmp_path / "region"), make_run(tmp_path / "own", config={**CONFIG, "gauges": GAUGES})]
    rows, html = read(folders)
    for folder, row, strain in zip(folders, rows, ("eyy of the region", "gauge axial"), strict=False):
        with open_run(folder) as run:
            curve = RunCurve.of(run)
            assert curve.figures.elastic_strain == strain
            assert tensile(curve)["strain of E, nu"] == strain
            assert f"points of {strain}," in "\n".join(figure_lines(curve.figures, run.specimen))
        assert row["strain of E and nu"] == strain and strain in html
    history, loads = kept(ramberg_osgood())
    state = RunState(EventLog(), FrameCounts(), loads, history)
    page = run_result(state, finished(state, FLAT), Path("runs"), "")["figures"]
    assert [one["text"] for one in page if one["name"] == "strain of E and nu"] == ["eyy of the region"]
    config = load_config(None, {"specimen.width_mm": 20.0, "specimen.thickness_mm": 2.0})
    batch = batch_figures(evaluate(history, loads, FLAT), config)
    assert (
        batch["strain_of_E"] == "eyy of the region"
        and {"r", "r_low", "n_high"} <= batch.keys() & COLUMNS.keys()
    )


def test_r_and_n_have_their_interval_and_the_elongation_its_length() -> None:
    metal, strain = (
        PowerLaw(0.2, 1.5),
        np.concatenate([np.linspace(0, 3e-3, 200), np.linspace(3e-3, 0.3, 600)]),
    )
    curve = Curve(np.arange(800) / 10, strain, metal.stress(strain), metal.transverse(strain))
    figures = evaluate_test(curve)
    rows = tensile_table(figures, stresses=True)
    assert rows["r"].text.endswith("(plastic strains 2 to 20 %)") and rows["r"].text.startswith("1.50")
    text = "\n".join(figure_lines(figures, SpecimenConfig(area_mm2=40.0, gauge_length_mm=50.0)))
    length = 50 * figures.Agt.value
    assert f"gauge length 50 mm, elongation {length:.1f}" in text and "mm at the highest force" in text
    own, of_length = 50 * (figures.Agt.high - figures.Agt.value), 1.96 * 0.003 * length
    of_scale = "\n".join(figure_lines(figures, SpecimenConfig(area_mm2=40.0), Figure.about(50.0, 0.003 * 50)))
    found = re.search(r"elongation ([\d.]+) ± ([\d.]+) mm at the highest force", of_scale)
    assert found is not None and float(found[2]) == pytest.approx(math.hypot(own, of_length), rel=0.02)
    assert f"r = {rows['r'].text}  n = {rows['n'].text}" in text
    assert rows["n"].figure.value == pytest.approx(0.2, rel=2e-3)
