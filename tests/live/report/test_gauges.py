"""Virtual gauges and lag in the report and in what is exported."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np
import pytest

from live.cli import main
from live.finished import open_run
from live.report import Wanted, make_report
from live.report.evaluation import Curve
from live.report.record import times
from live.tell import TerminalScreen
from tests.live.made_run import CONFIG, GAUGES, make_run


@pytest.fixture(scope="module")
def gauged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("gauged"), config={**CONFIG, "gauges": GAUGES})


def test_the_report_shows_every_gauge_with_its_band(gauged: Path) -> None:
    with open_run(gauged) as run:
        report = make_report(run, Wanted(), TerminalScreen(quiet=True))
        axial = run.gauges["axial"]
    figure = next(figure for figure in report.figures if figure.name == "gauges-time")
    assert [curve.label for curve in figure.curves] == ["axial", "shear"]
    for curve, gauge in zip(figure.curves, run.gauges.values(), strict=True):
        assert curve.sigma is not None
        np.testing.assert_allclose(curve.sigma / curve.y, gauge.sigma / gauge.value)
    assert "kind line; start 64, 20; end 64, 76" in report.html
    shown = re.search(r"([0-9.]+) ± ([0-9.]+) µm/m", report.html)
    assert shown is not None
    assert [float(word) for word in shown.groups()] == pytest.approx(
        [1e6 * axial.value[-1], 1e6 * axial.sigma[-1]], rel=0.05
    )
    assert report.html.count('class="band') >= 5  # two gauges, three means


def test_the_curve_is_that_of_the_gauge_axial(gauged: Path, run_dir: Path) -> None:
    with open_run(gauged) as run, open_run(run_dir) as plain:
        np.testing.assert_array_equal(Curve.of(run).axial, run.strain.values["gauge_axial"])
        np.testing.assert_array_equal(Curve.of(plain).axial, plain.strain.values["eyy"])


def test_the_lag_is_told_or_why_not(gauged: Path, tmp_path: Path) -> None:
    with open_run(gauged) as run:
        assert "lag of the load beside the frames" in times(run)
        assert "not known: " in times(run) or " ms (95% interval" in times(run)
    with open_run(make_run(tmp_path, [0.0, 1e-3], session=False)) as bare:
        assert "no readings of a load cell were recorded" in times(bare)


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
