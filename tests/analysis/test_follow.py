"""From one picture to the next: prediction, a renewed reference, and the search of whole pixels."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import PhaseKernel, Roi, Status, ZoiGrid
from analysis.field.grid import Motion
from analysis.follow.prediction import MAX_AGE, motion_after
from analysis.follow.search import Blocks, find_blocks, global_shift, search
from tests.analysis.speckle import SHAPE, picture

SIGMA, LEVER, A = 0.01, 5.0, 4000
UNIT = np.array([1, 1 / LEVER, 1 / LEVER] * 2) * SIGMA


def follow(truth: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, Motion]:
    """Rms of what was not predicted, in standard deviations, frame by frame; truth (frames, modes)."""
    motion = Motion.none(np.arange(A), 6)
    values = truth[0] + UNIT * rng.standard_normal((A, 6))
    missed = []
    for now in truth[1:]:
        guess = values + motion.ahead
        values = now + UNIT * rng.standard_normal((A, 6))
        missed.append(float(np.sqrt(np.mean(((values - guess) / UNIT) ** 2))))
        motion = motion_after(motion, values, guess, np.full(A, SIGMA), LEVER)
    return np.array(missed), motion


def test_a_steady_motion_is_predicted_better_than_from_the_last_frame() -> None:
    frames = np.arange(40)[:, None]
    velocity = np.array([0.2, 1e-4, 0, -0.1, 0, 2e-4])
    missed, motion = follow(frames * velocity, np.random.default_rng(1))
    # An alpha-beta filter of 0.4 and 0.1: sqrt(1.45); the difference of two frames alone: sqrt(6).
    assert missed[-1] == pytest.approx(np.sqrt(1.45), rel=0.03)
    assert np.all(np.diff(missed[1:6]) < 0)
    assert motion.change.mean(axis=0) == pytest.approx(velocity, abs=1e-4)
    assert np.median(motion.age) == MAX_AGE


def test_after_a_jolt_it_starts_from_what_was_measured() -> None:
    truth = np.zeros((30, 6))
    truth[20:, 0] = 1.0
    missed, motion = follow(truth, np.random.default_rng(2))
    assert missed[19] > 30
    assert 30 < missed[20] < 50  # the jolt is taken for motion, once
    assert missed[22:].max() < 8
    assert missed[-1] < 2
    assert motion.age.max() < MAX_AGE


def test_a_lost_zoi_is_forgotten_and_begins_anew() -> None:
    motion = Motion(np.arange(2), np.ones((2, 6)), np.ones((2, 6)), np.full(2, 9, np.uint8))
    values = np.ones((2, 6))
    values[0, 4] = np.nan
    after = motion_after(motion, values, np.ones((2, 6)), np.full(2, SIGMA), LEVER)
    assert after.age.tolist() == [1, 10]
    assert not after.change[0].any() and not after.ahead[0].any()
    assert np.array_equal(after.change[1], np.ones(6))


def test_it_is_of_the_same_zois_or_of_none() -> None:
    motion = Motion.none(np.array([0, 2, 3]), 6)
    assert motion.fits(np.array([0, 2, 3]), 6)
    assert not motion.fits(np.array([0, 1, 3]), 6)
    assert not motion.fits(np.array([0, 2]), 6)
    assert not motion.fits(np.array([0, 2, 3]), 12)


GRID = ZoiGrid.cover(Roi(36, 36, 168, 128), size=32, step=24)
NOISE = 0.01
NOISE_GL = NOISE * 4095
HALF = {"u": 2.3, "v": -1.2, "du_dx": 0.03, "dv_dy": -0.01, "du_dy": -0.02, "dv_dx": 0.02}
WHOLE = {"u": 4.1, "v": -2.2, "du_dx": 0.06, "dv_dy": -0.02, "du_dy": -0.04, "dv_dx": 0.04}


def true_u(grid: ZoiGrid, m: dict) -> np.ndarray:
    x, y = np.meshgrid(grid.x - (SHAPE[1] - 1) / 2, grid.y - (SHAPE[0] - 1) / 2)
    return m["u"] + m["du_dx"] * x + m["du_dy"] * y


def test_results_are_composed_on_the_original_grid() -> None:
    kernel = PhaseKernel(picture(), GRID)
    first = kernel.measure(picture(**HALF))
    renewed = kernel.renewed(picture(**HALF), first)
    for start in (None, first):
        field = renewed.measure(picture(**WHOLE), start=start)
        assert field.ok.all()
        assert np.max(np.abs(field.u - true_u(GRID, WHOLE))) < 2e-3
        for name in ("du_dx", "du_dy", "dv_dx", "dv_dy"):
            assert np.mean(getattr(field, name)) == pytest.approx(WHOLE[name], abs=2e-5)
    same = renewed.measure(picture(**HALF))
    assert np.max(np.abs(same.u - first.u)) < 1e-3


def test_uncertainty_accumulates_as_the_scatter_does() -> None:
    errors, sigmas = [], []
    for seed in range(12):
        kernel = PhaseKernel(picture(NOISE, 3 * seed), GRID, noise=NOISE_GL)
        middle = picture(NOISE, 3 * seed + 1, **HALF)
        first = kernel.measure(middle, noise=NOISE_GL)
        field = kernel.renewed(middle, first).measure(picture(NOISE, 3 * seed + 2, **WHOLE), noise=NOISE_GL)
        errors.append(field.u - true_u(GRID, WHOLE))
        sigmas.append(field.sigma_u)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt(np.mean(np.square(sigmas))), rel=0.1)


def test_a_zoi_that_was_lost_stays_lost() -> None:
    kernel = PhaseKernel(picture(), GRID)
    covered = picture(**HALF).copy()
    covered[:90, :90] = 2000
    first = kernel.measure(covered)
    assert first.status[0, 0] != Status.OK and first.n_valid > 0
    field = kernel.renewed(picture(**HALF), first).measure(picture(**WHOLE))
    assert np.array_equal(field.ok, first.ok)
    assert np.isnan(field.u[0, 0])


def test_impossible_renewals_are_refused() -> None:
    kernel = PhaseKernel(picture(), GRID)
    field = kernel.measure(picture())
    with pytest.raises(ValueError, match="shape"):
        kernel.renewed(picture()[:100], field)
    blank = kernel.measure(np.full(SHAPE, 7, np.uint8))
    with pytest.raises(ValueError, match="valid ZOI"):
        kernel.renewed(picture(), blank)


def test_every_zoi_is_found_on_its_nearest_pixel() -> None:
    reference, deformed = picture().astype(np.float32), picture(u=-11.7, v=6.2).astype(np.float32)
    origins = np.array([[60, 60], [100, 90], [30, 150]], np.int64)
    found = search(reference, deformed, np.float32(reference.mean()), Roi(24, 24, 190, 150), origins, 32)
    assert found.shape == (3, 6)
    assert np.array_equal(found[:, [0, 3]], np.broadcast_to([-12, 6], (3, 2)))
    assert np.abs(found[:, [1, 2, 4, 5]]).max() < 0.02


WIDE_GRID = ZoiGrid.cover(Roi(4, 4, 232, 192), size=32, step=20)


def truth(m: dict) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(WIDE_GRID.x - (SHAPE[1] - 1) / 2, WIDE_GRID.y - (SHAPE[0] - 1) / 2)
    u = m.get("u", 0) + m.get("du_dx", 0) * x + m.get("du_dy", 0) * y
    v = m.get("v", 0) + m.get("dv_dx", 0) * x + m.get("dv_dy", 0) * y
    return u, v


def turned(degrees: float) -> dict:
    a = np.deg2rad(degrees)
    return {"du_dx": np.cos(a) - 1, "dv_dy": np.cos(a) - 1, "du_dy": -np.sin(a), "dv_dx": np.sin(a)}


@pytest.mark.parametrize("shift", [(110, 0), (-70, 60), (3, -95)])
def test_half_the_image_is_found(shift: tuple) -> None:
    motion = {"u": float(shift[0]), "v": float(shift[1])}
    reference, deformed = (picture(**m).astype(np.float32) for m in ({}, motion))
    assert global_shift(reference, deformed, WIDE_GRID.roi) == shift
    field = PhaseKernel(picture(), WIDE_GRID).measure(picture(**motion))
    assert field.n_valid > 10
    assert np.nanmax(np.hypot(field.u - shift[0], field.v - shift[1])) < 0.01


@pytest.mark.parametrize("motion", [turned(5), turned(10), {"du_dx": 0.1, "dv_dy": -0.03}])
def test_rotation_and_strain_from_nothing(motion: dict) -> None:
    field = PhaseKernel(picture(), WIDE_GRID).measure(picture(**motion))
    u, v = truth(motion)
    inside = (np.abs(WIDE_GRID.x + u - 119.5) < 98) & (np.abs(WIDE_GRID.y[:, None] + v - 99.5) < 78)
    assert field.ok[inside].mean() > 0.99
    assert np.nanmax(np.hypot(field.u - u, field.v - v)) < 0.01


@pytest.mark.parametrize("end", [turned(30), {"du_dx": 0.3, "dv_dy": -0.09}])
def test_large_deformation_through_a_sequence(end: dict) -> None:
    kernel, field = PhaseKernel(picture(), WIDE_GRID), None
    steps = 10
    for i in range(1, steps + 1):
        motion = turned(3 * i) if "du_dy" in end else {k: v * i / steps for k, v in end.items()}
        field = kernel.measure(picture(**motion), start=field)
    u, v = truth(end)
    inside = (np.abs(WIDE_GRID.x + u - 119.5) < 92) & (np.abs(WIDE_GRID.y[:, None] + v - 99.5) < 72)
    assert field is not None and field.ok[inside].mean() > 0.99
    assert np.nanmax(np.hypot(field.u - u, field.v - v)) < 0.02


def test_a_jump_within_a_sequence_is_caught() -> None:
    kernel = PhaseKernel(picture(), WIDE_GRID)
    field = kernel.measure(picture(u=40.0, v=25.0), start=kernel.measure(picture(u=0.2)))
    assert field.n_valid > 20
    assert np.nanmax(np.abs(field.u - 40)) < 0.01


def test_blocks_know_nothing_of_zois() -> None:
    reference, deformed = picture().astype(np.float32), picture(u=7.0).astype(np.float32)
    blocks = find_blocks(reference, deformed, WIDE_GRID.roi)
    assert np.all(np.abs(blocks.shift[..., 0] - 7) <= 1.5)
    planes = blocks.planes(*(which.ravel() for which in np.indices(blocks.shift.shape[:2])))
    assert np.median(np.abs(planes[:, 1:3])) < 0.01


AFFINE_BLOCKS = np.array([3.0, 0.05, -0.02, -2.0, 0.01, 0.08])
"""u, du_dx, du_dy, v, dv_dx, dv_dy at the middle."""


def affine_blocks(spoilt: float = 0.0) -> Blocks:
    """Blocks that move by ``AFFINE_BLOCKS``; one of them by ``spoilt`` px more."""
    y, x = np.arange(7.0) * 20 - 60, np.arange(9.0) * 20 - 80
    shift = np.stack([q[0] + q[1] * x + q[2] * y[:, None] for q in AFFINE_BLOCKS.reshape(2, 3)], axis=-1)
    shift[3, 4] += spoilt
    return Blocks(y, x, shift)


@pytest.mark.parametrize("spoilt", [0.0, 30.0])
def test_the_plane_of_blocks_is_that_of_their_motion_at_any_point(spoilt: float) -> None:
    """A block that leaps out of it is left out; at the corners, too."""
    at_y, at_x = np.array([-63.0, 4.0, 55.0]), np.array([77.0, -3.0, -84.0])
    found = affine_blocks(spoilt).plane_at(at_y, at_x)
    du = np.stack([q[0] + q[1] * at_x + q[2] * at_y for q in AFFINE_BLOCKS.reshape(2, 3)], axis=1)
    assert found[:, [0, 3]] == pytest.approx(du, abs=0.3)
    assert found[:, [1, 2, 4, 5]] == pytest.approx(
        np.broadcast_to(AFFINE_BLOCKS[[1, 2, 4, 5]], (3, 4)), abs=0.015
    )


def test_around_a_point_are_the_four_blocks_between_which_it_lies() -> None:
    blocks = affine_blocks()
    assert blocks.around(np.array([5.0]), np.array([-33.0]))[0].tolist() == [
        blocks.shift[r, c].tolist() for r in (3, 4) for c in (2, 3)
    ]
