"""strain.h5 and strain.csv: what is written comes back, also after a kill."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.errors import DataError
from acquire.hdf5 import damage as child
from analysis import Roi, ZoiGrid
from analysis.field import PAIR_INDEX
from live.pipeline.measurement import Measurement
from live.results import Results, ResultsInfo, Strain
from live.results.layout import COLUMNS, MAPS, PLAIN_MAPS, StrainRow, maps_of
from live.results.stored_fields import read_field
from live.results.strain_h5 import FLUSH_S, StrainWriter, rounded
from tests.acquire.session.fixtures import writer
from tests.clock import Clock
from tests.live.made_up import CAMERA, START, make_grid, make_measurement

INFO = ResultsInfo(
    START,
    "2030-01-02T03:04:05+00:00",
    {"measure": {"zoi": 32}},
    {"specimen": "S1"},
    {"phasedic": "0.1.0"},
    CAMERA,
)


def open_results(folder: Path, **more: Any) -> Results:
    return Results(folder, make_grid(), dataclasses.replace(INFO, **more))


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_the_last_piece_of_each_column_stays_in_memory(tmp_path: Path) -> None:
    """HDF5 reads a piece that is larger than its cache from the disk again for each row."""
    writer(tmp_path / "session.h5").close()
    open_results(tmp_path).close()
    sizes = {}
    for path in (tmp_path / "session.h5", tmp_path / "strain.h5"):
        with h5py.File(path) as file:
            datasets: list[h5py.Dataset] = []
            file.visititems(lambda _, item, found=datasets: found.append(item))  # type: ignore[misc]
            sizes |= {
                f"{path.stem} {one.name}": one.chunks[0] * one.dtype.itemsize
                for one in datasets
                if isinstance(one, h5py.Dataset) and one.chunks and one.ndim == 1
            }
    assert len(sizes) > 50
    assert max(sizes.values()) <= child.CACHE_BYTES, sizes


def test_what_was_written_comes_back(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        for k in range(5):
            results.add(make_measurement(k, 1e-3 * k, force=10.0 * k))
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert strain.n == 5
        assert not strain.unfinished
        assert strain.start_utc == "2030-01-02T03:04:05+00:00"
        assert strain.config == {"measure": {"zoi": 32}}
        assert strain.metadata == {"specimen": "S1"}
        assert strain.grid.size == 32
        np.testing.assert_array_equal(strain.grid.active, make_grid().active)
        np.testing.assert_allclose(strain.time_s, 0.1 * np.arange(5), atol=1e-12)
        np.testing.assert_allclose(strain.values["force_N"], 10.0 * np.arange(5), atol=1e-6)
        np.testing.assert_allclose(strain.values["eyy"], 1e-3 * np.arange(5))
        field = make_measurement(4, 4e-3).field
        for name in ("u", "v", "dv_dy", "exx", "eyy", "exy", "sigma_eyy", "sigma_u", "residual"):
            expected = rounded(maps_of(field, "small"))[name].astype(np.float32)
            np.testing.assert_array_equal(strain.maps(name, 4), expected, name)
        np.testing.assert_array_equal(strain.maps("status", 4), field.status)
        assert strain.maps("exx").shape == (5, *strain.grid.shape)
        assert len(strain.maps("exx", slice(1, 3))) == 2


def noisy_row(side: int) -> StrainRow:
    """Maps as a measurement gives them: a strain with noise, uncertainties that differ by a few percent."""
    rng = np.random.default_rng(5)
    row = StrainRow.of(make_measurement(1, 1e-3), INFO)
    maps = dict(row.maps)
    for name in (*PLAIN_MAPS, "blur"):
        sigma = 1e-4 * rng.normal(1, 0.05, (side, side)).astype(np.float32)
        maps[f"sigma_{name}"], maps[name] = sigma, (2e-3 + sigma * rng.normal(size=sigma.shape)).astype("f4")
    maps["residual"] = rng.normal(1, 0.1, (side, side)).astype(np.float32)
    maps |= {name: np.zeros((side, side), np.uint8) for name in ("status", "iterations")}
    return dataclasses.replace(row, maps=maps)


def test_rounding_is_far_below_the_uncertainty() -> None:
    maps = noisy_row(32).maps
    sigma = maps["sigma_exx"]
    sigma[0, :4], maps["exx"][1, :2] = (0.0, math.nan, math.inf, -1.0), (math.nan, math.inf)
    stored = rounded(maps)
    np.testing.assert_array_equal(stored["exx"][0, :4], maps["exx"][0, :4])
    np.testing.assert_array_equal(stored["exx"][1, :2], maps["exx"][1, :2])
    np.testing.assert_array_equal(stored["sigma_exx"][0, :4], sigma[0, :4])
    change = np.abs(stored["exx"][2:] - maps["exx"][2:]) / sigma[2:]
    assert 1 / 4096 < change.max() <= 1 / 1024
    change = np.abs(stored["sigma_exx"][2:] / sigma[2:] - 1)
    assert 0.0005 < change.max() <= 2**-9
    assert np.abs(stored["residual"] / maps["residual"] - 1).max() <= 2**-9
    assert all(stored[name].dtype == maps[name].dtype for name in maps)


def test_the_maps_take_half_of_their_bytes(tmp_path: Path) -> None:
    row, side = noisy_row(32), 32
    grid = ZoiGrid.cover(Roi(0, 0, 32 * side, 32 * side), 32, 32)
    writer = StrainWriter(tmp_path / "strain.h5", grid, INFO)
    for _ in range(3):
        writer.write(row)
    writer.close()
    with h5py.File(tmp_path / "strain.h5") as file:
        stored = sum(file["entry/strain"][name].id.get_chunk_info(2).size for name in MAPS)
    assert 0.2 < stored / sum(row.maps[name].nbytes for name in MAPS) < 0.5


def blurred(number: int) -> Measurement:
    """With a blur of 0.5 px that is known to 0.1 px^2 in each ZOI."""
    m = make_measurement(number)
    blur = np.stack([np.where(m.field.ok, value, np.nan) for value in (0.25, 0.1)]).astype(np.float32)
    return dataclasses.replace(
        m,
        field=dataclasses.replace(m.field, blur=blur),
        time_step=dataclasses.replace(m.time_step, blur=0.5, sigma_blur=0.02),
    )


def test_the_blur_comes_back_and_files_without_it_open(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        results.add(blurred(0))
    path = tmp_path / "strain.h5"
    with Strain.open(path) as strain:
        ok = strain.maps("status", 0) == 0
        assert (
            strain.maps("blur", 0)[ok] == pytest.approx(0.5) and np.isnan(strain.maps("blur", 0)[~ok]).all()
        )
        assert strain.maps("sigma_blur", 0)[ok] == pytest.approx(
            (math.sqrt(0.35) - math.sqrt(0.15)) / 2, rel=2**-9
        )
        assert (strain.values["blur_px"][0], strain.values["sigma_blur_px"][0]) == (0.5, 0.02)
    with h5py.File(path, "r+") as file:
        for name in (
            "strain/blur",
            "strain/sigma_blur",
            "strain/blur_errors",
            "mean/blur_px",
            "mean/sigma_blur_px",
        ):
            del file["entry"][name]
    with Strain.open(path) as strain:
        assert "blur" not in strain.names and "blur_px" not in strain.values
        assert np.isfinite(strain.maps("eyy", 0)[ok]).all()


def test_the_table_has_the_columns_scripts_rely_on(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        results.add(make_measurement(3, 2e-3, force=30.0))
    first = "frame,time_s,force_N,exx,eyy,exy,sigma_exx,sigma_eyy,sigma_exy,n_valid,n_zoi"
    text = (tmp_path / "strain.csv").read_text()
    assert text.startswith(first)
    (row,) = rows_of(tmp_path / "strain.csv")
    n_active = int(make_grid().active.sum())
    assert (row["frame"], row["last_frame"], row["n_frames"], row["lost"]) == ("24", "31", "8", "1")
    assert (int(row["n_valid"]), int(row["n_zoi"])) == (n_active - 1, n_active)
    assert float(row["eyy"]) == pytest.approx(2e-3, rel=1e-9)
    assert float(row["sigma_eyy"]) == pytest.approx(make_measurement(0).time_step.sigma_eyy, rel=1e-8)
    assert float(row["force_N"]) == pytest.approx(30.0, rel=1e-6)


def test_table_and_maps_say_the_same(tmp_path: Path) -> None:
    with open_results(tmp_path, area_m2=4e-5) as results:
        for k in range(3):
            results.add(make_measurement(k, 1e-4 + 1e-3 * k, force=7.0 * k))
    with Strain.open(tmp_path / "strain.h5") as strain:
        for k, row in enumerate(rows_of(tmp_path / "strain.csv")):
            for column in (*COLUMNS, "stress_Pa", "true_strain", "true_stress_Pa"):
                assert float(row[column]) == pytest.approx(
                    float(strain.values[column][k]), rel=1e-9, nan_ok=True
                ), column
        stress, eyy = strain.values["force_N"] / 4e-5, strain.values["eyy"]
        np.testing.assert_allclose(strain.values["stress_Pa"], stress)
        np.testing.assert_allclose(strain.values["true_stress_Pa"], stress * (1 + eyy))
        np.testing.assert_allclose(strain.values["true_strain"], np.log1p(eyy))
        assert "force_raw_N" not in strain.values


def test_another_measure_of_strain(tmp_path: Path) -> None:
    with open_results(tmp_path, strain_measure="green") as results:
        results.add(make_measurement(0, 0.02))
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert strain.strain_measure == "green"
        assert strain.values["eyy"][0] == pytest.approx(0.02 + 0.02**2 / 2)
        assert np.nanmax(strain.maps("eyy", 0)) == pytest.approx(0.0202, rel=1e-6)


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "strain.csv").write_text("precious")
    with pytest.raises(DataError, match=r"strain\.csv exists already"):
        open_results(tmp_path)
    assert (tmp_path / "strain.csv").read_text() == "precious"
    assert not (tmp_path / "strain.h5").exists()


def test_a_disk_that_takes_no_more_is_told_and_spoils_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = open_results(tmp_path)
    results.add(make_measurement(0))

    def full(*_: object) -> None:
        raise RuntimeError("unable to flush: no space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(h5py.File, "flush", full)
        with pytest.raises(
            DataError, match=r"strain\.h5: cannot be written .*no space.*; 1 row before can be read"
        ):
            results.add(make_measurement(1))
            time.sleep(results.flush_when_due())
            results.flush_when_due()
    results.close()
    results.close()
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert strain.n >= 1


def test_nexus_viewers_find_the_default_plot(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        results.add(make_measurement(0))
    with h5py.File(tmp_path / "strain.h5") as file:
        assert (file.attrs["format"], file.attrs["format_version"]) == ("phasedic-strain", 1)
        assert file.attrs["NX_class"] == "NXroot"
        entry = file[file.attrs["default"]]
        assert entry.attrs["NX_class"] == "NXentry"
        data = entry[entry.attrs["default"]]
        assert data.attrs["NX_class"] == "NXdata"
        signal = data[data.attrs["signal"]]
        assert [len(data[axis]) for axis in data.attrs["axes"]] == list(signal.shape)
        assert data.attrs["title"] == "Strain maps, small strain"
        assert data["eyy_errors"] == data["sigma_eyy"], "a link, not a copy"
        assert entry["mean/eyy_errors"] == entry["mean/sigma_eyy"]
        assert data.attrs["default_slice"].tolist() == [b"0", b".", b"."]
        assert len(data["force_N"]) == len(data["frame"]) == 1
        for name, item in data.items():
            assert "units" in item.attrs, name
        words = json.loads(data["status"].attrs["meaning"])
        assert words["0"].startswith("OK")


def test_viewers_begin_with_the_last_instant_and_readers_see_each_column_once(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        for k in range(12):
            results.add(make_measurement(k))
    with h5py.File(tmp_path / "strain.h5") as file:
        assert file["entry/strain"].attrs["default_slice"].tolist() == [b"11", b".", b"."]
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert not [name for name in strain.values if name.endswith("_errors")]


@pytest.mark.parametrize("given", ["auto", "y"])
def test_the_axis_of_the_load_is_stored(tmp_path: Path, given: str) -> None:
    with open_results(tmp_path, axis=given, area_m2=1e-5) as results:
        for k in range(40):
            m, e = make_measurement(k, 0.0, force=1.0), 1e-4 * k
            results.add(
                dataclasses.replace(
                    m,
                    time_step=dataclasses.replace(
                        m.time_step, exx=e, eyy=-0.3 * e, extension_x=e, extension_y=-0.3 * e
                    ),
                )
            )
    with h5py.File(tmp_path / "strain.h5") as file:
        attributes = dict(file["entry/mean"].attrs)
    if given == "y":
        assert attributes["load_axis"] == b"y" and abs(attributes["load_angle_deg"]) == pytest.approx(90)
    else:
        assert attributes["load_axis"] == b"x" and attributes["load_angle_deg"] == pytest.approx(0, abs=1e-3)
    with Strain.open(tmp_path / "strain.h5") as strain:
        name = "exx" if given == "auto" else "eyy"
        true = strain.values["true_strain"][-1]
        assert true == pytest.approx(math.log1p(strain.values[name][-1]), rel=1e-12)


def test_what_silx_and_nexpy_make_of_it(tmp_path: Path) -> None:
    silx, nexus = pytest.importorskip("silx.io"), pytest.importorskip("nexusformat.nexus")
    nxdata = pytest.importorskip("silx.io.nxdata")
    with open_results(tmp_path) as results:
        results.add(make_measurement(0))
    with silx.open(str(tmp_path / "strain.h5")) as file:
        plot = nxdata.get_default(file)
        assert plot.is_valid
        assert not plot.issues
        assert plot.errors is not None
        assert (plot.title, plot.interpretation) == ("Strain maps, small strain", "image")
    plotted = nexus.nxload(str(tmp_path / "strain.h5")).plottable_data
    assert [axis.nxname for axis in plotted.nxaxes] == ["time_s", "y", "x"]


def test_time_of_the_kernel_and_latency_are_columns(tmp_path: Path) -> None:
    live = make_measurement(0)
    time_step = dataclasses.replace(live.time_step, measure_s=0.012, latency_s=0.025)
    with open_results(tmp_path) as results:
        results.add(dataclasses.replace(live, time_step=time_step))
        results.add(make_measurement(1))
    with Strain.open(tmp_path / "strain.h5") as strain:
        np.testing.assert_array_equal(strain.values["kernel_s"], [0.012, math.nan])
        np.testing.assert_array_equal(strain.values["latency_s"], [0.025, math.nan])
    first, second = rows_of(tmp_path / "strain.csv")
    assert (first["kernel_s"], first["latency_s"]) == ("0.012", "0.025")
    assert (second["kernel_s"], second["latency_s"]) == ("nan", "nan")


@pytest.mark.parametrize("flush_s", [FLUSH_S, 10.0])
def test_rows_are_flushed_together_and_on_time(tmp_path: Path, flush_s: float) -> None:
    clock = Clock()
    writer = StrainWriter(tmp_path / "strain.h5", make_grid(), INFO, flush_s, now=clock)
    rows = [StrainRow.of(make_measurement(k, 1e-3 * k), INFO) for k in range(3)]
    clock.now_s = 1.0
    writer.write(rows[0])
    clock.now_s += flush_s / 2
    writer.write(rows[1])
    writer.write(rows[2])
    assert writer.flush_when_due() == pytest.approx(flush_s / 2)
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert strain.n == 1
    clock.now_s += flush_s
    assert writer.flush_when_due() == math.inf
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert strain.n == 3
        np.testing.assert_array_equal(strain.maps("v", 2), rounded(rows[2].maps)["v"].astype(np.float32))
    writer.close()


WRITER = """
import itertools, sys, time
from pathlib import Path
from tests.live.made_up import make_measurement
from tests.live.results.test_writer_and_reader import open_results
results = open_results(Path(sys.argv[1]))
for k in itertools.count():
    results.add(make_measurement(k, 1e-5 * k))
    print(k, time.monotonic(), flush=True)
