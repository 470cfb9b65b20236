"""The fit of a ZOI: residual and covariances, shapes that it cannot follow, the noise of means, and the verdict."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, Status, ZoiGrid
from analysis.field import profile
from analysis.field.grid import WINDOWS, Window
from analysis.fit.assembly import RUN, ExpectedNoise, clipped_share, expect, scale, weigh, weigh_blur
from analysis.fit.kernel_args import (
    NUISANCES,
)
from analysis.fit.noise_bias import noise_bias
from analysis.fit.shapes import shapes_of
from analysis.fit.verdict import squared_stretch
from analysis.kernel.images import as_model
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution
from tests.accuracy import rejection
from tests.accuracy.truth import Speckle, affine, digitise, pixels


def test_a_zoi_is_weighed_by_the_noise_of_both_images() -> None:
    measured = np.array([True, False, True])
    left, freedom, gain = np.array([8.0, 1.0, 3.0]), np.array([2.0, 1.0, 4.0]), np.array([0.5, 1.0, 0.01])
    reference, current = np.array([4.0, 1.0, 2.0]), np.array([3.0, 1.0, 1.0])
    values, (residual, first, whole) = np.zeros((3, 6)), np.empty((3, 3), np.float32)
    values[2] = 5.0, 0.5, 0.2, -7.0, -0.1, -0.2  # of u, its gradients, v and its
    share = np.array([1.0, 1.0, 0.5])
    weigh(measured, left, freedom, gain, reference, current, share, values, residual, first, whole)
    assert np.allclose(residual, [4 / (1 + 3), 0.5, 0.75 / (0.5 * (2e-4 + 1))])
    assert np.array_equal(first, [4, np.nan, 2], equal_nan=True)
    # In grey levels of the reference, by a gain of 0.1 at least, over so many pixels as one becomes.
    assert np.allclose(whole, [4 + 3 / 0.25, np.nan, 2 + 1 / 0.01 / (1.5 * 0.8 + 0.2 * 0.1)], equal_nan=True)


def test_unit_covariances_are_scaled_whatever_their_number() -> None:
    rng = np.random.default_rng(0)
    for count in (1, RUN, RUN + 5):
        unit = rng.normal(size=(21, count)).astype(np.float32)
        first, whole = rng.random((2, count)).astype(np.float32)
        whole[0] = np.nan
        out = np.empty((2, 21, count), np.float32)
        colour = rng.random(21).astype(np.float32)
        scale(unit, colour, first, whole, out[0], out[1])
        assert out[0] == pytest.approx(colour[:, None] * unit * first)
        assert out[1] == pytest.approx(colour[:, None] * unit * whole, nan_ok=True)


def test_it_is_the_weight_of_the_marked_pixels() -> None:
    rng = np.random.default_rng(0)
    clipped = rng.random((60, 80)) < 0.1
    line = profile("gaussian", 32)
    first = np.array([[0, 0], [28, 48], [7, 13], [-5, 70], [40, -3]], np.int64)
    inside = np.clip(first, 0, [60 - 32, 80 - 32])
    weight = np.outer(line, line) / line.sum() ** 2
    expected = [float((weight * clipped[y : y + 32, x : x + 32]).sum()) for y, x in inside]
    np.testing.assert_allclose(clipped_share(clipped, first, line), expected, rtol=1e-5)


def test_nothing_marked_is_nothing() -> None:
    share = clipped_share(np.zeros((40, 40), bool), np.zeros((3, 2), np.int64), profile("uniform", 16))
    assert (share == 0).all()


SHAPE = (256, 256)
GRID = ZoiGrid.cover(Roi(48, 48, 160, 160), 32, 16)


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("size", [17, 32, 57, 64])
def test_the_polynomials_are_orthonormal_under_the_window(window: Window, size: int) -> None:
    line = profile(window, size)
    shapes = shapes_of(line, size + 8)
    xi = shapes.powers[1, :size] / line
    along = np.stack([np.polynomial.polynomial.polyval(xi, c) for c in shapes.mix])
    assert (along * line) @ along.T / line.sum() == pytest.approx(np.eye(4), abs=1e-5)
    assert shapes.rows[:, :size] == pytest.approx(along * line, abs=1e-5)
    assert not shapes.rows[:, size:].any() and not shapes.powers[:, size:].any()


def bending(
    u: np.ndarray, noise: float = 0.0, order: int = 1, gain: float = 1.0
) -> tuple[np.ndarray, Solution]:
    """What the fit leaves, px^2, where the displacement is u(x, y)."""
    x, y = pixels(SHAPE)
    rng = np.random.default_rng(4)
    pattern = Speckle(2.0, 6)
    reference = digitise(pattern.at(x, y), 12, noise, rng)
    deformed = digitise(gain * pattern.at(x - u, y), 12, noise, rng)
    model = as_model(float(np.hypot(noise * 4095, 0.3)))
    ready = ReferencePicture.first(
        reference.astype(np.float32), GRID, KernelSettings(order=order), model, None
    )
    image = deformed.astype(np.float32)
    solution = Solution(ready, image, model, ready.searched(image))
    return solution.found.bending, solution


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("gain", [1.0, 0.7])
def test_an_affine_motion_leaves_nothing(order: int, gain: float) -> None:
    x, y = pixels(SHAPE)
    found, _ = bending(0.3 + 0.004 * x - 0.003 * y, order=order, gain=gain)
    assert np.sqrt(found.max()) < 0.003


def test_a_parabola_is_found_with_the_error_that_it_makes() -> None:
    x, y = pixels(SHAPE)
    found, _ = bending(0.0015 * (x**2 + y**2) / 2)
    # u at the centre is wrong by half the curvatures times the second moment of the window.
    line, at = profile("gaussian", 32), np.arange(32) - 15.5
    assert np.sqrt(np.median(found)) == pytest.approx(0.0015 * (line @ at**2) / line.sum(), rel=0.15)


def test_noise_alone_leaves_what_is_expected_of_it() -> None:
    x, _ = pixels(SHAPE)
    found, solution = bending(0.2 + 0 * x, noise=0.02)
    reference = solution.reference
    unit = reference.share_variance * 2 * ((0.02 * 4095) ** 2 + 0.1)
    expected = unit.sum(axis=1) * reference.prepared.shapes.noise[0]
    assert np.mean(found / expected) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("angle", [0, 30, 45, 90])
def test_a_jump_through_a_zoi_is_uneven(angle: float) -> None:
    x, y = pixels(SHAPE)
    along = np.cos(np.deg2rad(angle)) * x + np.sin(np.deg2rad(angle)) * y
    pattern, rng, noise = Speckle(2.0, 6), np.random.default_rng(4), 0.02
    reference = digitise(pattern.at(x, y), 12, noise, rng)
    deformed = digitise(pattern.at(x - np.where(along > 0, 0.6, -0.6), y), 12, noise, rng)
    field = PhaseKernel(reference, GRID, noise=noise * 4095).measure(deformed, noise=noise * 4095)
    gx, gy = np.meshgrid(GRID.x - 127.5, GRID.y - 127.5)
    distance = np.abs(np.cos(np.deg2rad(angle)) * gx + np.sin(np.deg2rad(angle)) * gy)
    assert np.mean(field.status[distance < 5] != Status.OK) > 0.95
    assert (field.status == Status.UNEVEN).any()
    assert np.mean(field.ok[distance > 20]) > 0.99


NOISE_GL = 2.5
PAIRS = 240
NAMES = ("exx", "eyy", "exy", "u")


def scatter_over_predicted(
    size: int, step: int, count: int, order: int, noise: float | None, where: np.ndarray | None = None
) -> dict[str, float]:
    """Root mean square of means of a still picture over their own uncertainty, new noise in both pictures."""
    side = size + step * (count - 1) + 16
    pattern = Speckle(2.0, 5, span=side + 60).at(*affine((side, side)))
    clean = 128 + 40 * (pattern - pattern.mean()) / pattern.std()
    grid = ZoiGrid.cover(Roi(8, 8, side - 16, side - 16), size, step)
    rng = np.random.default_rng(size + step)
    ratios: dict[str, list[float]] = {name: [] for name in NAMES}
    for _ in range(PAIRS // 8):
        first = (clean + rng.normal(0, NOISE_GL, clean.shape)).astype(np.float32)
        kernel = PhaseKernel(first, grid, KernelSettings(order=order), noise=noise)
        start = kernel.measure(first, noise=noise)
        for _ in range(8):
            second = (clean + rng.normal(0, NOISE_GL, clean.shape)).astype(np.float32)
            field = kernel.measure(second, start=start, noise=noise)
            for name in NAMES:
                value, sigma = field.mean(name, where)
                ratios[name].append(value / sigma)
    return {name: float(np.sqrt(np.mean(np.square(found)))) for name, found in ratios.items()}


@pytest.mark.parametrize(
    ("size", "step", "count", "order", "noise"),
    [
        pytest.param(32, 4, 17, 1, NOISE_GL, marks=pytest.mark.slow), (32, 8, 13, 1, NOISE_GL),
        pytest.param(32, 8, 13, 1, None, marks=pytest.mark.slow),
        pytest.param(32, 16, 7, 1, NOISE_GL, marks=pytest.mark.slow),
        pytest.param(48, 12, 9, 2, NOISE_GL, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_means_scatter_as_predicted(
    size: int, step: int, count: int, order: int, noise: float | None
) -> None:
    """Eight pictures share a reference, so a ratio is known to about 8 %; by overlap alone it would be 1.3 to 1.5."""
    found = scatter_over_predicted(size, step, count, order, noise)
    assert all(0.8 < ratio < 1.22 for ratio in found.values()), found
    assert 0.87 < np.mean([found[name] for name in ("exx", "eyy", "exy")]) < 1.13, found


@pytest.mark.slow
def test_a_gauge_of_any_shape() -> None:
    where = np.add.outer(np.abs(np.arange(13) - 6), np.abs(np.arange(13) - 6)) <= 5
    found = scatter_over_predicted(32, 8, 13, 1, NOISE_GL, where)
    assert 0.87 < np.mean([found[name] for name in ("exx", "eyy", "exy")]) < 1.13, found


def test_dense_grids_are_not_more_certain_than_they_are() -> None:
    """The same region with more ZOIs in it makes its mean hardly more certain."""
    image = np.asarray(128 + 12 * Speckle(2.0, 5, span=300).at(*affine((160, 160))), np.float32)
    sigmas = []
    for step in (4, 8):
        kernel = PhaseKernel(image, ZoiGrid.cover(Roi(8, 8, 128, 128), 32, step), noise=1.0)
        sigmas.append(kernel.measure(image, noise=1.0).mean("eyy")[1])
    assert sigmas[0] > 0.9 * sigmas[1], sigmas


def test_factors_are_cached_within_bounds() -> None:
    image = np.asarray(128 + 12 * Speckle(2.0, 5, span=300).at(*affine((160, 160))), np.float32)
    grid = ZoiGrid.cover(Roi(8, 8, 128, 128), 32, 16)
    sums = PhaseKernel(image, grid, noise=1.0).reference.sums
    assert sums is not None
    rng = np.random.default_rng(0)
    masks = [rng.random(grid.shape) < 0.5 for _ in range(100)]
    once = [sums.factor("exx", mask) for mask in masks]
    assert once == [sums.factor("exx", mask) for mask in masks]
    assert len(sums._made) <= 64
    single = np.zeros(grid.shape, bool)
    single[2, 2] = True
    assert sums.factor("exx", single) == 1.0


def test_the_estimator_by_phases_has_the_overlap_alone() -> None:
    image = np.asarray(128 + 12 * Speckle(2.0, 5, span=300).at(*affine((160, 160))), np.float32)
    grid = ZoiGrid.cover(Roi(8, 8, 128, 128), 32, 32)
    kernel = PhaseKernel(image, grid, KernelSettings(estimator="phase"), noise=1.0)
    assert kernel.reference.sums is None
    assert kernel.measure(image, noise=1.0).mean("exx")[1] > 0


def test_noise_is_expected_with_the_gain_within_its_limits_and_not_below_rounding() -> None:
    gain, out = np.array([[2.0, 0], [9.0, 0], [0.1, 0], [np.nan, 0]])[:, 0], ExpectedNoise(*np.empty((2, 4)))
    expect(gain, (1.0, 1.0), np.full(4, 3.0), np.full(4, 0.01), 0.08, out)
    for of_both in out:  # nothing is filtered
        assert of_both == pytest.approx([12.01, 75.01, 0.08, np.nan], nan_ok=True)
    expect(gain, (0.5, 0.25), np.full(4, 3.0), np.full(4, 0.01), 0.08, out)
    left = [3 * (1 + more * 0.5) ** 2 + 0.01 for more in (1, 4, -0.9)]
    assert out.left == pytest.approx([*left, np.nan], nan_ok=True), "by the reference that is half as noisy"
    assert out.felt == pytest.approx([12.01, 75.01, 0.08, np.nan], nan_ok=True)


def test_the_uncertainty_of_a_blur_is_unknown_where_nothing_was_measured() -> None:
    out, whole = np.empty(3, np.float32), np.array([4.0, np.nan, -1e-9], np.float32)
    weigh_blur(np.full(3, 0.25, np.float32), whole, out)
    assert out == pytest.approx([1.0, np.nan, 0.0], nan_ok=True)


def test_the_stretch_of_a_strain_is_free_of_rotation() -> None:
    c, s, stretched = np.cos(0.5), np.sin(0.5), 1.1
    turned = np.array([[3.0, stretched * c - 1, -s, -2.0, stretched * s, c - 1]])
    assert squared_stretch(turned, 0, 5.0) == pytest.approx((5.0 * (stretched**2 - 1) / 2) ** 2)


@pytest.mark.slow
@pytest.mark.parametrize("case", [c for c in rejection.CASES if c != "hole"])
def test_wrong_zois_are_flagged_and_good_ones_kept(case: str) -> None:
    found = rejection.count(case, radius=2.0, size=32, noise=0.01, step=16)
    assert found.accepted <= 0.03 * (found.accepted + found.flagged)
    assert found.good_rejected <= 0.01 * found.good


def test_a_glare_that_shifts_the_pattern_a_little_is_seen() -> None:
    found = rejection.count("glare", radius=3.0, size=64, noise=0.01)  # 19 by either limit alone
    assert found.accepted <= 6
    assert found.good_rejected == 0


def test_noise_of_the_reference_pretends_a_gradient_by_the_columns_of_its_own_direction() -> None:
    """Of du_dx all that is taken, less twice the blur along x and once that across; of dv_dy along y."""
    taken = np.zeros((1, 6 + NUISANCES), np.float32)
    taken[0, 0], taken[0, -3:] = 10.0, (1.0, 2.0, 0.5)  # of u, and of the blur along x, along y and across
    bias = noise_bias(np.eye(6 + NUISANCES, dtype=np.float32)[None], taken, np.zeros(3), 1.0, 16)[0]
    everything = 10 + 1 + 2 + 0.5
    assert bias[1] == pytest.approx((everything - 2 * 1.0 - 0.5) / 16)
    assert bias[5] == pytest.approx((everything - 2 * 2.0 - 0.5) / 16)
    assert not bias[[0, 2, 3, 4]].any()
