"""Virtual gauges from the configuration to the files, live and in a replay."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis.evaluate import GaugeValue
from live.cli import main
from live.config.gauges import gauges_for
from live.config.loading import load_config
from live.pipeline.history import History
from live.run.outcome import Outcome
from live.ui.terminal.status_line import gauge_texts
from tests.live.made_up import make_grid, make_measurement
from tests.live.test_end_to_end import live_run

GAUGES = {
    "gauges.axial": {"start": [110, 50], "end": [110, 140]},
    "gauges.transverse": {"kind": "transverse", "box": [20, 20, 180, 150]},
    "gauges.point": {"kind": "zoi", "at": [100, 100]},
    "gauges.peak": {"kind": "area", "box": [30, 30, 150, 130], "statistic": "largest"},
}
NAMES = ("axial", "transverse", "point", "peak")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    folder = tmp_path_factory.mktemp("gauges") / "run"
    return folder, live_run(folder, **GAUGES)


def gauges_in(folder: Path) -> dict[str, np.ndarray]:
    with h5py.File(folder / "strain.h5") as file:
        return {name: dataset[()] for name, dataset in file["entry/gauges"].items()}


def test_gauges_are_read_and_written(recorded: tuple[Path, Outcome]) -> None:
    folder, outcome = recorded
    assert outcome.exit_code == 0
    last = outcome.run_state.history.time_steps[-1]
    assert list(last.gauges) == list(NAMES)
    written = gauges_in(folder)
    for name, gauge in last.gauges.items():
        assert written[name][-1] == gauge.value
        assert written[f"sigma_{name}"][-1] == gauge.sigma > 0
    assert last.gauges["axial"].value == pytest.approx(last.eyy, rel=0.3)
    assert last.gauges["peak"].value > last.eyy
    with (folder / "strain.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["gauge_axial"]) == pytest.approx(last.gauges["axial"].value, rel=1e-8)
    assert float(rows[-1]["sigma_gauge_peak"]) == pytest.approx(last.gauges["peak"].sigma, rel=1e-8)
    with h5py.File(folder / "strain.h5") as file:
        assert json.loads(file["entry/gauges/axial"].attrs["gauge"])["end"] == [110.0, 140.0]


def test_the_curve_is_that_of_the_gauges(recorded: tuple[Path, Outcome]) -> None:
    history = recorded[1].run_state.history
    axial, transverse = history.along("y")
    assert np.array_equal(axial, [i.gauges["axial"].value for i in history.time_steps])
    assert np.array_equal(transverse, [i.gauges["transverse"].value for i in history.time_steps])
    assert History().gauge("axial") is None


def test_a_replay_is_bit_equal_and_takes_other_gauges(recorded: tuple[Path, Outcome], tmp_path: Path) -> None:
    folder, _ = recorded
    session, quiet = str(folder / "session.h5"), ["--no-view", "--no-rrd"]
    assert main(["replay", session, "--as-measured", "--out", str(tmp_path / "same"), *quiet]) == 0
    for name, values in gauges_in(tmp_path / "same").items():
        np.testing.assert_array_equal(values, gauges_in(folder)[name], err_msg=name)
    more = tmp_path / "more.toml"
    more.write_text(
        "[gauges.axial]\nstart = [60, 50]\nend = [60, 140]\n[gauges.late]\nkind = 'zoi'\nat = [60, 60]\n"
    )
    assert main(["replay", session, "--config", str(more), "--out", str(tmp_path / "other"), *quiet]) == 0
    other = gauges_in(tmp_path / "other")
    values = {name for name in other if not name.endswith("_errors")}  # NeXus' second names of the sigmas
    assert values == {"time_s", *NAMES, "late", *(f"sigma_{n}" for n in (*NAMES, "late"))}
    assert not np.array_equal(other["axial"], gauges_in(folder)["axial"])


def test_the_status_line_shows_gauges() -> None:
    found = make_measurement(0).time_step
    gauges = {"axial": GaugeValue(1.234e-3, 3e-6), "hole": GaugeValue(float("nan"), float("nan"), "lost")}
    words = gauge_texts(replace(found, gauges=gauges))
    assert words == ["axial 1\u202f234 ± 3 µm/m", "hole lost"]


@pytest.mark.parametrize(
    ("gauge", "message"),
    [
        ({"kind": "zoi"}, "gauges.g: a gauge of kind 'zoi' needs 'at'"),
        ({"start": [3, 4], "end": [3, 4]}, "are one point"),
        ({"kind": "area"}, "needs 'box'"),
        ({"kind": "zoi", "at": [900, 3]}, "no ZOI is there; their centres reach from 15.5, 15.5 to"),
    ],
)
def test_gauges_that_cannot_be_are_refused(gauge: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message.replace(".", r"\.")):
        gauges_for(load_config(None, {"gauges.g": gauge}).gauges, "y", make_grid())
