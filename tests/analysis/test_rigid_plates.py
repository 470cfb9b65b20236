"""Plates: the grid beside them, what of them is rigid, and what each model of their motion leaves."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.evaluate import AreaStrain
from analysis.field import Block, Roi, Status, StrainField, ZoiGrid, part_of
from analysis.optics import ApparentMotion, Model, PlateLayout, choose_model, trouble, without_plates
from tests.analysis.planes import NAMES
from tests.analysis.test_optics import FOCAL, ONE, TWO, covariance, fit_of


@pytest.mark.parametrize(("px", "uneven"), [(0.024, False), (0.0262, True)])
def test_a_plate_is_no_piece_beyond_two_hundredths_of_a_pixel_and_five_sigmas(
    px: float, uneven: bool
) -> None:
    """u and v of its ZOIs go up and down from one to the next; the noise is 0.001 px."""
    fit = fit_of(TWO)
    rows, columns = np.indices(fit.layout.whole.shape)
    left, wave = fit.layout.plates["left"], np.zeros(fit.layout.whole.shape)
    wave[left.at] = px * (-1.0) ** (rows + columns)[left.at]
    field = StrainField.from_values(fit.layout.whole, {"u": wave, "v": -wave}, 1e-3)
    words, not_rigid = trouble(fit, field)
    assert not_rigid == uneven
    expected = f"plate left does not move with the others as one piece: {px:.3f} px" if uneven else ""
    assert words == expected


@pytest.mark.parametrize(
    ("gradient", "strain"),
    [
        ({"du_dx": 2e-3, "dv_dy": -2e-3}, 2000),
        ({"du_dy": 2e-3, "dv_dx": 2e-3}, 2000),
        ({"du_dy": -2e-3, "dv_dx": 2e-3}, 0),  # turned
        ({"du_dx": 2e-3, "dv_dy": 2e-3}, 0),  # nearer
        ({"du_dx": -5.3e-5, "dv_dy": 5.3e-5}, 53),
        ({"du_dx": -4.7e-5, "dv_dy": 4.7e-5}, 0),
    ],
)
def test_a_plate_is_loaded_by_stretch_and_by_shear(gradient: dict[str, float], strain: int) -> None:
    """Of both plates alike, which lie even about the axis: no tilt looks like it."""
    fit = fit_of(TWO)
    x, y = np.meshgrid(fit.layout.whole.x - fit.centre[0], fit.layout.whole.y - fit.centre[1])
    g = {name: gradient.get(name, 0.0) for name in ("du_dx", "du_dy", "dv_dx", "dv_dy")}
    values = {"u": g["du_dx"] * x + g["du_dy"] * y, "v": g["dv_dx"] * x + g["dv_dy"] * y, **g}
    found = trouble(fit, StrainField.from_values(fit.layout.whole, values, 1e-9))[0].replace("\u202f", "")
    words = re.fullmatch(r"plate left is loaded or not flat: it is strained by (\d+) um/m itself", found)
    assert int(words[1]) == pytest.approx(strain, rel=3e-3) if words else (found, strain) == ("", 0)


@pytest.mark.parametrize(("boxes", "model", "sigma"), [(ONE, "scale", 3e-2), (TWO, "scale", 1e-1)])
def test_a_model_leaves_noise_and_what_it_does_not_have(
    boxes: dict[str, tuple[float, float, float, float]], model: Model, sigma: float
) -> None:
    """A tenth of a degree of tilt and of squareness, each alone, by the strain that is left after the correction."""
    fit = fit_of(boxes)
    still = StrainField.from_values(fit.layout.whole, {}, 1e-3)
    field = replace(still, covariance=covariance(fit, sigma))
    chosen = choose_model(fit, field, FOCAL)
    assert chosen.model == model
    tilt = math.radians(0.1)
    priors = [tilt * fit.length / FOCAL] * 2 + [tilt * math.sin(tilt)] * 2
    squares = np.zeros(2)
    for k, prior in enumerate(priors, 4):
        motion = ApparentMotion(prior * np.eye(8)[k], fit.centre, fit.length)
        values = motion.at(*motion.places(still))
        moved = StrainField.from_values(fit.layout.whole, dict(zip(NAMES, values, strict=True)), 1e-3)
        specimen = part_of(moved, fit.layout.here, fit.layout.specimen)
        area = AreaStrain.of(fit.motion(moved, model)[0].removed_from(specimen))
        assert area is not None
        squares += [area.value("exx") ** 2, area.value("eyy") ** 2]
    assert chosen.unseen == pytest.approx(math.sqrt(squares.mean()), rel=0.02)
    assert chosen.noise == pytest.approx(math.sqrt(fit.motion(field, model)[1][2, 2]), rel=1e-6)


@pytest.mark.parametrize(("left", "lost"), [(33, False), (32, True)])
def test_a_plate_needs_half_of_its_zois(left: int, lost: bool) -> None:
    fit = fit_of(TWO)
    plate = fit.layout.plates["right"]
    status = np.zeros(fit.layout.whole.shape, int)
    part = np.zeros(66, int)
    part[left:] = Status.LOST
    status[plate.at] = part.reshape(22, 3)
    found = trouble(fit, StrainField.from_values(fit.layout.whole, {}, 1e-3, status))
    assert found == ("plate right is lost or shaded: 32 of 66 ZOIs have a value" if lost else "", False)


GRID = ZoiGrid.cover(Roi(100, 200, 160, 160), 32, 16)  # 9 x 9 ZOIs
GRID_WIDE = ZoiGrid.cover(Roi(100, 200, 16 * 30 + 32, 16 * 30 + 32), 32, 16)


def test_plates_above_and_below_widen_the_grid_by_whole_steps() -> None:
    """Rows of ZOIs start at 40 + 16 k: those wholly on the upper plate up to 104, on the lower one from 408 on."""
    layout = PlateLayout.of(GRID, {"top": (100.0, 40.0, 160.0, 100.0), "low": (99.0, 400.0, 49.0, 90.0)})
    assert layout.whole.roi == Roi(100, 40, 160, 26 * 16 + 32)
    assert layout.here == Block(slice(10, 19), slice(0, 9))
    assert layout.plates["top"] == Block(slice(0, 5), slice(0, 9))
    assert layout.plates["low"] == Block(slice(23, 27), slice(0, 2))
    assert layout.whole.n_active == 81 + 45 + 8


def test_plates_to_the_left_and_right_widen_it_too() -> None:
    layout = PlateLayout.of(GRID, {"left": (36.0, 200.0, 50.0, 48.0), "right": (276.0, 216.0, 48.0, 48.0)})
    assert layout.whole.roi == Roi(36, 200, 16 * 16 + 32, 160)
    assert layout.here == Block(slice(0, 9), slice(4, 13))
    assert layout.plates["left"] == Block(slice(0, 2), slice(0, 2))
    assert layout.plates["right"] == Block(slice(1, 3), slice(15, 17))


@pytest.mark.parametrize(("width", "room"), [(48.0, True), (47.0, False)])
def test_two_zois_a_side_make_a_plate(width: float, room: bool) -> None:
    for box in ((276.0, 200.0, width, 160.0), (276.0, 200.0, 160.0, width)):
        if room:
            assert min(PlateLayout.of(GRID, {"p": box}).plates["p"].of(GRID_WIDE).shape) == 2
        else:
            with pytest.raises(
                ValueError, match=r"plate p of .* has no room for 2 x 2 ZOIs of 32 px; make it larger"
            ):
                PlateLayout.of(GRID, {"p": box})


def test_without_a_zoi_beside_the_plates_nothing_is_measured() -> None:
    nothing = GRID.subset(active=np.zeros(GRID.shape, bool))
    with pytest.raises(ValueError, match="the plates cover the whole region to measure"):
        PlateLayout.of(nothing, {"p": (276.0, 200.0, 48.0, 160.0)})


@pytest.mark.parametrize(
    ("box", "rows", "columns"),
    [
        ((0.0, 0.0, 132.0, 232.0), 2, 2),  # up to column 131 and row 231; the third ZOI begins there
        ((0.0, 0.0, 133.0, 233.0), 3, 3),
        ((131.0, 231.0, 500.0, 500.0), -9, -9),  # the last pixel of the first ZOI
        ((132.0, 232.0, 500.0, 500.0), -8, -8),
    ],
)
def test_a_zoi_with_a_pixel_on_a_plate_is_left_out(
    box: tuple[float, float, float, float], rows: int, columns: int
) -> None:
    touched = np.zeros(GRID.shape, bool)
    touched[
        slice(rows) if rows > 0 else slice(rows, None),
        slice(columns) if columns > 0 else slice(columns, None),
    ] = True
    np.testing.assert_array_equal(without_plates(GRID, {"p": box}).active, ~touched)
