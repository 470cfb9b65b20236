"""The paper's estimator against analytic truth, its mended signs, and its known flaw."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.field.grid import Roi, ZoiGrid
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from tests.paper.estimator import PaperEstimator, PaperSettings, gaussian_windows

SIZE, MARGIN, COLUMNS, ROWS = 32, 16, 6, 4
FULL = 4095.0


def grid_of(size: int = SIZE) -> ZoiGrid:
    return ZoiGrid.cover(Roi(MARGIN, MARGIN, COLUMNS * SIZE, ROWS * SIZE), size, size)


@pytest.fixture(scope="module")
def speckle() -> Speckle:
    return Speckle((ROWS * SIZE + 2 * MARGIN, COLUMNS * SIZE + 2 * MARGIN), 2.0, seed=5)


@pytest.fixture(scope="module")
def reference(speckle: Speckle) -> np.ndarray:
    return speckle.reference() * FULL


@pytest.mark.parametrize(("u", "v"), [(0.3, 0.0), (0.0, -0.4), (2.3, -1.2)])
def test_displacement_and_its_signs(speckle: Speckle, reference: np.ndarray, u: float, v: float) -> None:
    found = PaperEstimator(reference, grid_of()).measure(speckle.fast(Affine(u, v)) * FULL)
    # The paper's own figures: resolution 0.025 px, here a bias towards zero beside it.
    assert np.mean(found.u) == pytest.approx(u, abs=0.04)
    assert np.mean(found.v) == pytest.approx(v, abs=0.04)
    assert np.std(found.u) < 0.04
    assert found.frequencies.min() > 10


@pytest.mark.parametrize("name", ["du_dx", "du_dy", "dv_dx", "dv_dy"])
def test_each_gradient_alone(name: str) -> None:
    """About the centre of the ZOI, so that nothing has to be translated first."""
    speckle = Speckle((96, 96), 2.0, seed=3)
    middle = {"x0": 47.5, "y0": 47.5}
    grid = ZoiGrid.cover(Roi(16, 16, 64, 64), 64, 64)
    estimator = PaperEstimator(speckle.reference() * FULL, grid)
    found = estimator.measure(speckle.fast(Affine(**middle, **{name: 1e-3})) * FULL)
    for other in ("du_dx", "du_dy", "dv_dx", "dv_dy"):
        assert getattr(found, other)[0, 0] == pytest.approx(1e-3 * (other == name), abs=1.2e-4), other
    assert found.exx is found.du_dx
    assert found.eyy is found.dv_dy
    assert found.exy[0, 0] == pytest.approx((found.du_dy + found.dv_dx)[0, 0] / 2)
    assert found.omega[0, 0] == pytest.approx((found.dv_dx - found.du_dy)[0, 0] / 2)


def test_linear_overlay_looks_like_strain() -> None:
    """Half a pixel of pure translation shows the strain -a(1-a)/sigma^2 (docs/method.md)."""
    speckle = Speckle((96, 288), 3.0, seed=8)
    grid = ZoiGrid.cover(Roi(16, 16, 256, 64), 64, 64)
    found = PaperEstimator(speckle.reference() * FULL, grid).measure(speckle.fast(Affine(0.5)) * FULL)
    assert np.mean(found.exx) == pytest.approx(-0.25 / (64 / 6) ** 2, rel=0.3)
    assert abs(np.mean(found.eyy)) < 3e-4


def test_overlay_by_whole_pixels_interpolates_nothing() -> None:
    speckle = Speckle((96, 288), 3.0, seed=8)
    grid = ZoiGrid.cover(Roi(16, 16, 256, 64), 64, 64)
    deformed = speckle.fast(Affine(2.1)) * FULL
    errors = {}
    for overlay in ("linear", "whole-pixel"):
        settings = PaperSettings(overlay=overlay)  # type: ignore[arg-type]
        errors[overlay] = abs(
            np.mean(PaperEstimator(speckle.reference() * FULL, grid, settings).measure(deformed).exx)
        )
    assert errors["whole-pixel"] < 0.3 * errors["linear"], errors
    with pytest.raises(ValueError, match="overlay"):
        PaperSettings(overlay="cubic")  # type: ignore[arg-type]


def test_iterating_from_a_large_strain_comes_closer() -> None:
    speckle = Speckle((96, 96), 3.0, seed=4)
    grid = ZoiGrid.cover(Roi(16, 16, 64, 64), 64, 64)
    deformed = speckle.fast(Affine(du_dx=5e-2, x0=47.5, y0=47.5)) * FULL
    errors = []
    for n in (1, 5):
        estimator = PaperEstimator(speckle.reference() * FULL, grid, PaperSettings(iterations=n))
        errors.append(abs(estimator.measure(deformed).exx[0, 0] - 5e-2))
    assert errors[1] < 0.5 * errors[0], errors


def test_windows_are_derivatives() -> None:
    window, slope_x, slope_y = gaussian_windows(33)
    # By the position of the centre: minus the derivative along the pixels.
    assert np.allclose(slope_x[5:-5, 5:-5], -np.gradient(window, axis=1)[5:-5, 5:-5], atol=2e-3)
    assert np.allclose(slope_y, slope_x.T)


def test_inactive_and_featureless(reference: np.ndarray) -> None:
    grid = grid_of().subset(every=2)
    found = PaperEstimator(reference, grid).measure(reference)
    assert np.isnan(found.u[~grid.active]).all()
    assert np.allclose(found.u[grid.active], 0, atol=1e-9)
    blank = np.full(reference.shape, 7.0)
    assert np.isnan(PaperEstimator(blank, grid).measure(blank).u).all()


def test_refusals(reference: np.ndarray) -> None:
    with pytest.raises(ValueError, match="does not cover"):
        PaperEstimator(reference[:40], grid_of())
    with pytest.raises(ValueError, match="the reference"):
        PaperEstimator(reference, grid_of()).measure(reference[:-1])
    with pytest.raises(ValueError, match="amplitude_floor"):
        PaperSettings(amplitude_floor=0)
    with pytest.raises(ValueError, match="iterations"):
        PaperSettings(iterations=0)


def phase_slope(image: np.ndarray, kx: float, ky: float) -> tuple[float, float]:
    """d(phase)/dx of one frequency by eq. (7) and (9), mended, and its amplitude."""
    windows = gaussian_windows(len(image))
    x = np.arange(len(image)) - (len(image) - 1) / 2
    wave = np.exp(-1j * (kx * x + ky * x[:, None]))
    plain, slope = ((window * image * wave).sum() for window in windows[:2])
    return float((slope * np.conj(plain)).imag / abs(plain) ** 2), float(abs(plain))


def test_equation_8_on_a_grid_needs_the_inverse_factor() -> None:
    pitch, strain, x = 8.0, 1e-3, np.arange(64) - 31.5
    k = 2 * np.pi / pitch
    before, after = (phase_slope(np.tile(np.cos(k * x / (1 + e)), (64, 1)), k, 0)[0] for e in (0.0, strain))
    assert -(after - before) / k == pytest.approx(strain, rel=0.04)
    assert -(after - before) * k == pytest.approx(0.6e-3, rel=0.05)  # as printed


def test_on_a_random_pattern_single_frequencies_do_not_give_the_strain() -> None:
    """Even mended, eq. (7)-(9) frequency by frequency fail: neighbouring carriers leak into each other."""
    speckle, strain = Speckle((96, 96), 2.0, seed=3), 1e-3
    inner = np.s_[16:80, 16:80]
    window = gaussian_windows(64)[0]
    pictures = [speckle.fast(Affine(du_dx=e, x0=47.5, y0=47.5))[inner].astype(float) for e in (0.0, strain)]
    before, after = (picture - np.average(picture, weights=window) for picture in pictures)
    grid = 2 * np.pi * np.fft.fftfreq(64)
    band = [(kx, ky) for kx in grid for ky in grid if kx > 0.3 and np.hypot(kx, ky) < 0.7 * np.pi]
    found = [(phase_slope(before, *k), phase_slope(after, *k), k[0]) for k in band]
    strongest = max(a[1] for a, _, _ in found)
    ratios = [-(b[0] - a[0]) / kx / strain for a, b, kx in found if a[1] > 0.05 * strongest]
    assert len(ratios) > 100
    assert np.median(ratios) < 0.75
    assert np.min(ratios) < -1
    assert np.max(ratios) > 5


def test_the_pull_towards_zero_is_that_of_theory() -> None:
    """r^2/s_a^2 of the displacement, s_a^2 = 16^2/6 px^2 for a bi-triangular window of 32 px (docs/method.md)."""
    shape = (6 * 48, 12 * 48)
    speckle = Speckle(shape, 2.0, seed=12)
    grid = ZoiGrid.cover(Roi(8, 8, shape[1] - 16, shape[0] - 16), 32, 32)
    found = PaperEstimator(speckle.reference() * FULL, grid).measure(speckle.fast(Affine(0.2)) * FULL)
    assert 1 - np.mean(found.u) / 0.2 == pytest.approx(4 / (16**2 / 6), rel=0.12)