"""


@pytest.mark.timed
def test_a_killed_writer_leaves_what_is_older_than_its_last_flush(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITER, str(tmp_path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[3]
    ) as writer:
        assert writer.stdout is not None
        began = float(writer.stdout.readline().split()[1])
        lines = next(line for line in writer.stdout if float(line.split()[1]) > began + 0.6)
        os.kill(writer.pid, signal.SIGKILL)
        killed = time.monotonic()
        lines += writer.stdout.read()
    written = [(int(k), float(t)) for k, t in (line.split() for line in lines.splitlines())]
    with Strain.open(tmp_path / "strain.h5") as strain:
        assert strain.unfinished
        # Half a second for a flush that waits for a core.
        assert strain.n > max((k for k, t in written if t < killed - FLUSH_S - 0.5), default=1)
        np.testing.assert_allclose(strain.values["eyy"], 1e-5 * np.arange(strain.n), rtol=1e-6, atol=1e-12)
        assert np.isfinite(strain.maps("eyy")[:, 1, 1]).all()
    assert len(rows_of(tmp_path / "strain.csv")) > written[-1][0]


def test_what_is_not_ours_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        Strain.open(tmp_path / "missing.h5")
    text = tmp_path / "text.h5"
    text.write_text("hello")
    with pytest.raises(DataError, match="not an HDF5 file"):
        Strain.open(text)
    foreign = tmp_path / "foreign.h5"
    with h5py.File(foreign, "w") as file:
        file["x"] = 1
    with pytest.raises(DataError, match="something else: not a strain file of phasedic"):
        Strain.open(foreign)
    with h5py.File(foreign, "a") as file:
        file.attrs["format"], file.attrs["format_version"] = "phasedic-strain", 1
    with pytest.raises(DataError, match="start_time is missing"):
        Strain.open(foreign)
    with h5py.File(foreign, "a") as file:
        file.attrs["format_version"] = 2
    with pytest.raises(DataError, match="version 2, this program reads up to 1; update"):
        Strain.open(foreign)


def test_a_truncated_file_is_refused_in_words(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        for k in range(5):
            results.add(make_measurement(k))
    path = tmp_path / "strain.h5"
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 3)
    with pytest.raises(DataError, match=r"strain\.h5"):
        Strain.open(path)


def test_an_unfinished_file_that_lost_its_end_does_not_hang(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = open_results(tmp_path)
    for k in range(5):
        results.add(make_measurement(k))
    torn = tmp_path / "torn.h5"
    torn.write_bytes((tmp_path / "strain.h5").read_bytes()[:30_000])
    results.close()
    monkeypatch.setattr(child, "PROBE_S", 2.0)
    with pytest.raises(DataError, match=r"torn\.h5.* (damaged|truncated)"):
        Strain.open(torn)


def test_the_uncertainty_of_the_shear_comes_back_with_that_of_its_two_gradients(tmp_path: Path) -> None:
    """In the file are three standard deviations; what two gradients have in common follows from them."""
    m = make_measurement(0)
    covariance = np.array(m.field.covariance)
    covariance[PAIR_INDEX[2, 4]] = 0.6e-10  # of du_dy and dv_dx, each with 1e-5
    with open_results(tmp_path) as results:
        results.add(dataclasses.replace(m, field=dataclasses.replace(m.field, covariance=covariance)))
    with Strain.open(tmp_path / "strain.h5") as strain:
        field = read_field(strain, 0)
    assert field.covariance[PAIR_INDEX[2, 4]][field.ok] == pytest.approx(0.6e-10, rel=0.01)
    assert field.sigma_exy[field.ok] == pytest.approx(math.sqrt(2e-10 + 1.2e-10) / 2, rel=1e-3)
