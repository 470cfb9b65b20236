"""Gauges laid over a finished run are those that the test would have had."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from live.cli import main
from live.finished import add_gauges, open_run
from tests.live.made_run import CONFIG, GAUGES, PULLED, make_run

TOML = """
[gauges.axial]
start = [64, 20]
end = [64, 76]
[gauges.shear]
kind = "area"
box = [40, 30, 50, 40]
value = "exy"
"""


@pytest.fixture
def toml(tmp_path: Path) -> Path:
    path = tmp_path / "gauges.toml"
    path.write_text(TOML, encoding="utf-8")
    return path


def test_they_are_those_of_the_test(run_dir: Path, toml: Path, tmp_path: Path) -> None:
    with (
        open_run(make_run(tmp_path / "with", config={**CONFIG, "gauges": GAUGES})) as with_gauges,
        open_run(run_dir) as run,
    ):
        assert run.gauges == {}
        assert add_gauges(run, toml) == ("axial", "shear")
        for name, gauge in with_gauges.gauges.items():
            np.testing.assert_allclose(run.gauges[name].value, gauge.value, atol=1e-10)
            np.testing.assert_allclose(run.gauges[name].sigma, gauge.sigma, rtol=1e-5)
        assert run.gauges["axial"].described["start"] == (64.0, 20.0)
        np.testing.assert_array_equal(run.axial_strain, run.gauges["axial"].value)
    with open_run(run_dir) as again:
        assert again.gauges == {}, "the files stay as they are"


def test_they_are_in_the_report_the_export_and_the_view(run_dir: Path, toml: Path, tmp_path: Path) -> None:
    more = ["--gauges", str(toml)]
    assert main(["report", str(run_dir), *more, "--out", str(tmp_path / "r.html")]) == 0
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<h2>Virtual gauges</h2>" in page
    assert "box 40, 30, 50, 40; value exy" in page
    out = tmp_path / "m.csv"
    assert main(["export", str(run_dir), *more, "--to", "csv", "--layout", "means", "--out", str(out)]) == 0
    heads = next(line for line in out.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
    assert {"gauge_axial", "sigma_gauge_axial", "gauge_shear"} <= set(heads.split(","))
    assert main(["show", str(run_dir), *more, "--every", "40", "--rrd", str(tmp_path / "a.rrd")]) == 0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[measure]\nzoi = 32\n", "holds no gauge; give a table [gauges.NAME] each"),
        ("[gauges.far]\nstart = [5000, 1]\nend = [5000, 9]\n", "gauges.far: no ZOI is there"),
        ("[gauges.a\n", "gauges.toml"),
    ],
)
def test_refusals(
    run_dir: Path, toml: Path, capsys: pytest.CaptureFixture[str], text: str, says: str
) -> None:
    toml.write_text(text, encoding="utf-8")
    assert main(["show", str(run_dir), "--gauges", str(toml)]) == 2
    assert says in capsys.readouterr().err


def test_a_window_that_is_no_window_is_taken_as_the_usual_one(tmp_path: Path) -> None:
    config = {**CONFIG, "measure": {"window": "round"}}
    with open_run(make_run(tmp_path, PULLED[:3], config=config)) as run:
        assert run.field(0).window == "gaussian"
