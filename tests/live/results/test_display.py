"""Units and axes of what is shown and exported, against an analytic rotation and stretch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis.field.strain_field import StrainField
from live.results.quantities import Display, quantity_of
from live.results.run_folder import open_run
from tests.live.made_run import make_run
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
