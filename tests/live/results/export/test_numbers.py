"""csv, npz, mat, vtk, tiff, r3xa: what comes out is what was measured, in the units that were asked for."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from scipy.io import loadmat

from live.cli import main
from live.results.export.tables import load_table
from live.results.quantities import Display
from live.results.run_folder import RunFolder, open_run
from tests.live.made_run import THICKNESS_MM, WIDTH_MM
from tests.live.results.export import vti

SCALE = 0.05


def exported(run_dir: Path, out: Path, *arguments: str) -> Path:
    assert main(["export", str(run_dir), "--out", str(out), *arguments]) == 0
    return out


def table(path: Path) -> tuple[list[str], dict[str, np.ndarray]]:
    """The lines of comment, and the columns by their names."""
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    rows = list(csv.DictReader(lines[len(comments) :]))
    return comments, {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_long_table(run_dir: Path, tmp_path: Path) -> None:
    units = ("--mm", "--scale", str(SCALE), "--y-up", "--percent")
    comments, columns = table(exported(run_dir, tmp_path / "t.csv", "--to", "csv", *units))
    with open_run(run_dir) as run:
        active = run.strain.grid.active
        eyy, v = (run.strain.maps(name)[:, active].ravel() for name in ("eyy", "v"))
        rows, places = np.nonzero(active)
        x, y = run.strain.grid.x[places], run.strain.grid.y[rows]
        force = run.force
    n = int(active.sum())
    np.testing.assert_allclose(columns["eyy_percent"], 100 * eyy, rtol=1e-6)
    np.testing.assert_allclose(columns["v_mm"], -SCALE * v, rtol=1e-6, equal_nan=True)
    np.testing.assert_allclose(columns["y_mm"][:n], -SCALE * y)
    np.testing.assert_allclose(columns["x_mm"][:n], SCALE * x)
    np.testing.assert_array_equal([columns["row"][:n], columns["column"][:n]], [rows, places])
    np.testing.assert_allclose(columns["force_N"], np.repeat(force, n))
    assert set(columns["status"]) == {0, 7}
    for name in columns:
        assert any(line.startswith(f"# {name} [") for line in comments), f"{name} has no definition"
    assert any("y up" in line and "1 px = 0.05 mm" in line for line in comments)


def test_wide_tables(run_dir: Path, tmp_path: Path) -> None:
    out = exported(run_dir, tmp_path / "w", "--to", "csv", "--layout", "wide", "--fields", "eyy,u")
    assert sorted(path.name for path in out.iterdir()) == ["eyy.csv", "u_px.csv"]
    _, columns = table(out / "eyy.csv")
    with open_run(run_dir) as run:
        grid, eyy = run.strain.grid, run.strain.maps("eyy")
    r, c = 2, 3
    np.testing.assert_allclose(columns[f"x{grid.x[c]:.6g}_y{grid.y[r]:.6g}"], eyy[:, r, c], rtol=1e-6)
    assert len(columns) == 2 + grid.n_active


def test_means_and_ranges_of_time(run_dir: Path, tmp_path: Path) -> None:
    more = ("--layout", "means", "--from", "0.3", "--until", "0.75", "--percent")
    _, columns = table(exported(run_dir, tmp_path / "m.csv", "--to", "csv", *more))
    with open_run(run_dir) as run:
        np.testing.assert_allclose(columns["eyy_percent"], 100 * run.strain.values["eyy"][3:8], rtol=1e-9)
    np.testing.assert_allclose(columns["time_s"], [0.3, 0.4, 0.5, 0.6, 0.7])


def test_npz(run_dir: Path, tmp_path: Path) -> None:
    out = exported(run_dir, tmp_path / "a.npz", "--to", "npz", "--fields", "all", "--percent")
    with np.load(out, allow_pickle=False) as held, open_run(run_dir) as run:
        for name in run.strain.names:
            assert held[name].shape == (12, *run.strain.grid.shape)
        np.testing.assert_allclose(held["exy"], 100 * run.strain.maps("exy"), rtol=1e-6)
        np.testing.assert_array_equal(held["status"], run.strain.maps("status"))
        np.testing.assert_array_equal(held["time"], run.strain.time_s)
        np.testing.assert_allclose(held["mean_eyy"], 100 * run.strain.values["eyy"])
        about = json.loads(str(held["about"]))
    assert about["units"]["exy"] == "%"
    assert set(about["definitions"]) >= {*run.strain.names, "x", "y", "force"}


def test_mat(run_dir: Path, tmp_path: Path) -> None:
    out = exported(run_dir, tmp_path / "a.mat", "--to", "mat", "--mm", "--scale", str(SCALE))
    held = loadmat(out, simplify_cells=True)
    with open_run(run_dir) as run:
        np.testing.assert_array_equal(held["eyy"], np.moveaxis(run.strain.maps("eyy"), 0, -1))
        np.testing.assert_allclose(held["u"][..., 5], SCALE * run.strain.maps("u", 5), rtol=1e-6)
        np.testing.assert_allclose(held["x"], SCALE * run.strain.grid.x)
        np.testing.assert_allclose(held["mean"]["force"], run.force)
    assert held["about"]["units"]["u"] == "mm"
    assert "displacement along x" in held["about"]["definitions"]["u"]


def test_vtk(run_dir: Path, tmp_path: Path) -> None:
    units = ("--mm", "--scale", str(SCALE), "--y-up")
    out = exported(run_dir, tmp_path / "vtk", "--to", "vtk", *units)
    collection = ElementTree.parse(out / "strain.pvd").getroot().findall("Collection/DataSet")
    with open_run(run_dir) as run:
        strain = run.strain
        assert [float(one.attrib["timestep"]) for one in collection] == pytest.approx(list(strain.time_s))
        grid = strain.grid
        for number in (0, 11):
            image = vti.read(out / collection[number].attrib["file"])
            shape = (image.extent[3] + 1, image.extent[1] + 1)
            assert shape == grid.shape
            # Points run along x first, then y upwards: with y up the last row of ZOIs is the first.
            eyy = image.points["eyy"].reshape(shape)
            np.testing.assert_array_equal(eyy[::-1], strain.maps("eyy", number))
            v = image.points["displacement_mm"].reshape(*shape, 3)[::-1, :, 1]
            np.testing.assert_allclose(v, -SCALE * strain.maps("v", number), rtol=1e-6)
            assert image.facts["TimeValue"][0] == strain.time_s[number]
            assert image.facts["force_N"][0] == run.force[number]
        assert image.origin == pytest.approx([SCALE * grid.x[0], -SCALE * grid.y[-1], 0])
        assert image.spacing[:2] == pytest.approx([SCALE * grid.step] * 2)


def test_vtk_by_its_own_reader(run_dir: Path, tmp_path: Path) -> None:
    """Where vtk is installed (140 MB; not asked for by the tests)."""
    vtk = pytest.importorskip("vtk")
    out = exported(run_dir, tmp_path / "vtk", "--to", "vtk")
    reader = vtk.vtkXMLImageDataReader()
    reader.SetFileName(str(out / "strain_00003.vti"))
    reader.Update()
    assert reader.GetErrorCode() == 0
    points = reader.GetOutput().GetPointData()
    with open_run(run_dir) as run:
        expected = run.strain.maps("exx", 3).ravel()
    array = points.GetArray("exx")
    np.testing.assert_array_equal([array.GetValue(i) for i in range(array.GetNumberOfValues())], expected)


def test_tiff(run_dir: Path, tmp_path: Path) -> None:
    out = exported(run_dir, tmp_path / "e.tif", "--to", "tiff", "--fields", "eyy", "--percent")
    well, pages = cv2.imreadmulti(str(out), flags=cv2.IMREAD_UNCHANGED)
    assert well
    with open_run(run_dir) as run:
        assert pages[0].dtype == np.float32
        np.testing.assert_allclose(np.stack(pages), 100 * run.strain.maps("eyy"), rtol=1e-6)


def test_tiff_says_its_units_to_imagej(run_dir: Path, tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    units = ("--mm", "--scale", str(SCALE))
    one = exported(run_dir, tmp_path / "one.tif", "--to", "tiff", "--from", "0.45", "--until", "0.55")
    assert len(cv2.imreadmulti(str(one), flags=cv2.IMREAD_UNCHANGED)[1]) == 1
    out = exported(run_dir, tmp_path / "e.tif", "--to", "tiff", "--fields", "v", *units)
    with pillow.open(out) as image:
        tags = image.tag_v2
        assert image.n_frames == 12
        described = dict(line.split("=", 1) for line in tags[270].rstrip("\0\n").splitlines())
        assert described["unit"] == "mm"
        assert described["vunit"] == "mm"
        assert (described["frames"], float(described["finterval"])) == ("12", pytest.approx(0.1))
        # Pixels of the map, which are ZOIs 16 px apart, per mm.
        assert float(tags[282]) == pytest.approx(1 / (16 * SCALE))
        # Of the first ZOI from the corner of the picture, in pixels of the map: its centre is at 15.5 px.
        assert [float(described[name]) for name in ("xorigin", "yorigin")] == [pytest.approx(-15.5 / 16)] * 2
        counts, labels = tags[50838], tags[50839]
        assert len(counts) == 1 + 12
        assert labels[counts[0] : counts[0] + counts[1]].decode("utf-16-le") == "0.0000 s, 0.00 N"


def test_r3xa(run_dir: Path, tmp_path: Path) -> None:
    out = exported(run_dir, tmp_path / "r3xa", "--to", "r3xa")
    described = json.loads((out / "r3xa.json").read_text(encoding="utf-8"))
    assert described["authors"] == [{"name": "Zoé"}]
    assert described["date"] == "2030-01-02"
    ids = [item["id"] for part in ("settings", "data_sources", "data_sets") for item in described[part]]
    assert len(ids) == len(set(ids))
    sizes = next(item["sizes"] for item in described["settings"] if item["id"] == "stg-specimen")
    assert [(one["title"], one["unit"], one["value"]) for one in sizes] == [
        ("width", "mm", WIDTH_MM),
        ("thickness", "mm", THICKNESS_MM),
    ]
    for item in described["data_sets"]:
        place = out / item["path"]
        assert place.exists(), item
        assert set(item["parent_data_sources"]) <= set(ids)
        if item["kind"] == "data_sets/list":
            assert len(item["values"]) == len(item["timestamps"]) == 12
            assert all((place / name).is_file() for name in item["values"])
        elif item["kind"] == "data_sets/file":
            for part in (item["timestamps"], item["values"]):
                comments, columns = table(place / part["filename"])
                assert not comments
                assert part["col"] in columns
    assert {item["id"] for item in described["data_sets"]} == {
        "set-images", "set-results", "set-load", "set-means", "set-fields",
    }  # fmt: skip


def test_r3xa_by_its_own_schema(run_dir: Path, tmp_path: Path) -> None:
    """Where the validator of R3XA is installed (it is under the GPL, and not asked for by the tests)."""
    validate = pytest.importorskip("r3xa_api.validate")
    out = exported(run_dir, tmp_path / "r3xa", "--to", "r3xa")
    validate.validate(json.loads((out / "r3xa.json").read_text(encoding="utf-8")))


def test_xarray(run_dir: Path) -> None:
    pytest.importorskip("xarray")
    with open_run(run_dir) as run:
        data = run.strain.to_xarray(display=Display(y_up=True, percent=True))
        np.testing.assert_allclose(
            data["eyy"].sel(time=0.5, method="nearest"), 100 * run.strain.maps("eyy", 5)
        )
        assert data["eyy"].attrs["units"] == "%"
        assert data["eyy"].dims == ("time", "y", "x")
        np.testing.assert_array_equal(data["y"], -run.strain.grid.y)
        np.testing.assert_array_equal(data["force"], run.force)
        np.testing.assert_allclose(data["mean_eyy"], 100 * run.strain.values["eyy"])


def test_a_table_of_loads_counts_from_the_start_of_the_test() -> None:
    recorded: Any = SimpleNamespace(
        session=SimpleNamespace(
            load_curves=lambda: iter([(np.array([100.5, 101.25]), np.array([12.5, math.nan]))]),
            start_monotonic=100.0,
        ),
        _recorded=contextlib.nullcontext,
    )
    run: Any = SimpleNamespace(readings=RunFolder.readings.func(recorded))
    file = io.StringIO()
    load_table(run, file)
    heads, *rows = csv.reader(io.StringIO(file.getvalue()))
    assert heads == ["time_s", "force_N"]
    (half, known), (later, unknown) = ([float(cell) for cell in row] for row in rows)
    assert (half, known, later) == (0.5, 12.5, 1.25) and math.isnan(unknown)
