"""Exported tables and pictures by value: heads, names, units and rates."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.io import loadmat

from acquire.errors import ConfigError
from analysis.field import Status
from live.pipeline.consumer import Screen
from live.results.export import maps
from live.results.export.formats import ExportRequest, export
from live.results.export.job import ExportJob, ExportOptions
from live.results.quantities import Display, mean_name, quantity_of
from live.results.run_folder import RunFolder, open_run
from tests.live.made_run import CONFIG, GAUGES, force_of, make_run
from tests.live.results.export import vti
from tests.live.results.export.test_numbers import table

N = 12


SHOWN = Display(mm_per_px=0.05, y_up=True, percent=True)


def exported(run: RunFolder, path: Path, kind: str, display: Display = SHOWN, **more: Any) -> Path:
    options = {key: more.pop(key) for key in ("layout", "fps", "limit", "picture") if key in more}
    request = ExportRequest(kind, path, display=display, options=ExportOptions(**options), **more)
    return export(run, request, Screen())


def test_a_table_says_what_its_columns_are(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path / "run", [0.0, 1e-3], config={**CONFIG, "gauges": GAUGES})) as run:
        out = exported(run, tmp_path / "m.csv", "csv", layout="means")
        comments, columns = table(out)
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


def test_a_long_table_numbers_its_instants(run: RunFolder, tmp_path: Path) -> None:
    comments, columns = table(
        exported(run, tmp_path / "l.csv", "csv", fields="eyy, status,eyy", start_s=0.3, end_s=0.4)
    )
    n = run.strain.grid.n_active
    assert columns["instant"].tolist() == [3.0] * n + [4.0] * n
    np.testing.assert_allclose(columns["time_s"], [0.3] * n + [0.4] * n)
    assert list(columns) == [
        "instant", "time_s", "force_N", "row", "column", "x_mm", "y_mm", "eyy_percent", "status",
    ]  # fmt: skip
    assert f"# status: 0 OK, 1 {Status(1).name}" in "\n".join(comments)


def test_wide_tables_name_the_centres_of_zois(run: RunFolder, tmp_path: Path) -> None:
    out = exported(run, tmp_path / "w", "csv", layout="wide", fields="v", start_s=0.5, end_s=0.6)
    comments, columns = table(out / "v_mm.csv")
    r, c = 3, 2
    x, y = 0.05 * run.strain.grid.x[c], -0.05 * run.strain.grid.y[r]
    np.testing.assert_allclose(
        columns[f"x{x:.6g}_y{y:.6g}"], -0.05 * run.strain.maps("v")[5:7, r, c], rtol=1e-6
    )
    np.testing.assert_allclose(columns["time_s"], [0.5, 0.6])
    np.testing.assert_allclose(columns["force_N"], run.force[5:7])
    assert "# one column a ZOI, named by its centre in mm" in comments


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
        about = json.loads(str(archive["about"]))
    assert about["units"]["mean_u"] == "mm" and any("y up" in note for note in about["notes"])


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
    for up in (False, True):
        display = Display(y_up=up, percent=True)
        out = exported(run, tmp_path / str(up), "vtk", display, fields="exx", start_s=0.5, end_s=0.55)
        image = vti.read(out / "strain_00000.vti")
        assert list(image.points) == ["exx_percent", "displacement_px"]
        u, v, w = image.points["displacement_px"].reshape(*grid.shape, 3).transpose(2, 0, 1)
        flip = slice(None, None, -1 if up else 1)
        np.testing.assert_array_equal(u[flip], run.strain.maps("u", 5))
        np.testing.assert_array_equal(v[flip], (-1 if up else 1) * run.strain.maps("v", 5))
        assert not w[np.isfinite(u)].any()
        np.testing.assert_allclose(
            image.points["exx_percent"].reshape(grid.shape)[flip], 100 * run.strain.maps("exx", 5), rtol=1e-6
        )
        assert image.origin == pytest.approx([grid.x[0], -grid.y[-1] if up else grid.y[0], 0])
        assert image.spacing == pytest.approx([16, 16, 1])


def test_slices_of_tiff_are_labelled(run: RunFolder, tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile")
    out = exported(run, tmp_path / "e.tif", "tiff", fields="exx", start_s=0.2, end_s=0.4)
    run.strain.values["force_N"][3] = math.nan
    gap = exported(run, tmp_path / "g.tif", "tiff", Display(), start_s=0.2, end_s=0.4)
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
    size = N * (4 * rows * columns + 256)
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
        assert gif.info["duration"] == round(1000 / fps) and gif.info["loop"] == 0
        assert max(gif.size) <= 640 + 200


def framed(run: RunFolder, **options: Any) -> list[np.ndarray]:
    job = ExportJob(run, ("eyy",), (0, N - 1), Display(), Screen(), ExportOptions(**options))
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
