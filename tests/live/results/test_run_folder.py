"""The folder of a run read back: results, recording, pictures by instant, and gauges added afterwards."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest

from acquire.errors import DataError
from acquire.record_mode import RecordMode
from live.cli import main
from live.commands.options import add_gauges
from live.results import Results, ResultsInfo, Strain
from live.results.layout import StrainRow
from live.results.run_folder import open_run
from live.results.stored_fields import length_between
from live.results.strain_h5 import StrainWriter
from tests.live.made_run import CONFIG, E_PA, GAUGES, PULLED, make_run, session_writer
from tests.live.made_up import CAMERA, START, make_grid, make_measurement


def test_results_and_recording_are_tied_together(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path)) as run:
        assert run.title == "S1"
        assert (run.axial, run.transverse) == ("eyy", "exx")
        assert run.strain.n == len(PULLED)
        assert run.stress is not None
        elastic = (run.strain.values["eyy"] > 1e-4) & (run.strain.values["eyy"] < 2.5e-3)
        np.testing.assert_allclose(run.stress[elastic] / run.strain.values["eyy"][elastic], E_PA, rtol=0.02)
        assert [e.kind for e in run.events] == ["start", "reference", "note"]
        assert run.start_monotonic == START
        assert run.session is not None
        assert run.session.frame_counts is not None


def test_pictures_are_those_of_the_middle_of_the_burst(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path)) as run:
        assert run.pictures is not None
        last = len(PULLED) - 1
        levels = [int(image[0, 0]) - 100 for image in run.pictures.each([0, 3, last])]
        assert [level // 8 for level in levels] == [0, 3, last]
        assert all(level % 8 in (3, 4) for level in levels)


def test_a_results_file_alone_is_a_run_without_pictures(tmp_path: Path) -> None:
    make_run(tmp_path, session=False)
    with open_run(tmp_path / "strain.h5") as run:
        assert run.session is None
        assert run.pictures is None
        assert run.events == []
        assert run.path == tmp_path


def test_a_replay_finds_the_session_it_was_made_from(tmp_path: Path) -> None:
    recorded = make_run(tmp_path / "live") / "session.h5"
    config = {**CONFIG, "camera": {"address": f"session:{recorded}"}}
    with open_run(make_run(tmp_path / "again", session=False, config=config)) as run:
        assert run.session_path == recorded
        assert run.pictures is not None


@pytest.mark.parametrize(
    ("source", "more", "shape"),
    [
        ("files:{folder}/*.png", [], (96, 128)),
        ("{folder}/*.png", [], (96, 128)),
        ("{folder}", ["0, 0, 96, 80"], (80, 96)),
    ],
)
def test_a_replay_of_pictures_finds_them_again(
    tmp_path: Path, source: str, more: list[str], shape: tuple[int, int]
) -> None:
    rng = np.random.default_rng(1)
    pattern = cv2.GaussianBlur(rng.normal(size=(96, 128)).astype(np.float32), (0, 0), 2.0)
    for k in range(4):
        image = np.clip(128 + 300 * pattern + k, 0, 255).astype(np.uint8)
        image[0, 0] = k
        cv2.imwrite(str(tmp_path / f"a{k}.png"), image)
    out = str(tmp_path / "out")
    arguments = ["--zoi", "32", "--out", out, "--no-view", "--no-rrd"]
    config = tmp_path / "crop.toml"
    config.write_text(f"[camera]\ncrop = [{more[0]}]\n" if more else "")
    assert main(["replay", source.format(folder=tmp_path), "--config", str(config), *arguments]) == 0
    with open_run(out) as run:
        assert run.pictures is not None
        images = list(run.pictures.each([0, 2]))
        assert [int(image[0, 0]) for image in images] == [1, 3]
        assert (run.pictures.info.height, run.pictures.info.width) == images[0].shape == shape
    for path in tmp_path.glob("a*.png"):
        path.unlink()
    with open_run(out) as run:
        assert run.pictures is None


def test_a_recording_of_bursts_gives_their_means(tmp_path: Path) -> None:
    make_run(tmp_path, PULLED[:5], session=False)
    image = np.arange(96 * 128, dtype=np.float32).reshape(96, 128) % 4000
    with session_writer(tmp_path, {}, {}, RecordMode("bursts")) as writer:
        for k in range(5):
            burst = make_measurement(k).burst
            mean = np.round(image + k)
            clipped = np.zeros(mean.shape, bool)
            writer.write_burst(dataclasses.replace(burst, mean=mean, clipped=clipped))
    with open_run(tmp_path) as run:
        assert run.pictures is not None
        assert [float(picture[0, 0]) for picture in run.pictures.each([0, 2, 4])] == [0.0, 2.0, 4.0]


def test_what_is_not_a_run_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no strain\.h5 there; give the folder"):
        open_run(tmp_path)
    make_run(tmp_path)
    (tmp_path / "session.h5").write_bytes(b"no HDF5")
    with open_run(tmp_path) as run:
        assert run.pictures is None and run.events == [] and run.load_samples == []
        assert len(run.notes) == 1 and "session.h5" in run.notes[0]
    with h5py.File(tmp_path / "strain.h5", "a") as file:
        del file["entry/config"]
        file["entry/config"] = json.dumps({"specimen": {"width_mm": "wide"}})
    with open_run(tmp_path) as run, pytest.raises(DataError, match=r"width_mm"):
        _ = run.specimen


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
            np.testing.assert_allclose(run.gauges[name].value, gauge.value, atol=2e-9)  # as maps are stored
            np.testing.assert_allclose(run.gauges[name].sigma, gauge.sigma, rtol=2**-8)  # as maps are stored
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
    ("text", "message"),
    [
        ("[measure]\nzoi = 32\n", "holds no gauge; give a table [gauges.NAME] each"),
        ("[gauges.far]\nstart = [5000, 1]\nend = [5000, 9]\n", "gauges.far: no ZOI is there"),
        ("[gauges.a\n", "gauges.toml"),
    ],
)
def test_refusals(
    run_dir: Path, toml: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    toml.write_text(text, encoding="utf-8")
    assert main(["show", str(run_dir), "--gauges", str(toml)]) == 2
    assert message in capsys.readouterr().err


def test_a_window_that_is_no_window_is_taken_as_the_usual_one(tmp_path: Path) -> None:
    config = {**CONFIG, "measure": {"window": "round"}}
    with open_run(make_run(tmp_path, PULLED[:3], config=config)) as run:
        assert run.field(0).window == "gaussian"


def results_of(folder: Path, zeros: tuple[float, ...], **config: dict[str, Any]) -> Path:
    """Instants with 100 N more each, of which ``zeros`` had been taken off by tares."""
    info = ResultsInfo(START, "2030-01-02T03:04:05+00:00", config, {}, {}, CAMERA)
    with Results(folder, make_grid(), info) as results:
        for k, zero in enumerate(zeros):
            m = make_measurement(k, 1e-3 * k, force=100.0 * k - zero)
            results.add(dataclasses.replace(m, time_step=dataclasses.replace(m.time_step, zero=zero)))
    return folder


def test_stresses_have_the_zero_of_the_first_instant(tmp_path: Path) -> None:
    """60 N were taken off in mid-test, beside 5 N before it."""
    with open_run(results_of(tmp_path, (5.0, 5.0, 65.0, 65.0), specimen={"area_mm2": 20.0})) as run:
        assert run.force.tolist() == [-5.0, 95.0, 135.0, 235.0]
        assert run.force_one_zero.tolist() == [-5.0, 95.0, 195.0, 295.0]
        assert run.stress is not None
        np.testing.assert_allclose(run.stress, np.array([-5.0, 95.0, 195.0, 295.0]) / 20e-6)
        np.testing.assert_array_equal(run.curve.stress, run.stress)


@pytest.mark.parametrize(
    ("gauge", "px"),
    [
        (None, 64.0),  # one ZOI of the first row is missing: the strips are taken where they face each other
        ({"kind": "extension", "box": [0.0, 7.5, 128.0, 80.0]}, 64.0),
        ({"kind": "line", "start": [31.5, 31.5], "end": [63.5, 79.5], "radius_px": 1.0}, math.hypot(32, 48)),
    ],
    ids=["strips", "extension", "line"],
)
def test_the_gauge_length_is_that_between_the_ends_in_mm(
    tmp_path: Path, gauge: dict[str, Any] | None, px: float
) -> None:
    gauges = {} if gauge is None else {"axial": gauge}
    with open_run(results_of(tmp_path / "a", (0.0,), scale={"mm_per_px": 0.05})) as run:
        assert not run.strain.grid.active[0, 0]
        assert length_between(run.strain, "y", gauge) == pytest.approx(px)
        assert gauge is not None or run.gauge_length_mm == pytest.approx(0.05 * px)
        assert math.isnan(length_between(run.strain, "x", {"kind": "spiral"}))
    with open_run(results_of(tmp_path / "b", (0.0,), gauges=gauges)) as run:
        assert run.gauge_length_mm is None, "the scale is not known"


class Pattern:
    """In place of ``Sums``: the normal matrices of all ZOIs are one number."""

    def __init__(self, value: float) -> None:
        self._value = value

    def information(self, at: np.ndarray) -> np.ndarray:
        return np.full((6, 6, len(at)), self._value)


def test_every_row_has_the_reference_it_was_measured_against(tmp_path: Path) -> None:
    first, second = Pattern(1.5), Pattern(2.5)
    info = ResultsInfo(START, "2030-01-02T03:04:05+00:00", {}, {}, {}, CAMERA)
    file = StrainWriter(tmp_path / "strain.h5", make_grid(), info)
    for k, pattern in enumerate((first, first, second, second)):
        row = StrainRow.of(make_measurement(k), info)
        file.write(dataclasses.replace(row, pattern=pattern))  # type: ignore[arg-type]
    file.close()
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert [strain.reference(row) for row in range(4)] == [0, 0, 1, 1]
        active = strain.grid.active
        for number, value in ((0, 1.5), (1, 2.5)):
            normal = strain.normal(number)
            assert (normal[:, active] == value).all() and (normal[:, ~active] == 0).all()
