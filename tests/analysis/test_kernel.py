"""The kernel through its public interface: truth, uncertainty, independence of ZOIs, refusals, both estimators."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest

from analysis import KernelSettings, NoiseModel, PatternError, PhaseKernel, Roi, Status, StrainField, ZoiGrid
from analysis.kernel.reference import ReferencePicture
from tests.analysis.speckle import SHAPE, picture

GRID = ZoiGrid.cover(Roi(8, 8, 224, 184), size=32, step=16)
GRID_8 = ZoiGrid.cover(Roi(2, 2, 236, 196), size=32, step=8)
FIELDS = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy", "sigma_u", "sigma_exx", "residual")


def true_displacement(grid: ZoiGrid, u=0.0, v=0.0, du_dx=0.0, du_dy=0.0, dv_dx=0.0, dv_dy=0.0):
    x, y = np.meshgrid(grid.x - (SHAPE[1] - 1) / 2, grid.y - (SHAPE[0] - 1) / 2)
    return u + du_dx * x + du_dy * y, v + dv_dx * x + dv_dy * y


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_any_kind_of_grey_image(dtype: type) -> None:
    bits = 8 if dtype is np.uint8 else 12
    kernel = PhaseKernel(picture(bits=bits).astype(dtype), GRID)
    field = kernel.measure(picture(bits=bits, u=0.3, v=-0.2).astype(dtype))
    assert field.ok.all()
    assert abs(np.mean(field.u) - 0.3) < 1e-3 and abs(np.mean(field.v) + 0.2) < 1e-3


def test_whole_grey_levels_are_the_same_in_any_type() -> None:
    picture_of = {kind: picture(bits=8, u=0.3).astype(kind) for kind in (np.uint8, np.uint16, np.float32)}
    kernel = PhaseKernel(picture(bits=8), GRID)
    expected = kernel.measure(picture_of[np.float32])
    for image in picture_of.values():
        image.flags.writeable = False  # as frames are
        assert np.array_equal(kernel.measure(image).parameters, expected.parameters)


def test_pictures_share_the_memory_of_their_coefficients(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bits do not depend on what was in it before, and no picture takes memory of its own."""
    first, second = picture(u=0.3, v=-0.2), picture(u=6.4, du_dx=0.01)
    expected = [PhaseKernel(picture(), GRID).measure(image).parameters for image in (first, second)]
    kernel = PhaseKernel(picture(), GRID)
    monkeypatch.setattr("analysis.picture.prefilter.room_for", None)
    for image, values in ((first, expected[0]), (second, expected[1]), (first, expected[0])):
        np.testing.assert_array_equal(kernel.measure(image).parameters, values)


