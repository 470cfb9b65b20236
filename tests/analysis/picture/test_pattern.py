"""Figures of a pattern against patterns whose figures are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.picture.pattern import (
    autocorrelation_fwhm,
    clipped_share,
    describe_pattern,
    noise_of_picture,
    predicted_sigma,
    resolution_length,
)
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle

FULL = 4095.0


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


def test_noise_of_a_picture(speckle: Speckle) -> None:
    light = speckle.reference() * FULL
    picture = light + 20 * np.random.default_rng(3).standard_normal(light.shape)
    assert noise_of_picture(picture) == pytest.approx(20, rel=0.05)


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
