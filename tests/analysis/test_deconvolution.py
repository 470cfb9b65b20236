"""Maps with the window's blur removed: response and noise as in theory, also at gaps."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from scipy.ndimage import convolve1d

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from analysis.evaluate.deconvolution import deconvolved, effect, response
from analysis.field.grid import profile
from tests.accuracy.truth import Speckle, digitise, field

GRID = ZoiGrid.cover(Roi(0, 0, 400, 300), size=36, step=4)
SIGMA = 36 / 6
RNG = np.random.default_rng(11)


def wave(period: float) -> np.ndarray:
    return np.broadcast_to(np.sin(2 * np.pi * GRID.x / period), GRID.shape)


def amplitude(values: np.ndarray, period: float) -> float:
    inner = np.s_[20:-20, 20:-20]
    shape = wave(period)[inner]
    return float(np.sum(values[inner] * shape) / np.sum(shape**2))


def ragged(share: float = 0.3) -> np.ndarray:
    """A map's gaps: a hole, a torn border and points here and there."""
    gaps = np.random.default_rng(3).random(GRID.shape) < share
    gaps[20:32, 30:48] = True
    gaps[:, :3] = True
    return gaps


def design(kept: float, steps: int) -> float:
    """The chance of at least four heads in steps + 4 throws: the closed form, written another way."""
    n = steps + 4
    return sum(comb(n, j) * kept**j * (1 - kept) ** (n - j) for j in range(4, n + 1))


@pytest.mark.parametrize("steps", [1, 3, 7, 15])
@pytest.mark.parametrize("period", [26.0, 40.0, 80.0])
def test_a_sine_comes_back_as_designed(steps: int, period: float) -> None:
    kept = np.exp(-2 * np.pi**2 * SIGMA**2 / period**2)
    assert response([period], GRID, steps)[0] == pytest.approx(design(kept, steps), abs=0.015)
    found = deconvolved(kept * wave(period), GRID, steps)
    assert amplitude(found, period) == pytest.approx(response([period], GRID, steps)[0], abs=0.01)


@pytest.mark.parametrize(("steps", "sharpened"), [(2, 1), (2, 4), (7, 2)])
@pytest.mark.parametrize("period", [30.0, 40.0, 80.0])
def test_a_sharpened_response_is_the_smooth_step_of_the_other(
    steps: int, sharpened: int, period: float
) -> None:
    kept = design(float(np.exp(-2 * np.pi**2 * SIGMA**2 / period**2)), steps)
    for _ in range(sharpened):
        kept = 3 * kept**2 - 2 * kept**3
    assert response([period], GRID, steps, sharpened)[0] == pytest.approx(kept, abs=0.04)
    found = deconvolved(np.exp(-2 * np.pi**2 * SIGMA**2 / period**2) * wave(period), GRID, steps, sharpened)
    assert amplitude(found, period) == pytest.approx(response([period], GRID, steps, sharpened)[0], abs=0.02)


def test_sharpening_lowers_the_product_of_resolution_and_noise_towards_its_least() -> None:
    """In noise over gradient; sqrt(2 pi) is that of a disc of frequencies, which no flat response undercuts."""
    unit = 0.399 / SIGMA
    products = [
        (e := effect(GRID, steps, sharpened)).l10 * e.noise * unit
        for steps, sharpened in ((2, 0), (2, 1), (2, 2), (2, 3), (2, 4))
    ]
    assert products == pytest.approx([3.44, 3.02, 2.81, 2.70, 2.63], rel=0.015)
    assert min(products) > np.sqrt(2 * np.pi)


def test_more_steps_resolve_finer_and_are_noisier() -> None:
    effects = [effect(GRID, steps) for steps in (1, 2, 3, 7, 15)]
    assert np.all(np.diff([e.l10 for e in effects]) < 0)
    assert np.all(np.diff([e.noise for e in effects]) > 0)
    # Three steps: little more than half the length for hardly more noise, and less in strain.
    three = effects[2]
    assert three.l10 == pytest.approx(7.7 * SIGMA, rel=0.01)
    assert three.noise == pytest.approx(1.05, abs=0.01)
    assert three.noise_gradient == pytest.approx(0.85, abs=0.01)
    as_measured = effect(GRID, 0)
    assert as_measured.noise == pytest.approx(1) == as_measured.noise_gradient
    assert as_measured.l10 == pytest.approx(13.69 * SIGMA, rel=0.015)


@pytest.mark.parametrize(("steps", "sharpened"), [(3, 0), (7, 0), (2, 3)])
@pytest.mark.parametrize(("moment", "name"), [(0, "noise"), (1, "noise_gradient")])
def test_noise_grows_as_predicted(steps: int, sharpened: int, moment: int, name: str) -> None:
    """White noise in the picture, weighed as the measurement weighs it."""
    line = profile("gaussian", GRID.size)
    x = np.arange(GRID.size) - (GRID.size - 1) / 2
    before, after = [], []
    for _ in range(20):
        blurred = convolve1d(RNG.normal(size=(300, 400)), line, axis=0)
        blurred = convolve1d(blurred, line * x**moment, axis=1)
        m = blurred[:: GRID.step, :: GRID.step][: GRID.shape[0], : GRID.shape[1]]
        before.append(m[12:-12, 12:-12])
        after.append(deconvolved(m, GRID, steps, sharpened)[12:-12, 12:-12])
    gain = np.std(after) / np.std(before)
    assert gain == pytest.approx(getattr(effect(GRID, steps, sharpened), name), rel=0.03)


