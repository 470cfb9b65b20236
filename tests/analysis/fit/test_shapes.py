"""Shapes that a ZOI cannot follow: their polynomials, and what of them is found in made-up pictures."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, Status, ZoiGrid
from analysis.field.windows import WINDOWS, Window, profile
from analysis.fit.shapes import shapes_of
from analysis.kernel.attempt import Attempt
from analysis.kernel.noise import as_model
from analysis.kernel.reference import Reference
from tests.accuracy.truth import Speckle, digitise, pixels

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
) -> tuple[np.ndarray, Attempt]:
    """What the fit leaves, px^2, where the displacement is u(x, y)."""
    x, y = pixels(SHAPE)
    rng = np.random.default_rng(4)
    pattern = Speckle(2.0, 6)
    reference = digitise(pattern.at(x, y), 12, noise, rng)
    deformed = digitise(gain * pattern.at(x - u, y), 12, noise, rng)
    model = as_model(float(np.hypot(noise * 4095, 0.3)))
    ready = Reference.first(reference.astype(np.float32), GRID, KernelSettings(order=order), model, None)
    image = deformed.astype(np.float32)
    attempt = Attempt(ready, image, model, ready.searched(image))
    return attempt.found.bending, attempt


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
    found, attempt = bending(0.2 + 0 * x, noise=0.02)
    reference = attempt.reference
    unit = reference.share_variance * 2 * ((0.02 * 4095) ** 2 + 0.1)
    expected = unit.sum(axis=1) * reference.prepared.shapes.noise[0]
    assert np.mean(found / expected) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("angle", [0, 30, 45, 90])
def test_a_jump_through_a_zoi_is_said_to_be_one(angle: float) -> None:
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
