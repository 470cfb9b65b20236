"""The apparent motion of plates: exact on projected planes, with the uncertainty of its noise; what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis import Roi, ZoiGrid
from analysis.evaluate import AreaStrain, LineGauge
from analysis.field import PAIR_INDEX, Status, StrainField, part_of, profile
from analysis.optics import (
    ApparentMotion,
    Model,
    PlateFit,
    PlateLayout,
    alike,
    choose_model,
    keystones,
    trouble,
)
from hw_mocks.optics import Optics, PlaneMotion
from hw_mocks.specimen import VirtualSpecimen
from tests.analysis.planes import NAMES, seen_between

SPECIMEN = VirtualSpecimen(width=640, height=480)
AXIS, FOCAL = (319.5, 239.5), 500 * 20.0
TWO = {"left": (20.0, 40.0, 100.0, 400.0), "right": (520.0, 40.0, 100.0, 400.0)}
ONE = {"left": (20.0, 40.0, 240.0, 400.0)}
GRID = ZoiGrid.cover(Roi(280, 40, 160, 400), 64, 16)
END = SPECIMEN.duration_s
AXIAL, ACROSS = float(SPECIMEN.axial_strain(END)), float(SPECIMEN.transverse_strain(END))


def fit_of(boxes: dict[str, tuple[float, float, float, float]]) -> PlateFit:
    return PlateFit(PlateLayout.of(GRID, boxes), AXIS)


def seen(
    fit: PlateFit, boxes: dict[str, tuple[float, float, float, float]], optics: Optics,
    specimen: VirtualSpecimen = SPECIMEN,
) -> StrainField:  # fmt: skip
    """On a specimen that looks as ``optics`` show it at rest."""
    optics = replace(optics, plates=tuple(boxes.values()))
    return seen_between(optics.seen(specimen, 0.0), optics.seen(specimen, END), fit.layout.whole)


def corrected(fit: PlateFit, field: StrainField, model: Model) -> tuple[float, float]:
    """Errors of exx and eyy of the specimen."""
    motion, _ = fit.motion(field, model)
    area = AreaStrain.of(motion.removed_from(part_of(field, fit.layout.here, fit.layout.specimen)))
    assert area is not None
    return area.value("exx") - ACROSS, area.value("eyy") - AXIAL


def settling(towards: float, tilt: float) -> Optics:
    return Optics(500.0, settling=PlaneMotion(towards, math.radians(tilt), math.radians(tilt)))


def test_without_correction_a_tenth_of_a_millimetre_is_200_um_m() -> None:
    fit = fit_of(TWO)
    raw = AreaStrain.of(part_of(seen(fit, TWO, settling(0.1, 0.0)), fit.layout.here, fit.layout.specimen))
    assert raw is not None
    assert raw.value("eyy") - AXIAL == pytest.approx(0.1 / 499.9 * (1 + AXIAL), rel=1e-9)


@pytest.mark.parametrize("model", ["scale", "pose", "homography"])
def test_every_model_removes_motion_along_the_axis(model: Model) -> None:
    fit = fit_of(ONE)
    assert corrected(fit, seen(fit, ONE, settling(0.1, 0.0)), model) == pytest.approx((0, 0), abs=1e-12)


def test_scale_needs_plates_on_both_sides_against_tilt_and_pose_does_not() -> None:
    both, one = fit_of(TWO), fit_of(ONE)
    tilted = settling(0.1, 0.1)
    assert np.abs(corrected(both, seen(both, TWO, tilted), "scale")).max() < 22e-6  # 40 px off their middle
    assert min(corrected(one, seen(one, ONE, tilted), "scale")) > 35e-6
    assert corrected(one, seen(one, ONE, tilted), "pose") == pytest.approx((0, 0), abs=2.5e-6)


def test_a_camera_that_is_not_square_needs_the_homography() -> None:
    fit = fit_of(ONE)
    square = PlaneMotion(0, 0, math.radians(2.0))
    field = seen(fit, ONE, replace(settling(0.1, 0.1), still=square))
    assert np.abs(corrected(fit, field, "pose")).max() > 30e-6
    # What is left is the strain itself, seen at an angle: 2 degrees change 1 % of strain by cos^2.
    assert corrected(fit, field, "homography") == pytest.approx((0, 0), abs=1e-5)


def test_removal_is_exact_for_a_large_homography_and_keeps_rigid_fields_at_zero() -> None:
    motion = ApparentMotion(np.array([0.02, -0.03, 0.01, 0.05, 0.004, -0.006, 0.003, 0.002]), AXIS, 300.0)
    still = StrainField.from_values(GRID, {})
    values = motion.at(*motion.places(still))
    moved = StrainField.from_values(GRID, dict(zip(NAMES, values, strict=True)))
    np.testing.assert_allclose(motion.removed_from(moved).parameters, 0, atol=1e-11)


@pytest.mark.parametrize("model", ["scale", "pose", "homography"])
def test_a_large_motion_of_plates_is_found_to_the_last_digits(model: Model) -> None:
    fit, count = fit_of(TWO), {"scale": 4, "pose": 6, "homography": 8}[model]
    truth = np.array([0.02, -0.03, 0.01, 0.05, 0.004, -0.006, 0.003, 0.002]) * (np.arange(8) < count)
    motion = ApparentMotion(truth, AXIS, fit.length)
    values = motion.at(*motion.places(StrainField.from_values(fit.layout.whole, {})))
    field = StrainField.from_values(fit.layout.whole, dict(zip(NAMES, values, strict=True)), 1e-3)
    np.testing.assert_allclose(fit.motion(field, model)[0].parameters, truth, atol=1e-9)


def noisy(fit: PlateFit, rng: np.random.Generator) -> StrainField:
    """What white noise of the pixels makes of every ZOI, by the moments under its window."""
    grid = fit.layout.whole
    line = profile("gaussian", grid.size)
    x = np.arange(grid.size) - (grid.size - 1) / 2
    even, odd = line / line.sum(), line * x / (line @ x**2)
    values = []
    for _ in range(2):
        pixels = rng.standard_normal((480, 640))
        down, lean = (np.array([w @ pixels[y : y + grid.size] for y in grid.first_y]) for w in (even, odd))

        def across(rows: NDArray[np.float64], w: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.array([rows[:, x : x + grid.size] @ w for x in grid.first_x]).T

        values += [across(down, even), across(down, odd), across(lean, even)]
    sigma = float(even @ even)
    return StrainField.from_values(grid, dict(zip(NAMES, values, strict=True)), sigma)


@pytest.mark.parametrize(("boxes", "model"), [(TWO, "pose"), (ONE, "homography")])
def test_covariance_is_that_of_the_noise(
    boxes: dict[str, tuple[float, float, float, float]], model: Model
) -> None:
    fit, rng = fit_of(boxes), np.random.default_rng(1)
    covariance = fit.motion(noisy(fit, rng), model)[1]
    drawn = np.array([fit.motion(noisy(fit, rng), model)[0].parameters for _ in range(60)])
    for k in range({"scale": 4, "pose": 6, "homography": 8}[model]):
        assert drawn[:, k].std() == pytest.approx(math.sqrt(covariance[k, k]), rel=0.3)


def test_the_error_of_the_plates_is_common_to_all_zois() -> None:
    field = StrainField.from_values(GRID, {}, 1e-3)
    fit = fit_of(TWO)
    covariance = np.zeros((8, 8))
    covariance[2, 2] = 25e-12  # 5 um/m of scale, in all ZOIs alike
    with_error = replace(field, common=fit.error(field, covariance))
    own, area = AreaStrain.of(field), AreaStrain.of(with_error)
    assert own is not None
    assert area is not None
    assert area.sigma("exx") == pytest.approx(math.hypot(own.sigma("exx"), 5e-6), rel=1e-9)
    assert area.sigma("exy") == pytest.approx(own.sigma("exy"), rel=1e-9)
    assert with_error.mean("eyy")[1] == pytest.approx(math.hypot(field.mean("eyy")[1], 5e-6), rel=1e-9)
    np.testing.assert_allclose(with_error.sigma_exx, math.hypot(1e-3, 5e-6), rtol=1e-6)
    line = LineGauge("axial", (360.0, 80.0), (360.0, 400.0))
    before, after = line.measure(field).sigma, line.measure(with_error).sigma
    assert after == pytest.approx(math.hypot(before, 5e-6), rel=1e-6)


def test_the_model_follows_from_the_uncertainty_it_leaves() -> None:
    both, one = fit_of(TWO), fit_of(ONE)
    quiet, coarse = (
        replace(seen(one, ONE, Optics(500.0)), covariance=covariance(one, sigma)) for sigma in (1e-5, 3e-2)
    )
    assert choose_model(one, quiet, FOCAL).model == "homography"
    assert choose_model(one, coarse, FOCAL).model == "scale"
    field = replace(seen(both, TWO, Optics(500.0)), covariance=covariance(both, 1e-2))
    chosen = choose_model(both, field, FOCAL)
    assert chosen.model in ("scale", "pose")
    assert chosen.total < 25e-6
    assert chosen.total == pytest.approx(math.hypot(chosen.noise, chosen.unseen))


def covariance(fit: PlateFit, sigma_px: float) -> NDArray[np.float32]:
    shape = fit.layout.whole.shape
    out = np.zeros((21, *shape), np.float32)
    for i in range(6):
        out[PAIR_INDEX[i, i]] = (sigma_px if i % 3 == 0 else sigma_px / 15) ** 2
    return out


def test_a_rigid_plate_is_no_trouble_even_where_it_tilts() -> None:
    fit = fit_of(TWO)
    assert trouble(fit, seen(fit, TWO, settling(0.5, 0.5))) == ("", False)


@pytest.mark.parametrize(("sigmas", "loaded"), [(6.0, True), (3.5, False)])
def test_a_plate_is_loaded_beyond_four_sigmas(sigmas: float, loaded: bool) -> None:
    fit = fit_of(TWO)
    field = seen(fit, TWO, replace(settling(0.1, 0.1), plate_strain=0.3))
    motion, _ = fit.motion(field, "pose")
    plate = AreaStrain.of(motion.removed_from(part_of(field, fit.layout.plates["left"])))
    assert plate is not None
    stretch = abs(plate.value("exx") - plate.value("eyy")) / 2
    more = stretch / sigmas / (math.hypot(plate.sigma("exx"), plate.sigma("eyy")) / 2)
    assert stretch * (1 - 4 / 6) > 5e-5
    noisier = replace(
        field,
        covariance=np.float32(more**2) * field.covariance,
        covariance_reference=np.float32(more**2) * field.covariance_reference,
    )
    assert trouble(fit, noisier)[1] == loaded


def test_half_of_the_zois_of_a_plate_give_the_same_motion() -> None:
    fit = fit_of(TWO)
    field = seen(fit, TWO, settling(0.1, 0.1))
    status = field.status.copy()
    status[fit.layout.plates["right"].at][::3] = Status.LOST
    parameters = np.where(status == Status.OK, field.parameters, np.nan)
    partly = replace(field, status=status, parameters=parameters)
    assert corrected(fit, partly, "pose") == pytest.approx(corrected(fit, field, "pose"), abs=1e-6)


def test_plates_that_overlap() -> None:
    with pytest.raises(ValueError, match="two plates overlap"):
        PlateLayout.of(GRID, {"a": (0.0, 0.0, 200.0, 200.0), "b": (100.0, 0.0, 160.0, 200.0)})


def risen(grid: ZoiGrid, k: float, *, bent: bool = False) -> StrainField:
    """u = k x^2 and v = k x y about the middle of ``grid``, as a tilt makes them; ``bent``: v is that of bending."""
    x, y = np.meshgrid(grid.x - grid.x.mean(), grid.y - grid.y.mean())
    sign = -1 if bent else 1
    values = (k * x * x, 2 * k * x, 0 * x, sign * k * x * y, sign * k * y, sign * k * x)
    return StrainField.from_values(grid, dict(zip(NAMES, values, strict=True)), 1e-3)


def test_a_scale_that_rises_evenly_is_a_keystone_and_bending_is_none() -> None:
    """The mean strain rises by 1.5 k from one px to the next, here over 320 px; u and v show the same."""
    wide = ZoiGrid.cover(Roi(0, 0, 384, 224), 64, 32)
    along_x, along_y = keystones(risen(wide, 1e-6))
    assert (along_x.by_u, along_x.by_v) == pytest.approx((1.5e-6 * 320,) * 2)
    assert along_x.rise == pytest.approx(1.5e-6 * 320) and along_x.px == 320
    assert (along_y.by_u, along_y.by_v) == pytest.approx((0, 0), abs=1e-12) and along_y.px == 160
    bent = keystones(risen(wide, 1e-6, bent=True))[0]
    assert (bent.by_u, bent.by_v) == pytest.approx((1.5e-6 * 320, -1.5e-6 * 320)) and bent.rise == 0


def test_the_tilt_of_a_plane_is_read_from_its_keystone() -> None:
    fit = fit_of(TWO)
    optics = Optics(500.0, settling=PlaneMotion(0.0, math.radians(0.3), math.radians(0.2)))
    still = replace(SPECIMEN, programme=replace(SPECIMEN.programme, knee_strain=5e-9, max_strain=1e-8))
    field = seen(fit, TWO, optics, still)
    tilts = sorted(abs(math.degrees(one.tilt(FOCAL))) for one in keystones(field))
    assert tilts == pytest.approx([0.2, 0.3], rel=0.02)


@pytest.mark.parametrize(("step", "overlap"), [(32, 1.0), (16, 2.0)])
def test_the_sigma_of_a_keystone_is_the_scatter_of_noise(step: int, overlap: float) -> None:
    """As of noise that each ZOI has to itself; where they overlap, of as many as lie side by side."""
    grid, rng = ZoiGrid.cover(Roi(0, 0, 320, 256), 32, step), np.random.default_rng(2)
    found = []
    for _ in range(200):
        u, v = rng.normal(0, 1e-3, (2, *grid.shape))
        along_x, along_y = keystones(StrainField.from_values(grid, {"u": u, "v": v}, 1e-3))
        found.append((along_x.by_u, along_x.by_v, along_y.by_u, along_y.by_v))
    by = overlap * np.std(found, axis=0)
    assert along_x.sigma == pytest.approx(max(by[:2]), rel=0.2)
    assert along_y.sigma == pytest.approx(max(by[2:]), rel=0.2)


def test_eleven_zois_show_no_keystone() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 128, 96), 32, 32)
    status = np.zeros(grid.shape, int)
    assert math.isfinite(keystones(StrainField.from_values(grid, {}, 1e-3, status))[0].by_u)
    status[0, 0] = Status.LOST
    for one in keystones(StrainField.from_values(grid, {}, 1e-3, status)):
        assert math.isnan(one.by_u) and one.rise == 0


@pytest.mark.parametrize(
    ("one", "other", "noise", "both"),
    [
        (3.0, 2.0, 1.0, 2.5),
        (3.0, 2.0, 2.6, 0.0),
        (3.0, 0.9, 1.0, 0.0),
        (-3.0, -1.5, 1.0, -2.25),
        (3.0, -3.0, 0.0, 0.0),
    ],
)
def test_what_two_values_have_in_common(one: float, other: float, noise: float, both: float) -> None:
    """Their mean, where it is beyond the noise and their whole difference."""
    assert alike(one, other, noise) == both