@pytest.mark.parametrize(("steps", "sharpened"), [(0, 0), (3, 0), (7, 0), (2, 4)])
def test_planes_stay_as_they_are_even_beside_gaps(steps: int, sharpened: int) -> None:
    plane = 0.01 + 2e-4 * GRID.x - 3e-4 * GRID.y[:, None]
    values = np.where(ragged(), np.nan, plane)
    values[25, 39] = plane[25, 39]  # alone in the hole
    found = deconvolved(values, GRID, steps, sharpened)
    assert np.array_equal(np.isnan(found), np.isnan(values))
    assert np.nanmax(np.abs(found - values)) < 1e-9


@pytest.mark.parametrize(
    ("steps", "sharpened"), [(7, 0), (15, 0), pytest.param(2, 4, marks=pytest.mark.slow), (7, 2)]
)
def test_beside_gaps_no_noise_grows_more_than_the_worst_wave_of_a_whole_map(
    steps: int, sharpened: int
) -> None:
    worst = max(design(kept, steps) / kept for kept in np.linspace(0.01, 1, 100))
    values = RNG.normal(size=(60, *GRID.shape))
    values[:, ragged(0.6)] = np.nan
    found = np.stack([deconvolved(v, GRID, steps, sharpened) for v in values])
    # Of 60 draws a standard deviation is known to 9 %, and the largest of 2500 is sought.
    assert np.nanmax(np.sqrt(np.mean(found**2, axis=0))) < 1.35 * worst


def test_an_edge_overshoots_by_a_few_percent() -> None:
    line = np.cumsum(profile("gaussian", 36))
    edge = np.interp(GRID.x - GRID.x[44], np.arange(36) - 17.0, line / line[-1])
    for steps, most in ((3, 0.065), (7, 0.08), (15, 0.09)):
        found = deconvolved(np.broadcast_to(edge, GRID.shape), GRID, steps)
        assert 0.04 < found.max() - 1 < most
        assert -most < found.min() < -0.04


def test_it_is_linear() -> None:
    a, b = RNG.normal(size=(2, *GRID.shape))
    a[ragged()] = np.nan
    both = deconvolved(2 * a - 3 * b, GRID)
    apart = 2 * deconvolved(a, GRID) - 3 * deconvolved(np.where(np.isnan(a), np.nan, b), GRID)
    assert np.allclose(both, apart, atol=1e-9, equal_nan=True)


def test_a_measured_wave_comes_back() -> None:
    """From pictures: the kernel's own blur is the one that is taken off, of u and du_dx alike."""
    shape, period, size = (120, 320), 40.0, 32
    rate = 2 * np.pi / period
    truth = lambda x, y: (0.05 * np.sin(rate * x), 0 * y)  # noqa: E731
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    pattern = Speckle(2.0, 5)
    x0, y0 = (shape[1] - 1) / 2, (shape[0] - 1) / 2
    zois = ZoiGrid.cover(Roi(0, 0, shape[1], shape[0]), size, 4)
    kernel = PhaseKernel(digitise(pattern.at(x - x0, y - y0), 12), zois, KernelSettings())
    found = kernel.measure(digitise(pattern.at(*field(shape, truth)), 12))
    inner = np.s_[6:-6, 12:-12]
    for values, shape_of in ((found.u, 0.05 * np.sin(rate * (zois.x - x0))),
                             (found.du_dx, 0.05 * rate * np.cos(rate * (zois.x - x0)))):  # fmt: skip
        there = np.broadcast_to(shape_of, zois.shape)[inner]
        sharp = deconvolved(values, zois, 7)[inner]
        assert np.sum(values[inner] * there) / np.sum(there**2) < 0.76
        assert np.sum(sharp * there) / np.sum(there**2) == pytest.approx(0.98, abs=0.04)


def test_what_cannot_be_deconvolved_is_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        deconvolved(np.zeros((3, 3)), GRID)
    coarse = ZoiGrid.cover(Roi(0, 0, 400, 300), 32, 16)
    with pytest.raises(ValueError, match="too far apart"):
        deconvolved(np.zeros(coarse.shape), coarse)
    with pytest.raises(ValueError, match="negative"):
        deconvolved(np.zeros(GRID.shape), GRID, -1)
    with pytest.raises(ValueError, match="negative"):
        effect(GRID, -1)
    with pytest.raises(ValueError, match="sharpenings must not be negative"):
        response([40.0], GRID, 3, -1)
