"""strain.h5 by value: attributes, units, links, rows, and what is refused."""

from __future__ import annotations

import csv
import json
import logging
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from analysis.evaluate import GaugeValue
from live.pipeline.measurement import Measurement
from live.results import Results, ResultsInfo, Strain
from live.results.__main__ import main as probed
from live.results.layout import StrainRow, gauge_columns
from live.results.quantities import Display
from live.results.strain_h5 import normal_matrices
from live.results.writer import CsvWriter
from tests.live.made_up import CAMERA, START, make_grid, make_measurement

INFO = ResultsInfo(START, "2030-01-02T03:04:05+00:00", {"measure": {"zoi": 32}}, {"specimen": "S1"},
                   {"phasedic": "0.1.0"}, CAMERA, gauges={"a": {"kind": "zoi", "at": [1, 2]}})  # fmt: skip


def gauged(number: int, strain: float = 1e-3, **more: Any) -> Measurement:
    m = make_measurement(number, strain, force=10.0 * number)
    step = replace(m.time_step, gauges={"a": GaugeValue(2e-3 * number, 1e-6, share=0.5)}, **more)
    return replace(m, time_step=step)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    with Results(folder, make_grid(), INFO) as results:
        for k in range(4):
            results.add(gauged(k, 1e-3 * k))
    return folder / "strain.h5"


@pytest.fixture
def strain(written: Path) -> Iterator[Strain]:
    with Strain.open(written) as opened:
        yield opened


def test_every_number_has_its_unit_in_the_file(written: Path) -> None:
    with h5py.File(written) as file:
        entry = file["entry"]
        assert entry["title"][()] == b"S1" and entry["start_monotonic_s"][()] == START
        maps, mean = entry["strain"], entry["mean"]
        units = {name: item.attrs["units"] for name, item in (*maps.items(), *mean.items())}
        known = {
            "u": "px", "sigma_v": "px", "eyy": "", "sigma_exy": "", "blur": "px", "status": "", "x": "px", "size": "px",
            "time_s": "s", "force_N": "N", "noise_GL": "GL", "u_px": "px", "duration_s": "s", "gauge_a": "",
            "sigma_blur_px": "px",
        }  # fmt: skip
        for name, unit in known.items():
            assert units[name] == unit, name
        assert maps["u"].attrs["long_name"] == "displacement along x (right) (px)"
        assert (
            maps["sigma_v"].attrs["long_name"] == "standard uncertainty of displacement along y (down) (px)"
        )
        assert maps["exy"].attrs["long_name"] == "strain xy (tensor component, gamma/2)"
        assert (maps["size"][()], maps["step"][()]) == (32, 16)
        assert maps["eyy"].fillvalue != maps["eyy"].fillvalue and maps["status"].fillvalue == 255
        assert maps["eyy"].chunks == (1, 5, 7) and mean["eyy"].attrs["uncertainties"] == "sigma_eyy"
        gauges = entry["gauges"]
        assert (
            gauges.attrs["signal"] == "a" and json.loads(mean["gauge_a"].attrs["gauge"]) == INFO.gauges["a"]
        )
        np.testing.assert_allclose(gauges["a"], [0, 2e-3, 4e-3, 6e-3])
        assert (
            gauges["a_errors"] == gauges["sigma_a"] == mean["sigma_gauge_a"]
            and gauges["time_s"] == mean["time_s"]
        )
        assert list(mean["share_gauge_a"]) == [0.5] * 4
        camera = entry["camera"]
        assert camera["description"][()] == b"made up"
        assert [camera.attrs[key] for key in ("width", "height", "bits", "fps", "clock")] == [
            128,
            96,
            12,
            10.0,
            "nominal",
        ]
        assert "exposure_s" not in camera.attrs
        assert json.loads(entry["config"][()]) == {"measure": {"zoi": 32}}
        assert maps.attrs["signal"] == mean.attrs["signal"] == "eyy" and list(mean.attrs["axes"]) == [
            "time_s"
        ]
        assert (
            list(maps.attrs["auxiliary_signals"]) == list(mean.attrs["auxiliary_signals"]) == ["exx", "exy"]
        )


def test_maps_by_row_and_by_slice(strain: Strain) -> None:
    whole = strain.maps("eyy")
    np.testing.assert_array_equal(strain.maps("eyy", -1), whole[3])
    np.testing.assert_array_equal(strain.maps("eyy", 2), whole[2])
    np.testing.assert_array_equal(strain.maps("eyy", slice(0, 4, 2)), whole[::2])
    np.testing.assert_array_equal(strain.maps("eyy", slice(-2, None)), whole[2:])
    for row in (4, -5):
        with pytest.raises(DataError, match=rf"no row {row}; give 0 to 3, or -1 \(the last\) to -4"):
            strain.maps("eyy", row)
    assert repr(strain) == "<Strain strain.h5: 4 instants of 5 x 7 ZOIs, small strain>"
    strain.close()
    strain.close()


