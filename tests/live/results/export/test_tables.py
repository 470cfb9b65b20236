"""Exported tables and pictures by value: heads, names, units and rates."""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
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

from acquire.errors import ConfigError, DataError
from analysis.field import Status
from live.cli import main
from live.pipeline.consumer import Screen
from live.results.export import maps
from live.results.export.formats import ExportRequest, export
from live.results.export.job import ExportJob, ExportOptions, chosen_fields
from live.results.export.tables import load_table
from live.results.quantities import Display, mean_name, quantity_of
from live.results.run_folder import RunFolder, open_run
from tests.live.made_run import CONFIG, GAUGES, force_of, make_run
from tests.live.results.export import vti

SHOWN = Display(mm_per_px=0.05, y_up=True, percent=True)


def exported(run: RunFolder, path: Path, kind: str, display: Display = SHOWN, **more: Any) -> Path:
    options = {key: more.pop(key) for key in ("layout", "fps", "limit", "picture") if key in more}
    request = ExportRequest(kind, path, display=display, options=ExportOptions(**options), **more)
    return export(run, request, Screen())


def test_a_table_says_what_its_columns_are(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path / "run", [0.0, 1e-3], config={**CONFIG, "gauges": GAUGES})) as run:
        out = exported(run, tmp_path / "m.csv", "csv", layout="means")
        comments, columns = table(out)
        np.testing.assert_allclose(columns["eyy_percent"], 100 * run.strain.values["eyy"], rtol=1e-9)
    words = {line.split(":")[0].removeprefix("# "): line for line in comments}
    assert list(columns)[:6] == [
        "time_s",
        "force_N",
        "stress_Pa",
        "exx_percent",
        "eyy_percent",
        "exy_percent",
    ]
    assert list(columns).index("sigma_exx_percent") == 6 and len(set(columns)) == len(columns)
    assert words["eyy_percent [%]"].endswith("normal strain along y, mean over the valid ZOIs")
    assert words["v_mm [mm]"].endswith("since the reference, mean over the valid ZOIs")
    assert words["sigma_eyy_percent [%]"].endswith("of eyy, of that mean, with the overlap of ZOIs")
    assert "(kind line; " not in words["gauge_axial_percent [%]"]
    assert (
        "(kind line, start [64, 20], end [64, 76]; positions in px, y down)"
        in words["gauge_axial_percent [%]"]
    )
    assert words["n_valid [dimensionless]"].endswith("ZOIs with a value")
    assert comments[0].startswith("# S1: exported by phasedic from strain.h5, measured by phasedic 0.1.0")
    assert comments[1] == "# test started 2030-01-02T03:04:05+00:00; ZOIs of 32 px, 16 px apart"
    assert comments[2].startswith("# small strain: exx = du/dx") and not any(
        "# status: " in one for one in comments
    )


def test_wide_tables_name_the_centres_of_zois(run: RunFolder, tmp_path: Path) -> None:
    out = exported(run, tmp_path / "w", "csv", layout="wide", fields="v,exx", start_s=0.5, end_s=0.6)
    assert sorted(path.name for path in out.iterdir()) == ["exx_percent.csv", "v_mm.csv"]
    comments, columns = table(out / "v_mm.csv")
    r, c = 3, 2
    x, y = 0.05 * run.strain.grid.x[c], -0.05 * run.strain.grid.y[r]
    np.testing.assert_allclose(
        columns[f"x{x:.6g}_y{y:.6g}"], -0.05 * run.strain.maps("v")[5:7, r, c], rtol=1e-6
    )
    np.testing.assert_allclose(columns["time_s"], [0.5, 0.6])
    np.testing.assert_allclose(columns["force_N"], run.force[5:7])
    assert "# one column a ZOI, named by its centre in mm" in comments
    assert len(columns) == 2 + run.strain.grid.n_active


