"""Plates from the rig file to the results: strains corrected by value, live as in a replay, and loud where it stops."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from acquire.errors import ConfigError
from acquire.session import Session
from live.cli import main
from live.config.loading import from_dict, load_config
from live.config.rig_file import write_rig
from live.results.reader import Strain
from live.setup.grid import grid_for, plates_for
from tests.live.test_end_to_end import assert_replay_is_bit_equal

VIEW = "width=400&height=240&seconds=6&fps=5&max_strain=0.001&hold=1&noise=0.2&lockstep=yes"
LENS = "stand_off_mm=500&settle_mm=0.2&settle_x_deg=0.1&settle_y_deg=0.1&plates=20,20,90,200;290,20,90,200"
RIG = """
[camera]
address = "sim:?{view}"
[load]
address = "sim:"
[measure]
roi = [130, 20, 140, 200]
zoi = 32
step = 16
burst = 1
reference_burst = 1
[specimen]
axis = "y"
area_mm2 = 40
[gauges.axial]
start = [200, 50]
end = [200, 190]
[plate.left]
box = [20, 20, 90, 200]
[plate.right]
box = [290, 20, 90, 200]
"""
QUIET = ["--no-view", "--no-rrd"]


def run(folder: Path, *settings: str) -> Path:
    folder.mkdir(exist_ok=True)
    rig, out = folder / "rig.toml", folder / "run"
    rig.write_text(RIG.format(view="&".join((VIEW, LENS, *settings))))
    assert main(["run", "--config", str(rig), "--out", str(out), *QUIET]) == 0
    return out


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(tmp_path_factory.mktemp("plates"))


def test_all_strains_are_corrected_and_the_raw_ones_kept(good: Path) -> None:
    with Strain.open(good / "strain.h5") as strain:
        last = {name: float(values[-1]) for name, values in strain.values.items()}
        eyy = strain.maps("eyy", -1)
    assert last["raw_eyy"] - 1e-3 == pytest.approx(400e-6, abs=15e-6)
    for name in ("eyy", "gauge_axial", "extension_y"):
        assert last[f"sigma_{name}"] < 15e-6
        assert last[name] == pytest.approx(1e-3, abs=3 * last[f"sigma_{name}"])
    assert last["exx"] == pytest.approx(-0.33e-3, abs=20e-6)
    assert np.mean(eyy) == pytest.approx(1e-3, abs=20e-6)
    assert eyy.shape == (11, 7)  # the specimen alone
    assert last["plate_scale"] == pytest.approx(400e-6, abs=10e-6)
    assert 0.5e-6 < last["sigma_plate_scale"] < 10e-6
    assert last["sigma_eyy"] > last["sigma_plate_scale"]
    assert last["corrected"] == 1


def test_a_replay_is_bit_equal(good: Path, tmp_path: Path) -> None:
    assert_replay_is_bit_equal(good, tmp_path / "again")


@pytest.mark.slow
def test_a_replay_in_chunks_is_the_same(good: Path, tmp_path: Path) -> None:
    out = tmp_path / "batch"
    (tmp_path / "tests.csv").write_text(f"source\n{good / 'session.h5'}\n")
    arguments = ["batch", str(tmp_path / "tests.csv"), "--out", str(out), "--chunk", "10", "--workers", "1"]
    assert main(arguments) == 0
    found = next(out.rglob("strain.csv"))
    for name in ("eyy", "raw_eyy", "plate_scale"):
        np.testing.assert_array_equal(column(found, name), column(good / "strain.csv", name), err_msg=name)


def column(path: Path, name: str) -> list[str]:
    with path.open(newline="", encoding="utf-8") as file:
        return [row[name] for row in csv.DictReader(line for line in file if not line.startswith("#"))]


def test_a_loaded_plate_stops_the_correction_loudly(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = run(tmp_path, "plate_strain=1")
    shown = capfd.readouterr()
    assert "is loaded or not flat" in shown.out + shown.err
    with Session.open(out / "session.h5") as session:
        events = [event for event in session.events() if event.source == "plates"]
    assert [event.level for event in events] == ["info", "error"]
    with Strain.open(out / "strain.h5") as strain:
        scale, good = strain.values["plate_scale"], strain.values["corrected"]
    stopped = int(np.argmin(good))
    assert good[:stopped].all()
    assert not good[stopped:].any()
    # The last good motion stays removed: no jump in the curve.
    assert set(scale[stopped:]) == {scale[stopped - 1]}


@pytest.mark.parametrize(
    ("plates", "words"),
    [
        ({"left": {}}, "plate.left: give box"),
        ({"left": {"box": [1, 2, 3]}}, r"plate\.left\.box = \[1, 2, 3\] is not possible"),
        ({"2": {"box": [1, 2, 3, 4]}}, "plate.2: a name has up to 32 letters"),
        ({"left": {"boks": 1}}, r"unknown key plate\.left\.boks; known: box"),
        ({"left": [1, 2, 3, 4]}, "plate.left must be a table"),
    ],
)
def test_impossible_tables_are_refused(plates: object, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        from_dict({"plate": plates}, {}, "rig.toml")


def test_plates_that_do_not_fit_are_refused() -> None:
    def plan(box: list[float]) -> None:
        table = {"measure": {"roi": [130, 20, 140, 200], "zoi": 32}, "plate": {"left": {"box": box}}}
        config = from_dict(table, {}, "rig.toml")
        plates_for(config, grid_for(config, 400, 240, None), 400, 240)

    with pytest.raises(ConfigError, match="plate left of 40 x 200 px has no room"):
        plan([20, 20, 40, 200])
    with pytest.raises(ConfigError, match="the plates cover the whole region"):
        plan([100, 0, 200, 240])


def test_plates_are_stored_and_read_in_mm(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    write_rig(path, {"scale.mm_per_px": 0.05, "plate.left": {"box": ["1 mm", "1 mm", "5 mm", "20 mm"]}})
    config = load_config(path, {})
    assert config.plate["left"].box == (20, 20, 100, 400)
    assert from_dict(config.as_dict(), {}, "session") == config
    assert "plate" not in load_config(None, {}).as_dict()  # versions before do not have the section