def test_a_tare_in_mid_test_is_undone(strain: Strain) -> None:
    strain.values["force_N"], strain.values["zero_N"] = np.array([1.0, 2.0, 3.0]), np.array([5.0, 5.0, 9.0])
    np.testing.assert_allclose(strain.force_one_zero, [1, 2, 7])
    del strain.values["zero_N"]
    np.testing.assert_allclose(strain.force_one_zero, [1, 2, 3])


def test_as_a_dataset_of_xarray(strain: Strain, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", SimpleNamespace(Dataset=lambda *given: given))
    shown = Display(mm_per_px=0.05, y_up=True, percent=True)
    data, coordinates, about = strain.to_xarray("eyy", "v", display=shown)
    axes, eyy, words = data["eyy"]
    assert axes == ("time", "y", "x") and words == {"units": "%", "long_name": "normal strain along y"}
    np.testing.assert_allclose(eyy, 100 * strain.maps("eyy"), rtol=1e-6)
    np.testing.assert_allclose(data["v"][1], -0.05 * strain.maps("v"), rtol=1e-6)
    assert data["mean_eyy"][0] == "time" and "exx" not in data and "time" not in data
    np.testing.assert_allclose(data["mean_eyy"][1], 100 * strain.values["eyy"])
    np.testing.assert_allclose(data["force"][1], [0, 10, 20, 30])
    np.testing.assert_allclose(coordinates["y"][1], -0.05 * strain.grid.y)
    np.testing.assert_allclose(coordinates["x"][1], 0.05 * strain.grid.x)
    assert coordinates["time"][2] == {"units": "s"} and coordinates["x"][2]["units"] == "mm"
    assert about["strain_measure"] == "small" and "y up" in about["axes"]
    assert set(strain.to_xarray()[0]) >= set(strain.names)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ConfigError, match="pip install 'phasedic"):
        strain.to_xarray()


def test_times_that_run_backwards_are_told_and_used(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with Results(tmp_path, make_grid(), replace(INFO, gauges={})) as results:
        for k in (0, 3, 2):
            results.add(make_measurement(k))
    with caplog.at_level(logging.WARNING), Strain.open(tmp_path / "strain.h5") as strain:
        assert strain.time_s.tolist() == pytest.approx([0.0, 0.3, 0.2])
    assert [record.getMessage().partition(": ")[2] for record in caplog.records] == [
        "1 times run backwards; they are used as they are"
    ]


def test_files_that_contradict_themselves_are_refused(written: Path, tmp_path: Path) -> None:
    changes: list[tuple[Any, str]] = [
        (lambda e: e["strain/x"].__setitem__(0, 3.0), "has other centres x than its description"),
        (lambda e: e["strain/y"].__setitem__(1, 3.0), "has other centres y than its description"),
        (lambda e: e["mean/exx"].resize((3,)), "not of one length"),
        (lambda e: e["strain"].attrs.__setitem__("grid", json.dumps(
            {**json.loads(e["strain"].attrs["grid"]), "step": 17})), "ZOIs, but"),
        (lambda e: e.file.attrs.__setitem__("format", "another"), "holds 'another'"),
    ]  # fmt: skip
    for k, (change, words) in enumerate(changes):
        path = tmp_path / f"{k}.h5"
        path.write_bytes(written.read_bytes())
        with h5py.File(path, "r+") as file:
            change(file["entry"])
        with pytest.raises(DataError, match=words):
            Strain.open(path)


def test_the_child_reads_a_file_once(
    written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert probed(str(written)) == 0 and not capsys.readouterr().out.strip("\0\n")
    (tmp_path / "a.h5").write_text("text")
    assert probed(str(tmp_path / "a.h5")) == 4
    assert "is not an HDF5 file" in capsys.readouterr().out
    Results(tmp_path, make_grid(), INFO).close()
    assert probed(str(tmp_path / "strain.h5")) == 0, "no row"


# -- rows -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("measure", "strain", "stretch"), [
    ("engineering", 0.1, 1.1), ("small", 0.1, 1.1), ("green", (1.1**2 - 1) / 2, 1.1), ("hencky", math.log(1.1), 1.1),
])  # fmt: skip
def test_true_strain_is_that_of_the_stretch(measure: Any, strain: float, stretch: float) -> None:
    """Of the ends of the region, where they are known; else of its strain, whatever its measure."""
    info = replace(INFO, area_m2=2e-5, strain_measure=measure)
    m = make_measurement(0, force=100.0)
    m = replace(m, field=replace(m.field, measure=measure))
    step = replace(m.time_step, eyy=strain, extension_y=math.nan)
    values = StrainRow.of(replace(m, time_step=step), info).values
    assert values["stress_Pa"] == pytest.approx(5e6)
    assert values["true_strain"] == pytest.approx(math.log(stretch))
    assert values["true_stress_Pa"] == pytest.approx(5e6 * stretch)
    ends = replace(step, extension_y=0.2, gauges={})
    assert StrainRow.of(replace(m, time_step=ends), info).values["true_strain"] == pytest.approx(
        math.log(1.2)
    )
    own = replace(ends, gauges={"axial": GaugeValue(0.3, 1e-6)})
    assert StrainRow.of(replace(m, time_step=own), info).values["true_strain"] == pytest.approx(math.log(1.3))
    along = replace(ends, extension_x=0.4)
    assert StrainRow.of(replace(m, time_step=along), info, "x").values["true_strain"] == pytest.approx(
        math.log(1.4)
    )
    gone = replace(step, extension_y=-1.0)
    assert math.isnan(StrainRow.of(replace(m, time_step=gone), info).values["true_strain"])