def test_arrays_name_means_and_maps_apart(run: RunFolder, tmp_path: Path) -> None:
    held = loadmat(exported(run, tmp_path / "a.mat", "mat", fields="eyy,v"), simplify_cells=True)
    np.testing.assert_allclose(held["y"], -0.05 * run.strain.grid.y)
    np.testing.assert_array_equal(held["active"], run.strain.grid.active)
    np.testing.assert_allclose(held["v"][..., 7], -0.05 * run.strain.maps("v", 7), rtol=1e-6)
    np.testing.assert_allclose(held["mean"]["mean_v"], -0.05 * run.strain.values["v_px"])
    np.testing.assert_allclose(held["mean"]["mean_sigma_blur"],
                               0.05 * run.strain.values["sigma_blur_px"])  # fmt: skip
    units, words = held["about"]["units"], held["about"]["definitions"]
    assert (units["x"], units["eyy"], units["mean_eyy"], units["force"], units["n_valid"]) == (
        "mm",
        "%",
        "%",
        "N",
        "1",
    )
    assert words["mean_eyy"] == words["eyy"] == "normal strain along y"
    out = exported(run, tmp_path / "a.npz", "npz", fields="eyy", start_s=0.25, end_s=0.45)
    with np.load(out) as archive:
        np.testing.assert_allclose(archive["eyy"], 100 * run.strain.maps("eyy")[3:5], rtol=1e-6)
        np.testing.assert_allclose(archive["mean_exx"], 100 * run.strain.values["exx"][3:5])
        np.testing.assert_allclose(archive["x"], 0.05 * run.strain.grid.x)
        np.testing.assert_array_equal(archive["time"], run.strain.time_s[3:5])
        about = json.loads(str(archive["about"]))
    assert about["units"]["mean_u"] == "mm" and any("y up" in note for note in about["notes"])
    with np.load(exported(run, tmp_path / "all.npz", "npz", fields="all"), allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["status"], run.strain.maps("status"))
        assert {archive[name].shape for name in run.strain.names} == {(12, *run.strain.grid.shape)}
        about = json.loads(str(archive["about"]))
    assert set(about["definitions"]) >= {*run.strain.names, "x", "y", "force"}


@pytest.mark.parametrize(
    ("name", "shown"),
    [("exx", "mean_exx"), ("sigma_exx", "mean_sigma_exx"), ("u_px", "mean_u"), ("blur_px", "mean_blur"),
     ("extension_x", "extension_x"), ("sigma_extension_x", "sigma_extension_x"), ("uneven_exx", "uneven_exx"),
     ("gauge_axial", "gauge_axial"), ("sigma_gauge_axial", "sigma_gauge_axial"), ("force_N", "force"),
     ("n_valid", "n_valid"), ("true_strain", "mean_true_strain")],
)  # fmt: skip
def test_a_column_beside_maps_has_a_name_of_its_own(name: str, shown: str) -> None:
    assert mean_name(name) == shown


def test_definitions_of_numbers_that_are_made_of_others() -> None:
    assert quantity_of("sigma_u").unit == "px" and quantity_of("sigma_u").words.endswith("(1 sigma) of u")
    assert quantity_of("sigma_blur_px").name == "sigma_blur"
    gauge, share = quantity_of("sigma_gauge_a"), quantity_of("share_gauge_a")
    assert gauge.words == "standard uncertainty (1 sigma) of gauge_a" and gauge.is_strain
    assert share.words == "share of its area that gauge_a stands for, at either end" and not share.is_strain
    assert quantity_of("gauge_a").words == "strain of the virtual gauge 'a'; nan where it was lost"
    assert quantity_of("nothing").words == quantity_of("sigma_nothing").words == "see docs/strain-format.md"
    assert (
        Display(percent=True).factor("share_gauge_a") == 1.0
        and Display(percent=True).factor("residual") == 1.0
    )


def test_the_frame_of_reference_in_words() -> None:
    assert Display().axes().startswith("x right, y down, from the centre of the first pixel")
    assert (
        Display(y_up=True).axes().startswith("x right, y up (y = 0 in the first row, negative below), from")
    )
    assert SHOWN.axes().endswith("; 1 px = 0.05 mm") and "1 px" not in Display().axes()