def test_masked_pixels_are_refused_and_not_measured() -> None:
    whole, dark = np.ma.masked_array(picture(u=0.1), False), np.ma.masked_less(picture(), 1500)
    assert dark.mask.any()
    kernel = PhaseKernel(picture(), GRID)
    np.testing.assert_array_equal(kernel.measure(whole).parameters, kernel.measure(whole.data).parameters)
    with pytest.raises(ValueError, match="the deformed image has masked pixels: give its data"):
        kernel.measure(dark)
    with pytest.raises(ValueError, match="the reference has masked pixels"):
        PhaseKernel(dark, GRID)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(value: float) -> None:
    kernel, bad = PhaseKernel(picture(), GRID), picture(u=0.1).astype(np.float32)
    last = kernel.measure(picture(u=0.1))
    bad[100, 90] = value
    for start in (None, last):
        with pytest.raises(ValueError, match="the deformed image holds values that are not finite"):
            kernel.measure(bad, start=start)
    np.testing.assert_array_equal(kernel.measure(picture(u=0.1)).parameters, last.parameters)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_a_frame_buffer_may_be_filled_again(dtype: type) -> None:
    """As a camera does that reuses its buffer: the reference stays what it was."""
    buffer, later = picture(bits=8).astype(dtype), picture(bits=8, u=0.3).astype(dtype)
    kernel = PhaseKernel(buffer, GRID)
    expected = kernel.measure(later).parameters
    buffer[:] = 0
    again = kernel.measure(later)
    assert again.ok.all()
    np.testing.assert_array_equal(again.parameters, expected)
    renewed = kernel.renewed(buffer_of_later := later.copy(), again)
    shown = renewed.measure(later).parameters
    buffer_of_later[:] = 0
    np.testing.assert_array_equal(renewed.measure(later).parameters, shown)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(
    "motion",
    [
        {"u": 0.37, "v": -0.21},
        {"u": 11.4, "v": -7.3},
        {"du_dx": 0.004, "dv_dy": -0.0012, "u": 0.1},
        {"du_dy": 0.006, "dv_dx": 0.006},
        {"du_dy": -0.0175, "dv_dx": 0.0175},
    ],
)
def test_imposed_motion_is_found_from_scratch(motion: dict, order: int) -> None:
    kernel = PhaseKernel(picture(), GRID, KernelSettings(order=order))
    field = kernel.measure(picture(**motion))
    ok = field.ok
    assert ok.mean() > 0.7
    u, v = true_displacement(GRID, **motion)
    assert np.max(np.abs(field.u - u)[ok]) < 3e-3
    assert np.max(np.abs(field.v - v)[ok]) < 3e-3
    for name in ("du_dx", "du_dy", "dv_dx", "dv_dy"):
        assert np.abs(np.mean(getattr(field, name)[ok]) - motion.get(name, 0.0)) < 2e-5
    assert np.isnan(field.u[~ok]).all() and (field.status[~ok] == Status.OUTSIDE).all()


def test_values_do_not_depend_on_threads() -> None:
    reference, deformed = picture(0.01, 1), picture(0.01, 2, u=0.3, du_dx=0.002)
    whole = PhaseKernel(reference, GRID, noise=41.0).measure(deformed, noise=41.0)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        alone = PhaseKernel(reference, GRID, noise=41.0).measure(deformed, noise=41.0)
    finally:
        numba.set_num_threads(threads)
    for name in FIELDS:
        assert np.array_equal(getattr(whole, name), getattr(alone, name), equal_nan=True)


@pytest.mark.parametrize(
    "part", [GRID_8.subset(every=3), GRID_8.subset(active=np.indices(GRID_8.shape)[1] > 12)]
)
def test_values_depend_on_other_zois_by_a_twentieth_of_their_sigma(part: ZoiGrid) -> None:
    """ZOIs of a tile share a motion; from a search each has its own."""
    pictures = [picture(0.01, k, u=0.3 + 0.03 * k, du_dx=0.002 + 2e-4 * k) for k in range(4)]
    fields: list[list[StrainField]] = []
    for grid in (GRID_8, part):
        kernel = PhaseKernel(pictures[0], grid, noise=41.0)
        fields.append([kernel.measure(pictures[1], noise=41.0)])
        for image in pictures[2:]:
            fields[-1].append(kernel.measure(image, start=fields[-1][-1], noise=41.0))
    for whole, few in zip(*fields, strict=True):
        off = np.stack(
            [((getattr(few, n) - getattr(whole, n)) / whole.sigma(n))[part.active] for n in FIELDS[:6]]
        )
        assert np.max(np.abs(off)) < 0.05 and np.sqrt(np.mean(off**2)) < 0.02
    assert np.array_equal(fields[0][0].u[part.active], fields[1][0].u[part.active])


def test_a_start_gives_the_same_values_as_a_search() -> None:
    kernel = PhaseKernel(picture(), GRID)
    first = kernel.measure(picture(u=0.3))
    second = kernel.measure(picture(u=0.5), start=first)
    third = kernel.measure(picture(u=0.7), start=second)
    fresh = kernel.measure(picture(u=0.7))
    assert third.ok.all()
    assert np.max(np.abs(third.u - fresh.u)) < 3e-4
    assert third.iterations.mean() < fresh.iterations.mean()