def test_the_columns_that_only_some_tests_have() -> None:
    assert INFO.extras == ()
    assert replace(INFO, area_m2=1e-5, lagged=True).extras == (
        "stress_Pa",
        "true_strain",
        "true_stress_Pa",
        "force_raw_N",
    )
    extras = replace(INFO, plates=True, lens=True).extras
    assert extras[:5] == ("lens_exx", "lens_eyy", "sigma_lens_exx", "sigma_lens_eyy", "raw_exx")
    m = gauged(1, force_raw=55.0, zero=3.0, area_share=0.25, u=1.5, v=-2.5, blur=0.1, sigma_blur=0.2)
    values = StrainRow.of(
        replace(m, lens=(1.0, 2.0, 3.0, 4.0)), replace(INFO, lagged=True, lens=True, plates=True)
    ).values
    names = ("force_raw_N", "zero_N", "area_share", "u_px", "v_px", "blur_px", "sigma_blur_px", "lens_exx")
    found = {name: values[name] for name in (*names, "sigma_lens_eyy", "time_s", "force_N")}
    assert list(found.values()) == [55.0, 3.0, 0.25, 1.5, -2.5, 0.1, 0.2, 1.0, 4.0, pytest.approx(0.1), 10.0]
    assert math.isnan(values["corrected"]) and math.isnan(values["plate_scale"]), "no plate was seen"
    assert [values[name] for name in gauge_columns("a")] == [2e-3, 1e-6, 0.5]
    assert math.isnan(StrainRow.of(m, replace(INFO, lens=True)).values["lens_exx"])


def test_a_table_that_cannot_be_made_says_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be written"):
        CsvWriter(tmp_path / "no" / "strain.csv")
    (tmp_path / "file").touch()
    with pytest.raises(DataError, match="file/run: cannot be made"):
        Results(tmp_path / "file" / "run", make_grid(), INFO)
    writer = CsvWriter(tmp_path / "a.csv", gauges=["a"])
    row = StrainRow.of(gauged(3), INFO)
    writer.write(row)
    writer.close()
    heads, values = (line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines())
    assert heads[-3:] == ["gauge_a", "sigma_gauge_a", "share_gauge_a"] and values[-3:] == [
        "0.006",
        "1e-06",
        "0.5",
    ]
    assert (values[0], values[1], values[2]) == ("24", "0.3", "30")


# -- fields ---------------------------------------------------------------------------------------


def test_normal_matrices_are_stored_as_upper_triangles() -> None:
    grid = make_grid()

    class Pattern:
        def information(self, at: np.ndarray) -> np.ndarray:
            i, j = np.mgrid[:6, :6]
            return (10.0 * i + j)[..., None] + 100.0 * at

    stored = normal_matrices(Pattern(), grid)  # type: ignore[arg-type]
    assert stored.shape == (21, 5, 7) and not stored[:, 0, 0].any()
    for k, (i, j) in enumerate(zip(*np.triu_indices(6), strict=True)):
        assert stored[k, 2, 3] == 10 * i + j + 100 * (2 * 7 + 3)


RECORDED = Path(__file__).with_name("recorded")


def test_results_of_the_first_version_open() -> None:
    with (RECORDED / "strain.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with Strain.open(RECORDED / "strain.h5") as strain:
        assert strain.versions["phasedic"] == "0.1.0"
        assert strain.n == len(rows) == 8
        for name in ("force_N", "exx", "eyy", "exy", "sigma_eyy", "noise_GL"):
            assert strain.values[name] == pytest.approx([float(row[name]) for row in rows], rel=1e-8)
        maps = strain.maps("eyy")
        assert maps.shape == (8, 4, 6)
        assert np.nanmean(maps, axis=(1, 2)) == pytest.approx(strain.values["eyy"], abs=1e-9)
