"""Figures of a pattern against known patterns; B-splines, prefilter and warp against scipy and known functions."""

from __future__ import annotations

import math
from math import comb

import numpy as np
import pytest
from scipy import ndimage
from scipy.optimize import brentq

from analysis.compiled.vectors import LANES
from analysis.fit.iteration import compose, warp_zois
from analysis.fit.kernel_args import PictureArgs
from analysis.picture.cutting import cut_bent_row, cut_leaning_row, cut_row, displacement
from analysis.picture.pattern import (
    autocorrelation_fwhm,
    clipped_share,
    describe_pattern,
    gauge_length,
    l10_strain,
    predicted_sigma,
    resolution_length,
)
from analysis.picture.prefilter import PART, coefficients, room_for
from analysis.picture.splines import PAD, Box, basis, prefilter_poles, tap_table
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle

FULL = 4095.0


def filtered(image: np.ndarray, offset: float, box: Box, degree: int = 5) -> np.ndarray:
    """The coefficients of an image, in memory that held something else."""
    out = room_for(image.shape)
    out.fill(np.nan)
    coefficients(image, np.float32(offset), prefilter_poles(degree), box, out)
    return out


@pytest.fixture(scope="module")
def speckle() -> Speckle:
    return Speckle((300, 400), 2.5, seed=2)


@pytest.mark.parametrize("noise", [0.0, 40.0])
def test_figures_of_a_known_pattern(speckle: Speckle, noise: float) -> None:
    light = speckle.reference().astype(float) * FULL
    picture = light + noise * np.random.default_rng(0).standard_normal(light.shape)
    report = describe_pattern(picture, bits=12)
    assert report.mean == pytest.approx(0.5 * FULL, rel=0.02)
    assert report.contrast == pytest.approx(light.std(), rel=0.01)
    assert report.noise == pytest.approx(noise, rel=0.05, abs=1.0)
    # The gradient by the renderer's own shifts, not by a filter.
    h = 0.05
    slope = (speckle.fast(Affine(-h)).astype(float) - speckle.fast(Affine(h))) * FULL / (2 * h)
    assert report.gradient == pytest.approx(np.sqrt(np.mean(slope**2)), rel=0.03)
    assert report.speckle_radius == pytest.approx(2.5, rel=0.12)
    assert report.clipped == 0
    assert 0.1 < report.band < 0.71


def test_speckle_size_of_a_single_blob() -> None:
    y, x = np.mgrid[:201, :201] - 100.0
    blob = np.exp(-(x**2 + y**2) / (2 * 3.0**2))
    assert autocorrelation_fwhm(blob) == pytest.approx(4 * math.sqrt(math.log(2)) * 3.0, rel=0.05)


def test_nothing_but_noise_has_no_size() -> None:
    noise = np.random.default_rng(1).standard_normal((64, 64))
    assert math.isnan(autocorrelation_fwhm(noise, 1.1 * noise.std()))


def test_clipped_share() -> None:
    picture = np.full((20, 20), 100.0)
    picture[0, :10], picture[1, :10] = 0, 255
    assert clipped_share(picture, 8) == pytest.approx(20 / 400)


def test_closed_forms_agree_with_the_least_squares_they_stand_for(speckle: Speckle) -> None:
    """The mean over ZOIs of the sandwich formula, from exact gradients, against the closed form."""
    h, size = 0.05, 48
    gx = (speckle.fast(Affine(-h)).astype(float) - speckle.fast(Affine(h))) * FULL / (2 * h)
    gy = (speckle.fast(Affine(0, -h)).astype(float) - speckle.fast(Affine(0, h))) * FULL / (2 * h)
    x = np.arange(size) - (size - 1) / 2
    weight = np.outer(*[np.exp(-0.5 * (6 * x / size) ** 2)] * 2).ravel()
    found = []
    for top in range(0, 300 - size, size):
        for left in range(0, 400 - size, size):
            fx, fy = (g[top : top + size, left : left + size] for g in (gx, gy))
            columns = [fx, fx * x, fx * x[:, None], fy, fy * x, fy * x[:, None]]
            j = np.stack(columns).reshape(6, -1)
            inverse = np.linalg.inv(j * weight @ j.T)
            covariance = 2 * inverse @ (j * weight**2 @ j.T) @ inverse
            found.append(np.sqrt(np.diag(covariance)[[0, 1]]))
    g = np.sqrt(np.mean((gx**2 + gy**2) / 2))
    assert np.mean(found, axis=0) == pytest.approx(predicted_sigma(size, 1.0, float(g)), rel=0.08)


def test_resolution_length() -> None:
    assert resolution_length(60) == pytest.approx(136.9, abs=0.1)


def test_refusals() -> None:
    with pytest.raises(ValueError, match="grey picture"):
        describe_pattern(np.zeros((4, 4)))