def test_points_of_vtk_upwards_or_downwards(run: RunFolder, tmp_path: Path) -> None:
    grid = run.strain.grid
    for display, unit, px in ((Display(percent=True), "px", 1.0), (SHOWN, "mm", 0.05)):
        out = exported(run, tmp_path / unit, "vtk", display, fields="exx", start_s=0.5, end_s=0.65)
        collection = ElementTree.parse(out / "strain.pvd").getroot().findall("Collection/DataSet")
        assert [float(one.attrib["timestep"]) for one in collection] == pytest.approx([0.5, 0.6])
        image = vti.read(out / collection[0].attrib["file"])
        assert list(image.points) == ["exx_percent", f"displacement_{unit}"]
        u, v, w = image.points[f"displacement_{unit}"].reshape(*grid.shape, 3).transpose(2, 0, 1)
        up = -1 if display.y_up else 1  # with y up the last row of ZOIs is the first
        np.testing.assert_allclose(u[::up], px * run.strain.maps("u", 5), rtol=1e-6)
        np.testing.assert_allclose(v[::up], up * px * run.strain.maps("v", 5), rtol=1e-6)
        assert not w[np.isfinite(u)].any()
        np.testing.assert_allclose(
            image.points["exx_percent"].reshape(grid.shape)[::up], 100 * run.strain.maps("exx", 5), rtol=1e-6
        )
        assert image.facts["TimeValue"][0] == run.strain.time_s[5]
        assert image.facts["force_N"][0] == run.force[5]
        assert image.origin == pytest.approx([px * grid.x[0], px * (-grid.y[-1] if up < 0 else grid.y[0]), 0])
        assert image.spacing[:2] == pytest.approx([16 * px] * 2)


