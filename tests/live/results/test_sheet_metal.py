"""A simulated sheet metal of known r and n, pulled past its highest force: run and report against its truth."""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np
import pytest

from analysis.evaluate import Figure
from hw_mocks.machine import PowerLaw
from live.cli import main
from live.commands.options import add_gauges
from live.results.report.evaluation import EvaluatedCurve, neck_line
from live.results.run_folder import open_run

pytestmark = pytest.mark.slow
METAL = PowerLaw(0.2, 1.5)
SIM = (
    "sim:uniform?n=0.2&r=1.5&neck=30&max_strain=0.45&seconds=40&hold=2&end=1&fps=15&noise=0.3"
    "&width=160&height=320&lockstep=yes"
)
MEASURE = ["--roi", "16,40,128,240", "--zoi", "32", "--step", "16", "--burst", "1"]
SPECIMEN = ["--section", "20,2", "--scale", "0.05", "--axis", "y"]


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sheet") / "run"
    quiet = ["--no-view", "--no-rrd", "--no-record", "--report", "--strain", "hencky"]
    assert (
        main(["run", "--camera", SIM, "--load", "sim:", "--out", str(out), *MEASURE, *SPECIMEN, *quiet]) == 0
    )
    return out


def holds(figure: Figure, truth: float) -> bool:
    return figure.low <= truth <= figure.high


def test_figures_hold_the_truth_whatever_the_measure_of_strain(pulled: Path) -> None:
    with open_run(pulled) as run:
        found = EvaluatedCurve.of(run).figures
    assert found.r.value == pytest.approx(1.5, rel=2e-3) and found.n.value == pytest.approx(0.2, rel=4e-3)
    assert holds(found.Agt, METAL.uniform_strain) and found.Agt.high - found.Agt.low < 0.02
    for offset, figure in ((0.001, found.Rp01), (0.002, found.Rp02)):
        assert holds(figure, METAL.yield_stress / (1 + offset + METAL.yield_strain)), offset
    assert holds(found.Rm, float(METAL.stress(METAL.uniform_strain)))


def test_the_neck_is_found_on_the_map(pulled: Path) -> None:
    with open_run(pulled) as run:
        words = neck_line(run, EvaluatedCurve.of(run))
    x, y = (float(value) for value in re.findall(r"= (\d+), (\d+) px", words)[0])
    assert x == pytest.approx(79.5, abs=8) and y == pytest.approx(0.2 * 320 + 159.5, abs=8)


def test_the_report_has_true_values_elongation_and_rates(pulled: Path) -> None:
    page = html.unescape(re.sub("<[^>]*>", "", (pulled / "report.html").read_text(encoding="utf-8")))
    stress = float(METAL.stress(METAL.uniform_strain)) * (1 + METAL.uniform_strain) / 1e6
    found, strain = re.findall(r"true stress ([\d.]+) ± [\d.]+ MPa, true strain ([\d.]+) ±", page)[0]
    assert float(found) == pytest.approx(stress, rel=0.01)
    assert float(strain) == pytest.approx(100 * np.log1p(METAL.uniform_strain), abs=0.8)
    length, elongation = re.findall(r"gauge length ([\d.]+) mm, elongation ([\d.]+) ±", page)[0]
    with open_run(pulled) as run:
        assert float(length) == pytest.approx(run.gauge_length_mm)
    assert float(elongation) == pytest.approx(float(length) * METAL.uniform_strain, rel=0.04)
    assert "1/s in the elastic part (outside the standard" in page and "1/s after it" in page
    assert "True stress against true strain up to the highest force" in page


def test_the_length_is_that_of_the_strips_or_of_the_gauge(pulled: Path, tmp_path: Path) -> None:
    toml = tmp_path / "gauges.toml"
    toml.write_text("[gauges.axial]\nstart = [80, 100]\nend = [80, 180]\nradius_px = 1\n", encoding="utf-8")
    with open_run(pulled) as run:
        y = run.strain.grid.y
        assert run.gauge_length_mm == pytest.approx(0.05 * (y[-2:].mean() - y[:2].mean()))
        add_gauges(run, toml)
        assert run.gauge_length_mm == pytest.approx(0.05 * 80)
