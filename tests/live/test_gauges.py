"""Virtual gauges from the configuration to the files, live, in a replay and afterwards; areas that lost a part."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis import Status, StrainField
from analysis.evaluate import AreaGauge, Gauge, GaugeSet
from analysis.field import ZoiGrid
from live.cli import main
from live.commands.options import add_gauges
from live.config.gauges import gauges_for
from live.config.loading import load_config
from live.pipeline.history import History
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results import Results, ResultsInfo, Strain
from live.results.report.curves import others, parts
from live.results.run_folder import open_run
from live.results.summary import StatusCard, summary_lines
from live.run.outcome import Outcome
from live.ui.rerun.drawing.layout import paint
from live.ui.rerun.messages import LargeFigures
from live.ui.terminal.screen import status_line
from tests.live.made_run import finished
from tests.live.made_up import START, make_grid, make_measurement
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


@pytest.mark.parametrize(
    ("gauge", "message"),
    [
        ({"kind": "zoi"}, "gauges.g: a gauge of kind 'zoi' needs 'at'"),
        ({"start": [3, 4], "end": [3, 4]}, "are one point"),
        ({"kind": "area"}, "needs 'box'"),
        ({"kind": "zoi", "at": [900, 3]}, "no ZOI is there; their centres reach from 15.5, 15.5 to"),
        ({"start": [42, 42], "end": [42, 43]}, "the ZOIs at its ends are 0 px apart"),
        ({"start": [51, 50], "end": [51, 58]}, "degrees off the line: make it longer than a ZOI"),
    ],
)
def test_gauges_that_cannot_be_are_refused(gauge: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message.replace(".", r"\.")):
        gauges_for(load_config(None, {"gauges.g": gauge}).gauges, "y", make_grid())


SIM = (
    "sim:woven?cell=60&seconds=3&hold=0.5&fps=5&max_strain=0.004&width=240&height=240&noise=0.5&lockstep=yes"
)
BOX = "kind = 'area'\nbox = [60, 40, 100, 130]\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = tmp_path_factory.mktemp("afterwards")
    rig, out = at / "rig.toml", at / "run"
    rig.write_text(
        f'[camera]\naddress = "{SIM}"\n[measure]\nroi = [16, 16, 208, 208]\nzoi = 32\nstep = 16\nburst = 1\n'
        f"reference_burst = 1\n[specimen]\naxis = 'y'\n[gauges.during]\n{BOX}",
        encoding="utf-8",
    )
    (at / "later.toml").write_text(f"[gauges.later]\n{BOX}", encoding="utf-8")
    assert main(["run", "--config", str(rig), "--out", str(out), "--no-view", "--no-rrd", "--no-record"]) == 0
    return out


def differences(folder: Path) -> np.ndarray:
    with open_run(folder) as run:
        add_gauges(run, folder.parent / "later.toml")
        return np.asarray(run.gauges["later"].value - run.gauges["during"].value)


def test_its_values_are_those_of_the_test_to_the_digits_of_the_maps(folder: Path) -> None:
    assert np.abs(differences(folder)).max() < 3e-8
    with h5py.File(folder / "strain.h5") as file:
        normal = file["entry/references/normal"]
        assert normal.shape[0] == 1, "one reference"
        assert normal.id.get_storage_size() < 21 * 4 * normal.shape[2] * normal.shape[3] + 200


@pytest.mark.parametrize("value", [np.nan, 0.0, -1.0])
def test_damaged_normal_matrices_are_refused(folder: Path, tmp_path: Path, value: float) -> None:
    spoilt = tmp_path / "run"
    spoilt.mkdir()
    (spoilt / "strain.h5").write_bytes((folder / "strain.h5").read_bytes())
    with h5py.File(spoilt / "strain.h5", "a") as file:
        file["entry/references/normal"][...] = value
    assert main(["export", str(spoilt), "--gauges", str(folder.parent / "later.toml"), "--to", "csv"]) == 4


def test_a_file_without_normal_matrices_is_read_as_before(folder: Path, tmp_path: Path) -> None:
    old = tmp_path / "run"
    old.mkdir()
    (old / "strain.h5").write_bytes((folder / "strain.h5").read_bytes())
    (tmp_path / "later.toml").write_text(f"[gauges.later]\n{BOX}", encoding="utf-8")
    with h5py.File(old / "strain.h5", "a") as file:
        del file["entry/references"]
    assert 3e-7 < np.abs(differences(old)).max() < 1e-4


GRID = make_grid(256, 192)
HALF = AreaGauge("half", box=(0.0, 0.0, 128.0, 192.0))
FAR = AreaGauge("far", box=(128.0, 0.0, 128.0, 192.0))
INFO = ResultsInfo(START, "2026-11-23T00:00:00Z", {}, {}, {}, None, gauges={"half": {}, "far": {}})


def field(lost: bool) -> StrainField:
    whole = make_measurement(0, grid=GRID).field
    status = np.where(GRID.active, 0, Status.NOT_MEASURED)
    if lost:
        status[:6, :4] = np.where(GRID.active, Status.LOST, Status.NOT_MEASURED)[:6, :4]
    values = {name: np.nan_to_num(whole.value(name)) for name in ("u", "v", "du_dx", "dv_dy")}
    return StrainField.from_values(GRID, values, 1e-5, status=status)


def measured(number: int, lost: bool) -> Measurement:
    burst, found = make_measurement(number, grid=GRID).burst, field(lost)
    return Measurement.of(number, burst, found, 10.0, gauges=GaugeSet([HALF, FAR]).read(found))


def share_of(grid: ZoiGrid, gauge: Gauge | None) -> float:
    """By counting."""
    there = grid.active.copy() if gauge is None else gauge.zois(grid)[0]
    block = np.zeros(grid.shape, bool)
    block[:6, :4] = True
    return 1 - (there & block).sum() / there.sum()


def test_each_value_has_the_share_of_its_own_area() -> None:
    step = measured(0, lost=True).time_step
    assert step.area_share == pytest.approx(share_of(GRID, None))
    assert step.gauges["half"].share == pytest.approx(share_of(GRID, HALF)) == pytest.approx(step.least_share)
    assert step.gauges["half"].share < step.area_share < 1 == step.gauges["far"].share
    whole = measured(0, lost=False).time_step
    assert whole.area_share == whole.least_share == 1


def test_it_is_kept_in_the_history() -> None:
    history = History()
    history.add(measured(0, lost=True).time_step)
    kept, step = history.time_steps[0], measured(0, lost=True).time_step
    assert (kept.area_share, kept.least_share) == pytest.approx((step.area_share, step.least_share), rel=1e-6)
    assert kept.gauges.keys() == step.gauges.keys()
    for name, gauge in step.gauges.items():
        assert replace(kept.gauges[name], share=gauge.share) == gauge
        assert kept.gauges[name].share == pytest.approx(gauge.share, rel=1e-6)


@pytest.mark.parametrize("lost", [False, True])
def test_status_line_card_summary_and_view_are_marked(lost: bool) -> None:
    run_state, step = RunState.new(1.0), measured(0, lost).time_step
    run_state.history.add(step)
    run_state.health.began_t = 0.0
    now = run_state.snapshot(0.0, step)
    card = StatusCard(run_state.specimen, run_state.loads).written(now, run_state.history)
    summary = "\n".join(summary_lines(run_state, finished(run_state)))
    mean, least = (f"of {math.floor(100 * share_of(GRID, gauge))} % of the area" for gauge in (None, HALF))
    assert (mean in status_line(now, 300)) == lost
    assert (least in card) == (least in summary) == lost
    shown, whole = (LargeFigures.of(one) for one in (now, replace(now, area_share=1.0)))
    assert (paint(shown).tobytes() != paint(whole).tobytes()) == lost


def test_table_and_maps_have_the_shares(tmp_path: Path) -> None:
    results = Results(tmp_path, GRID, INFO)
    for number, lost in enumerate((False, True)):
        results.add(measured(number, lost))
    results.close()
    with (tmp_path / "strain.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    columns = {"area_share": None, "share_gauge_half": HALF, "share_gauge_far": FAR}
    with Strain.open(tmp_path / "strain.h5") as strain:
        for column, gauge in columns.items():
            wanted = [1.0, share_of(GRID, gauge)]
            assert [float(row[column]) for row in rows] == pytest.approx(wanted)
            assert strain.values[column] == pytest.approx(wanted)


def run_with(**values: list[float]) -> Any:
    known = {name: np.array(column) for name, column in values.items()}
    return SimpleNamespace(strain=SimpleNamespace(values=known, time_s=np.array([0.0, 1.5, 3.0])))


def test_the_curves_of_the_report_are_marked() -> None:
    text = parts(run_with(area_share=[1.0, 0.9, 0.84], share_gauge_axial=[1.0, 1.0, 0.7]))
    assert "2 of 3 instants, from 1.5 to 3 s" in text and "at least 70 %" in text
    assert parts(run_with(area_share=[1.0, 1.0, 1.0])) == ""
    (plot,) = others(run_with(area_share=[1.0, 0.9, 0.84]))
    assert plot.curves[0].y.tolist() == pytest.approx([100, 90, 84]) and "share of the area, %" in str(plot)
    assert others(run_with(area_share=[1.0, 1.0, math.nan])) == []
    assert parts(run_with(n_valid=[3.0, 2.0, 1.0])) == ""  # a file of an earlier version
