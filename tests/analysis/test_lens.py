"""A lens: its inverse, fields without its distortion by value, its fit to shifted pictures with honest uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis import Roi, ZoiGrid
from analysis.evaluate import AreaStrain
from analysis.field import Block, Status, StrainField
from analysis.optics import LensCorrection, LensModel, PlateLayout, lens_of_shifts, strain_of_shift
from hw_mocks.deformation import Affine, Deformation
from hw_mocks.optics import Lens as TrueLens
from hw_mocks.optics import Optics, PlaneMotion, Seen
from tests.analysis.planes import seen_between

WIDTH, HEIGHT = 640, 480
MIDDLE = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
GRID = ZoiGrid.cover(Roi(40, 30, 560, 420), 40, 40)
FOCAL = math.hypot(WIDTH, HEIGHT) / 2
DISTORTION = -0.004  # 0.4 % at the corner: an ordinary lens
TRUE = np.array([FOCAL, *MIDDLE, DISTORTION * (FOCAL / math.hypot(*MIDDLE)) ** 2, 0, 0, 0, 0])
PERFECT = LensModel(TRUE, np.zeros((8, 8)))


def seen(
    deformation: Deformation, grid: ZoiGrid = GRID, motion: PlaneMotion | None = None,
    middle: tuple[float, float] = MIDDLE,
) -> StrainField:  # fmt: skip
    """``deformation`` in the plane, by the lens of the simulated camera."""
    optics = Optics(500.0, DISTORTION)
    still = TrueLens.of(optics, PlaneMotion(), middle, 20.0)
    moved = TrueLens.of(optics, motion or PlaneMotion(), middle, 20.0)
    return seen_between(Seen(Affine(), still), Seen(deformation, moved), grid)


def test_a_lens_is_turned_round_with_its_derivatives() -> None:
    lens = LensModel(np.array([900.0, 325, 236, -0.21, 0.09, 1e-3, -2e-3, 0.01]), np.zeros((8, 8)))
    x, y = np.meshgrid(np.linspace(0, 639, 7), np.linspace(0, 479, 5))
    flat = lens.straightened(x, y)
    back = lens.distorted(flat.x, flat.y)
    np.testing.assert_allclose([back.x, back.y], [x, y], atol=1e-9)
    assert np.abs(flat.x - x).max() > 10
    step = 1e-3
    along_x, along_y = lens.straightened(x + step, y), lens.straightened(x, y + step)
    found = [(one.x - flat.x, one.y - flat.y) for one in (along_x, along_y)]
    np.testing.assert_allclose(
        [found[0][0], found[1][0]], np.array([flat.xx, flat.xy]) * step, rtol=2e-3, atol=1e-9
    )
    np.testing.assert_allclose(
        [found[0][1], found[1][1]], np.array([flat.yx, flat.yy]) * step, rtol=2e-3, atol=1e-9
    )


def test_a_lens_that_folds_the_picture_is_found() -> None:
    x, y = np.meshgrid(GRID.x, GRID.y)
    assert PERFECT.is_single_valued(x, y)
    for radial in ((-0.9, 0.0), (-0.65, 0.2)):  # of the second, no place is met that turns back
        folded = replace(PERFECT, parameters=np.array([FOCAL, *MIDDLE, *radial, 0, 0, 0]))
        assert not folded.is_single_valued(x, y), radial


@pytest.mark.parametrize("shift", [(20.0, 0.0), (0.0, 20.0), (-12.0, 16.0)])
def test_a_specimen_that_moves_20_px_and_stretches_shows_its_own_strain(shift: tuple[float, float]) -> None:
    u, v = shift
    field = seen(Affine(u, v, du_dx=-3e-4, dv_dy=1e-3, x0=MIDDLE[0], y0=MIDDLE[1]))
    raw = np.abs(field.eyy - 1e-3).max()
    corrected, reading = LensCorrection(PERFECT, GRID).apply(field)
    assert raw > 150e-6
    np.testing.assert_allclose(corrected.eyy, 1e-3, atol=1e-9)
    np.testing.assert_allclose(corrected.exx, -3e-4, atol=1e-9)
    _, y = np.meshgrid(GRID.x, GRID.y)
    np.testing.assert_allclose(corrected.v, v + 1e-3 * (y - MIDDLE[1]), atol=1e-6)
    area, after = AreaStrain.of(field), AreaStrain.of(corrected)
    assert area is not None
    assert after is not None
    assert reading.eyy == pytest.approx(area.value("eyy") - after.value("eyy"), abs=1e-15)
    assert after.value("eyy") == pytest.approx(1e-3, abs=1e-9)


def test_displacements_are_those_of_the_place_seen_whatever_the_deformation() -> None:
    truth = Affine(3.0, -2.0, du_dx=4e-3, du_dy=9e-3, dv_dx=-5e-3, dv_dy=2e-3, x0=MIDDLE[0], y0=MIDDLE[1])
    corrected = LensCorrection(PERFECT, GRID).apply(seen(truth))[0]
    x, y = np.meshgrid(GRID.x - MIDDLE[0], GRID.y - MIDDLE[1])
    np.testing.assert_allclose(corrected.u, 3 + 4e-3 * x + 9e-3 * y, atol=1e-6)
    np.testing.assert_allclose(corrected.v, -2 - 5e-3 * x + 2e-3 * y, atol=1e-6)
    for name, value in (("du_dx", 4e-3), ("du_dy", 9e-3), ("dv_dx", -5e-3), ("dv_dy", 2e-3)):
        np.testing.assert_allclose(getattr(corrected, name), value, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(("x", "y"), [(420, 140), (220, 20)], ids=["right", "above"])
def test_the_strain_of_a_shift_is_that_of_the_worse_direction(x: int, y: int) -> None:
    """Beside the middle a shift away from it strains most: 6 k1 r/f along it per px."""
    grid = ZoiGrid.cover(Roi(x, y, 200, 200), 40, 20)
    beside = math.hypot(grid.x.mean() - MIDDLE[0], grid.y.mean() - MIDDLE[1])
    expected = 6 * abs(TRUE[3]) * beside / FOCAL**2 * 20.0
    assert strain_of_shift(PERFECT, grid, 20.0)[0] == pytest.approx(expected, rel=0.15)


def test_a_region_off_the_middle_has_a_false_mean_strain_without_the_correction() -> None:
    grid = ZoiGrid.cover(Roi(400, 30, 200, 200), 40, 20)
    field = seen(Affine(0.0, 20.0), grid)
    raw = AreaStrain.of(field)
    assert raw is not None
    assert abs(raw.value("eyy")) > 100e-6
    reading = LensCorrection(PERFECT, grid).apply(field)[1]
    assert reading.eyy == pytest.approx(raw.value("eyy"), abs=1e-9)


def test_the_uncertainty_of_a_lens_is_that_of_drawn_lenses() -> None:
    covariance = np.zeros((8, 8))
    covariance[3:5, 3:5] = [[4e-7, -5e-7], [-5e-7, 9e-7]]
    covariance[1, 1] = 25.0
    lens = LensModel(TRUE, covariance)
    field = seen(Affine(15.0, 20.0))
    corrected, reading = LensCorrection(lens, GRID).apply(field)
    drawn, rng = [], np.random.default_rng(3)
    for parameters in rng.multivariate_normal(TRUE, covariance, 300):
        one = LensCorrection(LensModel(parameters, np.zeros((8, 8))), GRID).apply(field)[0]
        area = AreaStrain.of(one)
        assert area is not None
        drawn.append((area.value("exx"), area.value("eyy"), one.eyy[2, 3], one.u[1, 12]))
    scatter = np.std(drawn, axis=0)
    common = corrected.common
    assert common is not None
    assert [reading.sigma_exx, reading.sigma_eyy] == pytest.approx(scatter[:2], rel=0.12)
    assert math.sqrt(common.variance("eyy")[2, 3]) == pytest.approx(scatter[2], rel=0.12)
    assert math.sqrt(common.variance("u")[1, 12]) == pytest.approx(scatter[3], rel=0.12)
    assert corrected.mean("eyy")[1] > field.mean("eyy")[1]


def test_a_lens_without_uncertainty_and_a_lost_picture() -> None:
    lost = StrainField.from_values(GRID, {}, status=np.full(GRID.shape, Status.LOST))
    corrected, reading = LensCorrection(PERFECT, GRID).apply(lost)
    assert not corrected.ok.any()
    assert np.isnan(reading).all()
    field = seen(Affine(3.0, 4.0))
    assert LensCorrection(PERFECT, GRID).apply(field)[0].mean("eyy")[1] == field.mean("eyy")[1]


def test_the_reading_is_of_the_specimen_alone() -> None:
    grid = ZoiGrid.cover(Roi(240, 40, 160, 400), 40, 20)
    layout = PlateLayout.of(grid, {"left": (20.0, 40.0, 100.0, 400.0)})
    field = seen(Affine(10.0, 20.0), layout.whole)
    whole = LensCorrection(PERFECT, layout.whole, layout).apply(field)[1]
    alone = LensCorrection(PERFECT, grid).apply(seen(Affine(10.0, 20.0), grid))[1]
    np.testing.assert_allclose(whole, alone, rtol=1e-9, atol=1e-14)
    assert isinstance(layout.here, Block)


SHIFTS = [(60.0, 0.0), (-60.0, 0.0), (0.0, 50.0), (0.0, -50.0), (45.0, 40.0)]


def shifted(
    rng: np.random.Generator, sigma: float, tilt: float = 0.0, middle: tuple[float, float] = MIDDLE
) -> list[StrainField]:
    """Fields of a specimen that was shifted and turned, moved off its plane and tilted, with noise of both pictures."""
    off, fields = rng.normal(0, sigma, (2, *GRID.shape)), []
    for u, v in SHIFTS:
        towards, turn = rng.normal(0, 0.1), rng.normal(0, 0.002)
        motion = PlaneMotion(towards, *np.radians(tilt * rng.normal(size=2)))
        field = seen(Affine(u, v, -(turn**2) / 2, -turn, turn, -(turn**2) / 2, *MIDDLE), GRID, motion, middle)
        parameters = field.parameters.copy()
        parameters[[0, 3]] += off + rng.normal(0, sigma, (2, *GRID.shape))
        covariance = np.zeros((21, *GRID.shape), np.float32)
        covariance[[0, 15]] = 2 * sigma**2
        fields.append(
            replace(field, parameters=parameters, covariance=covariance, covariance_reference=covariance / 2)
        )
    return fields


def test_shifted_pictures_give_the_lens_whatever_the_specimen_does_off_its_plane() -> None:
    fields = shifted(np.random.default_rng(1), 1e-5, tilt=0.2)
    fit, square = (lens_of_shifts(fields, WIDTH, HEIGHT, square=one) for one in (False, True))
    for found in (fit, square):
        assert found.lens.parameters[3] == pytest.approx(TRUE[3], rel=0.01)
        assert found.rms_px < (1e-3 if found is square else 2e-5)
    strain, sigma = strain_of_shift(fit.lens, GRID, 20.0)
    assert strain == pytest.approx(strain_of_shift(PERFECT, GRID, 20.0)[0], rel=0.02)
    # The place of the optical axis shows only where the camera is known to be square.
    assert 0.3 * strain < sigma < strain
    assert strain_of_shift(square.lens, GRID, 20.0)[1] < 0.15 * strain


@pytest.mark.slow
@pytest.mark.parametrize("square", [False, True])
def test_the_stated_uncertainty_of_the_strain_covers_the_truth(square: bool) -> None:
    """Errors of the mean strain of a part of the region, after a shift by 20 px, over their sigma: 95 % within 1.96."""
    rng, grid = np.random.default_rng(7), ZoiGrid.cover(Roi(380, 60, 200, 160), 40, 20)
    errors = []
    for _ in range(24):
        middle = MIDDLE[0] + rng.normal(0, 0.01 * WIDTH), MIDDLE[1] + rng.normal(0, 0.01 * WIDTH)
        lens = lens_of_shifts(shifted(rng, 5e-3, middle=middle), WIDTH, HEIGHT, square=square).lens
        field = seen(Affine(15.0, 20.0), grid, middle=middle)
        corrected, reading = LensCorrection(lens, grid).apply(field)
        area = AreaStrain.of(corrected)
        assert area is not None
        errors.append((area.value("exx") / reading.sigma_exx, area.value("eyy") / reading.sigma_eyy))
    assert 0.75 < np.std(errors) < 1.25
    assert np.mean(np.abs(errors) < 1.96) > 0.9


def test_too_few_pictures_and_small_shifts_are_refused() -> None:
    fields = shifted(np.random.default_rng(1), 1e-3)
    with pytest.raises(ValueError, match="1 shifted pictures with 140 ZOIs"):
        lens_of_shifts(fields[:1], WIDTH, HEIGHT)
    with pytest.raises(ValueError, match="the shifts do not show the lens; shift by a tenth of the picture"):
        lens_of_shifts([seen(Affine())] * 3, WIDTH, HEIGHT)


def test_the_optical_axis_is_taken_in_the_middle_give_or_take_a_hundredth_of_the_width() -> None:
    """By pictures that are 13 px wider or higher, whose middle is 6.5 px further; a hundredth is 6.4 px."""
    fields = shifted(np.random.default_rng(1), 1e-5)
    lens, variance = lens_of_shifts(fields, WIDTH, HEIGHT).lens, 0.0
    for width, height in ((WIDTH + 13, HEIGHT), (WIDTH, HEIGHT + 13)):
        off = lens_of_shifts(fields, width, height).lens.parameters
        variance += ((off[3] * (FOCAL / off[0]) ** 2 - lens.parameters[3]) * 6.4 / 6.5) ** 2
    assert math.sqrt(lens.covariance[3, 3]) == pytest.approx(math.sqrt(variance), rel=0.02)


def test_noise_beyond_what_is_stated_is_in_the_uncertainty_of_the_lens() -> None:
    """Three times the noise stated: the lens is as uncertain as where all of it is stated."""
    fields = shifted(np.random.default_rng(3), 5e-3)
    ninth = [
        replace(one, covariance=one.covariance / 9, covariance_reference=one.covariance_reference / 9)
        for one in fields
    ]
    honest, short = (lens_of_shifts(some, WIDTH, HEIGHT) for some in (fields, ninth))
    assert honest.lens.parameters[:3] == pytest.approx(
        TRUE[:3], rel=1e-12
    )  # not found: half a diagonal, the middle
    assert short.over_noise == pytest.approx(3, rel=0.1)
    assert short.rms_px == pytest.approx(honest.rms_px, rel=1e-3)
    radial = np.s_[3:5, 3:5]
    assert short.lens.covariance[radial] == pytest.approx(honest.lens.covariance[radial], rel=0.1)


def test_eleven_zois_are_too_few_for_a_lens() -> None:
    fields = shifted(np.random.default_rng(1), 1e-3)
    few = np.where(np.arange(GRID.active.size).reshape(GRID.shape) % 13 == 0, Status.OK, Status.LOST)
    assert (few == Status.OK).sum() == 11
    with pytest.raises(ValueError, match="with 11 ZOIs that all of them show; it takes 2 and 12"):
        lens_of_shifts([replace(one, status=few.astype(np.uint8)) for one in fields], WIDTH, HEIGHT)
