"""Units and axes of what is shown and exported, against an analytic rotation and stretch.

The example that reads a finished run does what it says.
"""

from __future__ import annotations

import re
import runpy
import tempfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis.field.strain_field import StrainField
from examples.batch import main as batch
from examples.finished_run import main
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main as phasedic
from live.results.quantities import Display, quantity_of
from live.results.run_folder import open_run
from tests.live.made_run import PULLED, make_run
from tests.live.made_up import make_grid

ANGLE, STRETCH, SHEAR = np.deg2rad(7.0), np.diag([1.01, 0.98]), np.array([[1.0, 0.03], [0.0, 1.0]])
TURNED = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])  # anticlockwise, y up
GRADIENT = TURNED @ STRETCH @ SHEAR - np.eye(2)


def field_in_the_picture(number: int, strain: float) -> StrainField:
    """The deformation, known with y up, as a camera sees it: rows count downwards."""
    grid = make_grid()
    x, y_up = np.meshgrid(grid.x, -grid.y)
    u, v_up = np.einsum("ij,jrc->irc", GRADIENT, np.stack([x, y_up]))
    (uu, uv), (vu, vv) = GRADIENT
    values = {"u": u, "v": -v_up, "du_dx": uu, "du_dy": -uv, "dv_dx": -vu, "dv_dy": vv}
    return StrainField.from_values(grid, values, 1e-5)


def test_y_up_gives_back_the_analytic_rotation(tmp_path: Path) -> None:
    display = Display(mm_per_px=0.02, y_up=True, percent=True)
    with open_run(make_run(tmp_path, [0.0], session=False, field_of=field_in_the_picture)) as run:
        shown = {name: display.shown(name, run.strain.maps(name, 0)) for name in run.strain.names}
        x, y = np.meshgrid(display.x(run.strain.grid), display.y(run.strain.grid))
    active = make_grid().active
    true = np.einsum("ij,jrc->irc", GRADIENT, np.stack([x, y]))
    np.testing.assert_allclose(shown["u"][active], true[0][active], rtol=1e-5)
    np.testing.assert_allclose(shown["v"][active], true[1][active], rtol=1e-5)
    symmetric = (GRADIENT + GRADIENT.T) / 2
    for name, value in (
        ("exx", symmetric[0, 0]),
        ("eyy", symmetric[1, 1]),
        ("exy", symmetric[0, 1]),
        ("du_dx", GRADIENT[0, 0]),
        ("du_dy", GRADIENT[0, 1]),
        ("dv_dx", GRADIENT[1, 0]),
        ("dv_dy", GRADIENT[1, 1]),
    ):
        np.testing.assert_allclose(shown[name][active], 100 * value, rtol=1e-5, err_msg=name)
    assert symmetric[0, 1] > 0.01  # or the sign of exy would not have been tried


def test_what_is_shown_is_the_derivative_of_what_is_shown(tmp_path: Path) -> None:
    display = Display(mm_per_px=0.02, y_up=True)
    with open_run(make_run(tmp_path, [0.0], session=False, field_of=field_in_the_picture)) as run:
        grid = run.strain.grid
        u, v, exy = (display.shown(name, run.strain.maps(name, 0)) for name in ("u", "v", "exy"))
        inside = np.s_[1:, 1:]  # without the row of the ZOI that is switched off
        du = np.gradient(u[inside], display.y(grid)[1:], axis=0)
        dv = np.gradient(v[inside], display.x(grid)[1:], axis=1)
    np.testing.assert_allclose((du + dv) / 2, exy[inside], rtol=1e-3)


def test_nothing_asked_for_changes_nothing(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0, 1e-3], session=False)) as run:
        for name in run.strain.names:
            np.testing.assert_array_equal(
                Display().shown(name, run.strain.maps(name, 1)), run.strain.maps(name, 1)
            )
        for name, values in run.strain.values.items():
            np.testing.assert_array_equal(Display().shown(name, values), values)


def test_uncertainties_have_no_sign_and_whole_numbers_stay_whole() -> None:
    display = Display(mm_per_px=0.5, y_up=True, percent=True)
    sigma = np.array([2e-5], np.float32)
    assert display.shown("sigma_exy", sigma) == pytest.approx(2e-3)
    assert display.shown("sigma_v", sigma) == pytest.approx(1e-5)
    assert display.shown("status", np.array([5], np.uint8)).dtype == np.uint8


@pytest.mark.parametrize(
    ("name", "column"),
    [("u", "u_mm"), ("v_px", "v_mm"), ("eyy", "eyy_percent"), ("sigma_exy", "sigma_exy_percent"),
     ("force_N", "force_N"), ("status", "status"), ("residual", "residual"), ("time_s", "time_s")],
)  # fmt: skip
def test_names_carry_their_unit(name: str, column: str) -> None:
    assert Display(mm_per_px=0.1, percent=True).column(name) == column


def test_every_number_has_a_definition(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0], session=False)) as run:
        names = [*run.strain.names, *run.strain.values, "x", "y"]
    assert not [name for name in names if quantity_of(name).words.startswith("see ")]


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_scale_is_refused(scale: float) -> None:
    with pytest.raises(ConfigError, match="mm/px is not possible"):
        Display(mm_per_px=scale)


def test_it_reads_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = make_run(tmp_path)
    assert main(str(folder)) == 0
    said = capsys.readouterr().out
    assert f"S1: {len(PULLED)} measurements, force up to 4210 N" in said
    assert "pictures: 128 x 96 px" in said
    assert (folder / "from_python" / "report.html").is_file()
    with np.load(folder / "from_python" / "strain.npz") as held:
        assert held["v"].shape[0] == len(PULLED)


def test_the_notebook_runs_cell_by_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    runpy.run_module("examples.notebook", run_name="__main__")
    said = capsys.readouterr().out
    modulus = re.search(r"E = ([0-9.]+) GPa from 5 instants", said)
    assert modulus is not None
    assert float(modulus[1]) == pytest.approx(70, rel=0.01)
    assert re.search(r"<StrainField 11 x 15 ZOIs, 165 of 165 with a value; mean exx -0.0018", said)
    assert "<Strain strain.h5: 5 instants of 11 x 15 ZOIs, engineering strain>" in said
    assert list(tmp_path.glob("phasedic-*/report.html"))


def test_a_batch_measures_all_compares_them_and_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs, out = tmp_path / "runs", tmp_path / "out"
    speckle = Speckle((128, 160), radius=2.0, seed=3)
    for name in ("a", "b"):
        shots = tmp_path / name
        shots.mkdir()
        for k in range(4):
            picture = 255 * speckle.render(Affine(dv_dy=1e-3 * k, x0=80, y0=64), (128, 160))
            cv2.imwrite(str(shots / f"{k}.png"), np.rint(picture).astype(np.uint8))
        quiet = ["--zoi", "48", "--burst", "1", "--no-view", "--no-rrd", "--out", str(runs / name)]
        assert phasedic(["run", "--camera", str(shots), *quiet]) == 0
    (runs / "broken").mkdir()
    (runs / "broken" / "session.h5").write_bytes(b"no session")
    assert batch(str(runs), str(out), "--zoi", "32", "--step", "16") == 4
    said = capsys.readouterr().out
    assert said.count(": measured (exit code 0)") == 2
    assert "broken/session.h5: failed (exit code 4)" in said
    assert (out / "all.html").is_file()
    batch(str(runs), str(out), "--zoi", "32", "--step", "16")
    assert capsys.readouterr().out.count("measured already") == 2