RNG = np.random.default_rng(0)
IMAGE = ndimage.gaussian_filter(RNG.normal(0, 1, (70, 90)), 1.0).astype(np.float32) * 100


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_tap_weights_are_the_spline(degree: int) -> None:
    table = tap_table(degree).reshape(3, 6).astype(float)
    for fraction in (0.0, 0.3, 0.77):
        tau = fraction - 0.5
        powers = tau ** np.arange(6)
        signs = (-1.0) ** np.arange(6)
        right, left = table @ powers, table @ (powers * signs)
        found = [*left, *right[::-1]]
        expected = basis(degree, fraction - np.arange(-2.0, 4.0))
        assert np.allclose(found, expected, atol=1e-6)
        assert np.sum(found) == pytest.approx(1, abs=1e-6)


def test_taps_are_exact() -> None:
    """The outermost piece of the quintic spline is (1/2 + tau)^5 / 120; of lower degrees nothing is left over."""
    outer = [np.float32(comb(5, p) / 2 ** (5 - p) / 120) for p in range(6)]
    assert np.array_equal(tap_table(5)[:6], outer)
    assert np.array_equal(tap_table(1), [0] * 12 + [0.5, 1, 0, 0, 0, 0])
    assert not tap_table(3).reshape(3, 6)[:, 4:].any()


def test_taps_need_no_linear_algebra(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: object, **named: object) -> None:
        raise AssertionError("least squares are used")

    expected = [tap_table(degree) for degree in (1, 3, 5)]
    for place in (np.linalg, np.polynomial.polynomial):
        for name in ("lstsq", "solve", "inv", "pinv", "polyfit"):
            monkeypatch.setattr(place, name, broken, raising=False)
    tap_table.cache_clear()
    assert all(np.array_equal(tap_table(d), e) for d, e in zip((1, 3, 5), expected, strict=True))