def test_predicted_uncertainty_is_the_scatter_and_noise_is_recognised() -> None:
    noise = 0.02
    kernel = PhaseKernel(picture(noise, 1), GRID, noise=noise * 4095)
    fields = [kernel.measure(picture(noise, s, u=0.3), noise=noise * 4095) for s in range(2, 12)]
    values = np.stack([f.u for f in fields])
    current = np.sqrt(np.mean(values.var(axis=0, ddof=1)))
    assert current == pytest.approx(np.sqrt(np.mean(fields[0].sigma("u", "current") ** 2)), rel=0.1)
    whole = np.sqrt(np.mean((values - 0.3) ** 2))
    assert whole == pytest.approx(np.mean(fields[0].sigma_u), rel=0.15)
    unknown = PhaseKernel(picture(noise, 1), GRID).measure(picture(noise, 2, u=0.3))
    assert np.mean(unknown.sigma_u) == pytest.approx(np.mean(fields[0].sigma_u), rel=0.1)
    assert np.median(fields[0].residual) == pytest.approx(1, abs=0.15)


def test_noise_model_scales_with_the_burst() -> None:
    one, rng = NoiseModel(gain=0.2, read=2.0), np.random.default_rng(8)

    def noisy(n: int, **motion: float) -> np.ndarray:
        clean = picture(**motion).astype(float)
        return (clean + rng.normal(0, 1, SHAPE) * np.sqrt(one.variance(clean) / n)).astype(np.float32)

    kernel = PhaseKernel(noisy(64), GRID, noise=one.averaged(64))
    single = kernel.measure(noisy(1, u=0.2), noise=one)
    burst = kernel.measure(noisy(16, u=0.2), noise=one.averaged(16))
    ratio = single.sigma("u", "current") / burst.sigma("u", "current")
    assert np.allclose(ratio, 4, rtol=0.02)
    assert np.allclose(single.sigma("u", "reference"), burst.sigma("u", "reference"), rtol=0.02)


@pytest.mark.parametrize(("gain", "offset"), [(0.7, 1600.0), (1.0, 1500.0), (1.4, -100.0)])
def test_noise_that_grows_with_the_light_is_taken_at_the_light_of_the_image(
    gain: float, offset: float
) -> None:
    """Of one pattern in another light: the scatter is that of the noise there, not at the light of the reference."""
    model, rng = NoiseModel(gain=0.5, read=1.0), np.random.default_rng(9)

    def noisy(clean: np.ndarray) -> np.ndarray:
        return clean + rng.normal(0, 1, SHAPE) * np.sqrt(model.variance(clean))

    kernel = PhaseKernel(noisy(picture().astype(float)), GRID, noise=model)
    clean = picture(u=0.3) * gain + offset
    fields = [kernel.measure(noisy(clean), noise=model) for _ in range(20)]
    scatter = np.sqrt(np.mean(np.stack([f.u for f in fields]).var(axis=0, ddof=1)))
    assert np.sqrt(np.mean(fields[0].sigma("u", "current") ** 2)) == pytest.approx(scatter, rel=0.08)
    assert np.mean(fields[0].residual) == pytest.approx(0.97, abs=0.06)  # the spline smooths a little


@pytest.mark.parametrize("gain", [0.7, 1.4])
def test_the_noise_of_the_reference_counts_with_the_contrast_as_the_fit_scales_it(gain: float) -> None:
    """The reference as recorded is subtracted, the filtered one is scaled: little of its noise is scaled with it."""
    noise, rng = 100.0, np.random.default_rng(10)
    kernel = PhaseKernel(picture() + rng.normal(0, noise, SHAPE), GRID)
    field = kernel.measure(picture(u=0.3) * gain + rng.normal(0, 5, SHAPE), noise=5.0)
    given = PhaseKernel(picture() + rng.normal(0, noise, SHAPE), GRID, noise=noise)
    assert np.mean(given.measure(picture(u=0.3) * gain, noise=5.0).residual) == pytest.approx(1, abs=0.06)
    rms = np.sqrt(np.mean((field.u - 0.3) ** 2))
    assert np.sqrt(np.mean(field.sigma("u") ** 2)) == pytest.approx(rms, rel=0.15)