def test_slices_of_tiff_are_labelled(run: RunFolder, tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile")
    out = exported(run, tmp_path / "e.tif", "tiff", fields="exx", start_s=0.2, end_s=0.4)
    run.strain.values["force_N"][3] = math.nan
    gap = exported(run, tmp_path / "g.tif", "tiff", Display(), start_s=0.2, end_s=0.4)
    single = exported(run, tmp_path / "s.tif", "tiff", fields="status", start_s=0.45, end_s=0.55)
    np.testing.assert_array_equal(tifffile.imread(single), run.strain.maps("status", 5))
    with tifffile.TiffFile(out) as file, tifffile.TiffFile(gap) as other:
        meta, plain = file.imagej_metadata, other.imagej_metadata
        tags = file.pages[0].tags
        assert tags[282].value[0] / tags[282].value[1] == pytest.approx(1 / 0.8, rel=1e-6)
        assert tags[283].value[0] / tags[283].value[1] == pytest.approx(1 / 0.8, rel=1e-6)
        np.testing.assert_allclose(file.asarray(), 100 * run.strain.maps("exx")[2:5], rtol=1e-6)
        np.testing.assert_allclose(other.asarray(), run.strain.maps("eyy")[2:5], rtol=1e-6)
    assert (meta["unit"], meta["vunit"], plain["unit"], plain["vunit"]) == ("mm", "%", "pixel", 1)
    assert meta["Labels"] == [f"{0.1 * k:.4f} s, {force_of(1e-4 * k):.2f} N" for k in (2, 3, 4)]
    assert plain["Labels"][1] == "0.3000 s"
    assert meta["finterval"] == pytest.approx(0.1) and not meta["loop"]
    assert meta["xorigin"] == pytest.approx(-15.5 / 16) and meta["yorigin"] == pytest.approx(15.5 / 16)
    assert meta["note4"].startswith("exx_percent [%]: normal strain along x")


def test_a_tiff_of_more_than_four_gigabytes_is_refused(
    run: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("tifffile")
    rows, columns = run.strain.grid.shape
    size = 12 * (4 * rows * columns + 256)
    monkeypatch.setattr(maps, "_MAX_BYTES", size - 1)
    with pytest.raises(ConfigError, match=f"12 maps of {columns} x {rows} are more than 4 GB"):
        exported(run, tmp_path / "e.tif", "tiff")
    monkeypatch.setattr(maps, "_MAX_BYTES", size)
    exported(run, tmp_path / "e.tif", "tiff")


@pytest.mark.parametrize("fps", [5.0, 20.0])
def test_films_run_at_their_rate(run: RunFolder, tmp_path: Path, fps: float) -> None:
    film = cv2.VideoCapture(str(exported(run, tmp_path / "f.mp4", "mp4", fps=fps, start_s=1.0)))
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(fps)
    pillow = pytest.importorskip("PIL.Image")
    with pillow.open(exported(run, tmp_path / "f.gif", "gif", fps=fps, start_s=1.0)) as gif:
        assert gif.info["duration"] == round(1000 / fps) and gif.info["loop"] == 0 and gif.n_frames == 2
        assert max(gif.size) <= 640 + 200


def framed(run: RunFolder, **options: Any) -> list[np.ndarray]:
    job = ExportJob(run, ("eyy",), (0, 11), Display(), Screen(), ExportOptions(**options))
    return [image for _, image in maps._frames(job)]


def test_pictures_lie_under_the_map_or_plain_grey(run: RunFolder) -> None:
    """All frames have the scale and the grey levels of the first; here the pictures become lighter."""
    over, plain, wide = framed(run), framed(run, picture=False), framed(run, limit=1.0)
    assert over[0].shape == over[1].shape == plain[0].shape
    inside = np.s_[150:300, 150:400]
    # The strain grows from nothing to the end of the scale, or to a thousandth of it.
    assert redness(over[1][inside]) > redness(over[0][inside]) + 40
    assert abs(redness(wide[1][inside]) - redness(wide[0][inside])) < 4
    assert plain[0][200, 200] == pytest.approx([134, 56, 90], abs=2)  # violet, 72 % over grey of level 150


def redness(image: np.ndarray) -> float:
    return float(np.mean(image[..., 2].astype(float) - image[..., 0]))


def table(path: Path) -> tuple[list[str], dict[str, np.ndarray]]:
    """The lines of comment, and the columns by their names."""
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    rows = list(csv.DictReader(lines[len(comments) :]))
    return comments, {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_long_table(run_dir: Path, tmp_path: Path) -> None:
    units, out = ("--mm", "--scale", "0.05", "--y-up", "--percent"), tmp_path / "t.csv"
    assert main(["export", str(run_dir), "--to", "csv", "--out", str(out), *units, "--until", "0.45"]) == 0
    comments, columns = table(out)
    with open_run(run_dir) as run:
        active = run.strain.grid.active
        eyy, v = (run.strain.maps(name)[:5, active].ravel() for name in ("eyy", "v"))
        rows, places = np.nonzero(active)
        x, y = run.strain.grid.x[places], run.strain.grid.y[rows]
        force, t = run.force[:5], run.strain.time_s[:5]
    n = int(active.sum())
    assert list(columns)[:7] == ["instant", "time_s", "force_N", "row", "column", "x_mm", "y_mm"]
    np.testing.assert_array_equal(columns["instant"], np.repeat(range(5), n))
    np.testing.assert_allclose(columns["time_s"], np.repeat(t, n))
    np.testing.assert_allclose(columns["eyy_percent"], 100 * eyy, rtol=1e-6)
    np.testing.assert_allclose(columns["v_mm"], -0.05 * v, rtol=1e-6, equal_nan=True)
    np.testing.assert_allclose(columns["y_mm"][:n], -0.05 * y)
    np.testing.assert_allclose(columns["x_mm"][:n], 0.05 * x)
    np.testing.assert_array_equal([columns["row"][:n], columns["column"][:n]], [rows, places])
    np.testing.assert_allclose(columns["force_N"], np.repeat(force, n))
    assert set(columns["status"]) == {0, 7}
    for name in columns:
        assert any(line.startswith(f"# {name} [") for line in comments), f"{name} has no definition"
    assert any("y up" in line and "1 px = 0.05 mm" in line for line in comments)
    assert f"# status: 0 OK, 1 {Status(1).name}" in "\n".join(comments)


def test_vtk_by_its_own_reader(run: RunFolder, tmp_path: Path) -> None:
    """Where vtk is installed (140 MB; not asked for by the tests)."""
    vtk = pytest.importorskip("vtk")
    out = exported(run, tmp_path / "vtk", "vtk", Display())
    reader = vtk.vtkXMLImageDataReader()
    reader.SetFileName(str(out / "strain_00003.vti"))
    reader.Update()
    assert reader.GetErrorCode() == 0
    points = reader.GetOutput().GetPointData()
    expected = run.strain.maps("exx", 3).ravel()
    array = points.GetArray("exx")
    np.testing.assert_array_equal([array.GetValue(i) for i in range(array.GetNumberOfValues())], expected)


def test_r3xa_by_its_own_schema(run: RunFolder, tmp_path: Path) -> None:
    """Where the validator of R3XA is installed (it is under the GPL, and not asked for by the tests)."""
    validate = pytest.importorskip("r3xa_api.validate")
    out = exported(run, tmp_path / "r3xa", "r3xa")
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


@pytest.mark.parametrize(
    ("start", "end", "rows"),
    [(None, None, range(12)), (0.3, 0.5, (3, 4, 5)), (0.3000001, 0.4999999, (3, 4, 5)), (0.31, None, range(4, 12)),
     (None, 0.19, (0, 1)), (0.3001, 0.4999, (4,))],
)  # fmt: skip
def test_instants_between_two_times(
    run: RunFolder, start: float | None, end: float | None, rows: Any
) -> None:
    assert run.strain.rows_between(start, end, "--from, --until") == tuple(rows)


def test_the_maps_that_are_chosen(run: RunFolder) -> None:
    strain = run.strain
    assert chosen_fields(strain, None) == (
        "u",
        "v",
        "exx",
        "eyy",
        "exy",
        "sigma_exx",
        "sigma_eyy",
        "sigma_exy",
        "status",
    )
    assert chosen_fields(strain, "all") == strain.names
    assert chosen_fields(strain, " eyy,u , eyy") == ("eyy", "u")
    assert chosen_fields(strain, None, ("ezz", "u")) == ("u",)


def test_where_an_export_goes(run: RunFolder, tmp_path: Path) -> None:
    run.path = tmp_path
    for kind, layout, name in (
        ("csv", "long", "strain.csv"), ("csv", "means", "means.csv"), ("csv", "wide", "wide"),
        ("npz", "long", "strain.npz"), ("tiff", "long", "eyy.tif"), ("vtk", "long", "vtk"),
    ):  # fmt: skip
        request = ExportRequest(kind, start_s=1.0, options=ExportOptions(layout=layout))
        assert export(run, request, Screen()) == tmp_path / "export" / name
        assert (tmp_path / "export" / name).exists()
    run.strain.names = ("residual",)
    with pytest.raises(ConfigError, match="holds none of the usual maps"):
        export(run, ExportRequest("csv", tmp_path / "x.csv"), Screen())


def test_shears_of_gauges_turn_with_the_axis(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0, 1e-3], config={**CONFIG, "gauges": GAUGES})) as run:
        values = run.strain.values
        job = ExportJob(run, ("eyy",), (1,), SHOWN, Screen())
        for name, sign in (
            ("gauge_shear", -100), ("gauge_axial", 100), ("sigma_gauge_shear", 100), ("exy", -100), ("eyy", 100),
            ("v_px", -0.05), ("sigma_exy", 100), ("time_s", 1), ("n_valid", 1),
        ):  # fmt: skip
            np.testing.assert_allclose(job.column(name), sign * values[name][1:], err_msg=name)


def test_a_file_that_cannot_be_written_leaves_nothing(
    run: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks = itertools.count()

    def full(*_: Any) -> None:
        if next(ticks) > 2:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("live.results.export.maps.image", lambda *_: full() or b"")  # type: ignore[func-returns-value]
    with pytest.raises(DataError, match="No space left on device"):
        export(run, ExportRequest("vtk", tmp_path / "vtk"), Screen())
    assert list(tmp_path.iterdir()) == []