@pytest.mark.parametrize("shape", [(70, 90), (9, 11), (2 * PART + 33, 40), (PART, 8 * LANES)])
@pytest.mark.parametrize("kind", [np.float32, np.uint8, np.uint16])
@pytest.mark.parametrize("degree", [3, 5])
def test_prefilter_is_that_of_scipy(degree: int, kind: type, shape: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(0, 256, shape).astype(kind)
    found = filtered(image, 100, Box(0, shape[0], 0, shape[1]), degree)
    expected = ndimage.spline_filter(image.astype(float) - 100, degree, mode="mirror")
    expected = np.pad(expected, PAD, mode="reflect")
    found = found[: expected.size].reshape(expected.shape)
    assert np.max(np.abs(found - expected)) < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_an_even_picture_is_its_own_coefficients(degree: int) -> None:
    found = filtered(np.full((70, 90), 150, np.uint8), 100, Box(0, 70, 0, 90), degree)[:-LANES]
    assert found == pytest.approx(50, rel=2e-6)


@pytest.mark.parametrize("box", [Box(0, 300, 33, 290), Box(70, 260, 0, 150), Box(17, 200, 120, 400)])
def test_no_coefficient_depends_on_what_else_is_filtered(box: Box) -> None:
    shape = (300, 400)
    image = np.random.default_rng(2).integers(0, 256, shape).astype(np.uint8)
    image.flags.writeable = False
    whole, part = (
        filtered(image, 100, b)[: -LANES].reshape(-1, shape[1] + 2 * PAD)
        for b in (Box(0, shape[0], 0, shape[1]), box)
    )  # fmt: skip
    inside = np.s_[PAD + box.top : PAD + box.bottom, PAD + box.left : PAD + box.right]
    assert np.array_equal(whole[inside], part[inside])


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
@pytest.mark.parametrize(("place", "finite"), [(None, True), ((70, 60), False), ((299, 399), True)])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_the_prefilter_sees_values_that_are_not_finite(
    kind: type, place: tuple[int, int] | None, finite: bool, value: float
) -> None:
    """In its box and beside it, but not where it reads nothing."""
    image = np.random.default_rng(2).integers(0, 256, (300, 400)).astype(kind)
    if place is not None and kind is np.float32:
        image[place] = value
    box, room = Box(75, 200, 65, 300), room_for(image.shape)
    seen = coefficients(image, np.float32(100), prefilter_poles(5), box, room)
    assert seen is (finite or kind is np.uint8)


@pytest.mark.parametrize(
    "motion",
    [
        (0.3, 0, 0, -0.6, 0, 0),
        (1.2, 0.01, -0.09, -2.4, 0.09, -0.02),
        (0, 0, 0, 0, 0, 0),
        (0.7, -0.03, 0.1, 0.4, -0.125, 0.02),
        (0.2, 0.2, 0.01, 0.3, 0.03, 0),
        (-0.4, -0.01, 0.06, 1.3, -0.06, 0.01),
        (0.1, 0.01, -0.3, 0.2, 0.3, 0.02),
    ],
)
@pytest.mark.parametrize("size", [16, 21, 32])
def test_warp_is_the_interpolated_image(motion: tuple, size: int) -> None:
    origin = np.array([[24, 30]])
    out = np.empty((1, size, size), np.float32)
    box = Box(0, IMAGE.shape[0], 0, IMAGE.shape[1])
    picture = PictureArgs.within(filtered(IMAGE, 0, box), IMAGE.shape, box, 0.5)
    warp_zois(picture, tap_table(5), origin, size, np.array([motion], float), out)
    x = np.arange(size) - (size - 1) / 2
    u = motion[0] + motion[1] * x + motion[2] * x[:, None]
    v = motion[3] + motion[4] * x + motion[5] * x[:, None]
    rows = 24 + np.arange(size)[:, None] + v
    columns = 30 + np.arange(size) + u
    expected = ndimage.map_coordinates(IMAGE.astype(float), [rows, columns], order=5, mode="mirror")
    assert np.max(np.abs(out[0] - expected)) < 1e-3 * np.abs(IMAGE).max()


@pytest.mark.parametrize("slope", [0.0, -0.0, 1e-18, -1e-18, 1e-9, -1e-9, 0.03, -0.03, 0.6, -0.6])
@pytest.mark.parametrize("drift", [0.0, -1e-17, 0.01, -0.2, -1.9])
def test_a_row_is_cut_into_pieces_that_cover_it(slope: float, drift: float) -> None:
    """Each pixel once, with taps around it, whatever the slopes and however close the edge of a pixel."""
    size, stride = 32, 200
    for x, y in ((60.0, 40.0), (31.3, 40.5), (60.3, 40.9999999999), (60.999999999999, 40.0), (61.5, 40.25)):
        where, how = np.empty((2 * size, 3), np.int64), np.empty((2 * size, 4), np.float32)
        n = cut_row(
            stride, size, x, drift, _reciprocal(drift), y, slope, _reciprocal(slope), 5, 0, where, how
        )  # fmt: skip
        lengths = where[:n, 2]
        assert (lengths >= 1).all() and lengths.sum() == size
        assert np.array_equal(where[:n, 1], 5 + np.cumsum(lengths) - lengths)
        for (start, at, length), (tx, sx, ty, sy) in zip(where[:n], how[:n].astype(float), strict=True):
            k = np.arange(length)
            rows, columns = start // stride + 2, start % stride + 2 + k
            assert np.all(np.abs(tx + sx * k) <= 0.5 + 1e-6) and np.all(np.abs(ty + sy * k) <= 0.5 + 1e-6)
            pixel = at - 5 + k
            assert rows + ty + 0.5 + sy * k == pytest.approx(y + slope * pixel, abs=1e-5)
            assert columns + tx + 0.5 + sx * k == pytest.approx(x + (1 + drift) * pixel, abs=1e-5)


@pytest.mark.parametrize("slope", [0.0, -0.0, 1e-18, -1e-9, 0.03, -0.03, 2 / (LANES - 1), -2 / (LANES - 1)])
@pytest.mark.parametrize("drift", [0.0, -1e-17, 0.01, -0.2, -1.9])
def test_a_leaning_row_is_cut_into_vectors_that_pass_three_rows_at_most(slope: float, drift: float) -> None:
    size, stride = 29, 200
    for x, y in ((60.0, 40.0), (31.3, 40.5), (60.3, 40.9999999999), (60.999999999999, 40.0), (61.5, 40.25)):
        where, how = np.empty((2 * size, 3), np.int64), np.empty((2 * size, 4), np.float32)
        n = cut_leaning_row(stride, size, x, drift, _reciprocal(drift), y, slope, 5, 0, where, how)
        lengths = where[:n, 2]
        assert (lengths >= 1).all() and (lengths <= LANES).all() and lengths.sum() == size
        assert np.array_equal(where[:n, 1], 5 + np.cumsum(lengths) - lengths)
        for (start, at, length), (tx, sx, ty, sy) in zip(where[:n], how[:n].astype(float), strict=True):
            k = np.arange(length)
            rows, columns = start // stride + 2, start % stride + 2 + k
            passed = ty + sy * k + 0.5
            assert np.all(np.abs(tx + sx * k) <= 0.5 + 1e-6)
            assert np.all(passed >= -1e-6) and np.all(
                passed <= (3 if abs(slope) * (LANES - 1) > 1 else 2) + 1e-6
            )
            pixel = at - 5 + k
            assert rows + passed == pytest.approx(y + slope * pixel, abs=1e-5)
            assert columns + tx + 0.5 + sx * k == pytest.approx(x + (1 + drift) * pixel, abs=1e-5)


@pytest.mark.parametrize("slope", [0.0, 1e-9, 0.03, -0.6])
@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-3, -1e-3, 0.02])
def test_a_bent_row_is_cut_into_pieces_that_cover_it(bend: float, slope: float) -> None:
    size, stride = 32, 200
    for x, y in ((60.0, 40.0), (31.3, 40.5), (60.3, 40.9999999999), (60.999999999999, 40.0), (61.5, 40.25)):
        where, how = np.empty((2 * size, 3), np.int64), np.empty((2 * size, 4), np.float32)
        n = cut_bent_row(stride, size, x, 1 + slope / 3, bend, y, slope, -bend / 2, 5, 0, where, how)
        lengths = where[:n, 2]
        assert (lengths >= 1).all() and lengths.sum() == size
        assert np.array_equal(where[:n, 1], 5 + np.cumsum(lengths) - lengths)
        for (start, at, length), (tx, sx, ty, sy) in zip(where[:n], how[:n].astype(float), strict=True):
            k, pixel = np.arange(length), at - 5 + np.arange(length)
            columns, rows = tx + (sx + bend * k) * k, ty + (sy - bend / 2 * k) * k
            assert np.all(np.abs(columns) <= 0.5 + 1e-6) and np.all(np.abs(rows) <= 0.5 + 1e-6)
            expected = x + (1 + slope / 3) * pixel + bend * pixel**2
            assert start % stride + 2.5 + k + columns == pytest.approx(expected, abs=1e-4)
            assert start // stride + 2.5 + rows == pytest.approx(
                y + (slope - bend / 2 * pixel) * pixel, abs=1e-4
            )