def test_brightness_and_contrast_do_not_matter() -> None:
    reference = picture()
    deformed = picture(u=0.3).astype(np.float32) * 0.7 + 300
    field = PhaseKernel(reference, GRID).measure(deformed)
    assert np.nanmax(np.abs(field.u - 0.3)) < 2e-3
    assert np.nanmean(field.gain) == pytest.approx(0.7, abs=0.01)


def test_a_featureless_reference_is_refused_and_a_blank_frame_gives_no_numbers() -> None:
    noise = np.random.default_rng(0).normal(0, 3, SHAPE)
    for blank in (np.full(SHAPE, 100, np.uint8), (100 + noise).astype(np.uint8)):
        with pytest.raises(PatternError):
            PhaseKernel(blank, GRID)
    field = PhaseKernel(picture(), GRID).measure((1000 + noise).astype(np.uint16))
    assert field.n_valid == 0 and np.isnan(field.u).all()
    assert np.isnan(field.mean("exx")).all()


def test_clipped_zois_are_named() -> None:
    mask = np.zeros(SHAPE, bool)
    mask[:60, :60] = True
    reference = picture()
    field = PhaseKernel(reference, GRID, clipped=mask).measure(reference)
    assert field.status[0, 0] == Status.CLIPPED and field.status[-1, -1] == Status.OK
    field = PhaseKernel(reference, GRID).measure(reference, clipped=mask)
    assert field.status[0, 0] == Status.CLIPPED and field.status[-1, -1] == Status.OK


def test_wrong_input_is_refused_with_a_sentence() -> None:
    with pytest.raises(ValueError, match="leaves the image"):
        PhaseKernel(picture()[:100], GRID)
    kernel = PhaseKernel(picture(), GRID)
    with pytest.raises(ValueError, match="has 240 x 100 px"):
        kernel.measure(picture()[:100])
    with pytest.raises(ValueError, match="grey picture"):
        kernel.measure(np.zeros((*SHAPE, 3), np.uint8))
    with pytest.raises(ValueError, match="no ZOI"):
        PhaseKernel(picture(), GRID.subset(active=np.zeros(GRID.shape, bool)))
    with pytest.raises(ValueError, match="window"):
        KernelSettings(window="round")  # type: ignore[arg-type]


def test_a_field_of_other_places_is_neither_a_start_nor_a_reference() -> None:
    """It has as many ZOIs, and its displacements would be composed with those of others."""
    aside = ZoiGrid.cover(replace(GRID.roi, x=GRID.roi.x + 5), GRID.size, GRID.step)
    field = PhaseKernel(picture(), aside).measure(picture(u=0.2))
    kernel = PhaseKernel(picture(), GRID)
    with pytest.raises(ValueError, match="the start is of <ZoiGrid"):
        kernel.measure(picture(u=0.2), start=field)
    with pytest.raises(ValueError, match="the field is of <ZoiGrid"):
        kernel.renewed(picture(u=0.2), field)


@pytest.mark.parametrize(
    "setting", [{"order": 1.0}, {"order": True}, {"interpolant": 5.0}, {"max_iterations": 2.5}]
)
def test_settings_of_another_type_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(setting))):
        KernelSettings(**setting)


def test_inactive_zois_are_not_measured() -> None:
    few = GRID.subset(every=2)
    field = PhaseKernel(picture(), few).measure(picture(u=0.2))
    assert np.array_equal(field.status == Status.NOT_MEASURED, ~few.active)
    assert np.isnan(field.u[~few.active]).all() and np.isfinite(field.u[few.active]).all()


SMALL_GRID = ZoiGrid.cover(Roi(90, 60, 64, 64), size=32, step=16)


def measured(settings: KernelSettings, motion: dict[str, float], start: StrainField | None) -> StrainField:
    kernel = PhaseKernel(picture(), SMALL_GRID, settings, noise=1.0)
    return kernel.measure(picture(**motion), start=start, noise=1.0)


@pytest.mark.parametrize(
    "settings", [KernelSettings(), KernelSettings(order=2), KernelSettings(estimator="phase")]
)
@pytest.mark.parametrize("motion", [{}, {"u": 3.0, "dv_dy": 0.02}, {"u": 25.0, "v": -18.0}, {"u": 70.0}])
def test_the_same_as_with_the_whole_image(
    settings: KernelSettings, motion: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the motion is beyond what the start made one expect, or leads out of the picture."""
    still = StrainField.from_values(SMALL_GRID, {})
    own = measured(settings, motion, still)
    monkeypatch.setattr(ReferencePicture, "reached", lambda self, guess: self.whole)
    whole = measured(settings, motion, still)
    assert np.array_equal(own.status, whole.status)
    assert np.array_equal(own.parameters, whole.parameters, equal_nan=True)
    assert np.array_equal(own.covariance, whole.covariance, equal_nan=True)


def test_a_small_region_reaches_a_part_of_the_image() -> None:
    kernel = PhaseKernel(picture(), SMALL_GRID, noise=1.0)
    box = kernel.reference.reached(np.zeros((len(kernel.reference.index), 6)))
    assert (box.bottom - box.top) * (box.right - box.left) < 0.5 * picture().size
    assert (
        kernel.reference.reached(np.full((len(kernel.reference.index), 6), np.nan)) == kernel.reference.whole
    )


def test_zois_far_apart_ask_for_their_own_pixels() -> None:
    """The distance of the ZOIs that are measured, not of the grid they were taken from, decides what to fetch."""
    grid = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=8)
    some = np.zeros(grid.shape, bool)
    some[::2, ::3] = True
    kernel = PhaseKernel(picture(), replace(grid, active=some), noise=1.0)
    assert kernel.reference.spacing == 24
    assert (kernel.measure(picture(), noise=1.0).status[some] == Status.OK).all()


PHASE_GRID = ZoiGrid.cover(Roi(16, 16, 208, 168), size=32, step=20)
PHASE = KernelSettings(estimator="phase")


def test_phases_alone_find_shift_and_strain() -> None:
    kernel = PhaseKernel(picture(), PHASE_GRID, PHASE)
    field = kernel.measure(picture(u=0.3, v=-0.2, du_dx=0.002))
    assert field.ok.all()
    assert np.mean(field.u) == pytest.approx(0.3 + 0.002 * (np.mean(PHASE_GRID.x) - 119.5), abs=2e-4)
    assert np.mean(field.du_dx) == pytest.approx(0.002, abs=2e-5)
    assert np.mean(field.dv_dy) == pytest.approx(0, abs=2e-5)


def test_contrast_and_brightness_do_not_enter() -> None:
    kernel = PhaseKernel(picture(), PHASE_GRID, PHASE)
    plain = kernel.measure(picture(u=0.3).astype(np.float32))
    dim = kernel.measure(picture(u=0.3).astype(np.float32) * 0.6 + 500)
    assert np.max(np.abs(plain.u - dim.u)) < 5e-4


def test_predicted_uncertainty_is_the_scatter() -> None:
    kernel = PhaseKernel(picture(0.01, 1), PHASE_GRID, PHASE, noise=41.0)
    values = np.stack([kernel.measure(picture(0.01, s), noise=41.0).u for s in range(2, 12)])
    predicted = np.mean(kernel.measure(picture(0.01, 2), noise=41.0).sigma("u", "current"))
    assert np.sqrt(np.mean(values.var(axis=0, ddof=1))) == pytest.approx(predicted, rel=0.1)


def test_only_order_one() -> None:
    with pytest.raises(ValueError, match="order 1"):
        KernelSettings(estimator="phase", order=2)