def _reciprocal(slope: float) -> float:
    return 1 / slope if abs(slope) > 1e-12 else 1e12


@pytest.mark.parametrize("order", [1, 2])
def test_composition_undoes_the_step(order: int) -> None:
    modes = 6 if order == 1 else 12
    p, step = (RNG.normal(0, 0.01, modes) for _ in range(2))
    if order == 2:  # exact to second order in place: keep the quadratic parts small
        p[[3, 4, 5, 9, 10, 11]] *= 1e-3
        step[[3, 4, 5, 9, 10, 11]] *= 1e-3
    x, y = 3.0, -2.0
    composed = p.copy()
    compose(composed, order, step)
    du, dv = displacement(step, order, x, y)
    u, v = displacement(p, order, x, y)
    cu, cv = displacement(composed, order, x + du, y + dv)
    assert x + du + cu == pytest.approx(x + u, abs=1e-9 if order == 1 else 2e-5)
    assert y + dv + cv == pytest.approx(y + v, abs=1e-9 if order == 1 else 2e-5)


@pytest.mark.parametrize("rows", [(0, 200), (40, 70), (3, 90), (150, 230), (-50, -20), (250, 300)])
@pytest.mark.parametrize("columns", [(0, 300), (61, 130), (270, 290)])
def test_in_a_box_the_coefficients_are_those_of_the_whole(rows: tuple, columns: tuple) -> None:
    image = np.random.default_rng(2).integers(0, 256, (200, 300)).astype(np.uint8)
    box, everything = Box.of(image.shape, rows, columns), Box(0, 200, 0, 300)
    whole = filtered(image, 100, everything)
    part = filtered(image, 100, box)
    width = image.shape[1] + 2 * PAD
    top = box.top + PAD if box.top else 0
    bottom = box.bottom + PAD + (PAD if box.bottom == 200 else 0)
    left = box.left + PAD if box.left else 0
    right = box.right + PAD + (PAD if box.right == 300 else 0)
    assert 0 <= box.top < box.bottom <= 200 and 0 <= box.left < box.right <= 300
    for y in range(top, bottom):
        assert np.array_equal(
            part[y * width + left : y * width + right], whole[y * width + left : y * width + right]
        )


def test_the_gauge_length_is_the_side_of_the_square_with_the_same_noise() -> None:
    """Of an even window its own side; of a Gaussian one of s, sqrt(24) / L^2 = 1 / (2 sqrt(pi) s^2)."""
    assert gauge_length(64, "uniform") == pytest.approx(64, rel=1e-3)
    assert gauge_length(64) == pytest.approx(math.sqrt(2 * math.sqrt(24 * math.pi)) * 64 / 6, rel=0.02)


def test_the_period_of_a_strain_that_has_lost_a_tenth() -> None:
    """Of an even window the moment of a sine, 3 (sin a - a cos a) / a^3 with a = pi size / period, is 0.9 there."""
    a = brentq(lambda a: 3 * (math.sin(a) - a * math.cos(a)) / a**3 - 0.9, 0.1, 3)
    assert l10_strain(64, "uniform") == pytest.approx(math.pi * 64 / a, rel=1e-3)
    assert l10_strain(64) == pytest.approx(resolution_length(64), rel=0.05)
