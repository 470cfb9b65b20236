"""Noise that a codec has taken out of a picture: what is below it is no pattern, for the finder and for ZOIs."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.files.headers import quantisation
from analysis import PhaseKernel, Roi, ZoiGrid
from analysis.field import Status
from analysis.picture.pattern import hidden_noise, noise_of_picture
from analysis.quality.specimen import find_specimen
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle

NOISE, SHAPE = 0.7, (384, 640)
INSIDE = slice(224, 416)


def still(quality: int) -> list[tuple[NDArray[Any], tuple[int, ...]]]:
    """Two JPEGs of a speckled strip before a blurred background; nothing moves."""
    rng = np.random.default_rng(8)
    back = cv2.GaussianBlur(rng.normal(0, 1, SHAPE), (0, 0), 9)
    strip = cv2.GaussianBlur(rng.normal(0, 1, (1, SHAPE[1])), (0, 0), 25)
    scene = 90 + 3 * back / back.std() + 25 * strip / strip.std()
    speckle = Speckle(SHAPE, radius=2.0, seed=5).render(Affine(), SHAPE)[:, INSIDE]
    scene[:, INSIDE] = 100 + 60 * (speckle - speckle.mean())
    found = []
    for _ in range(2):
        picture = np.clip(np.rint(scene + rng.normal(0, NOISE, SHAPE)), 0, 255).astype(np.uint8)
        coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        steps = quantisation(coded.tobytes())
        assert steps is not None
        found.append((np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)), steps))
    return found


@pytest.mark.parametrize("quality", [97, 92, 80])
def test_a_blurred_background_in_a_jpeg_is_no_pattern(quality: int) -> None:
    (first, steps), (second, _) = still(quality)
    least = hidden_noise(first, steps)
    assert noise_of_picture(first) < NOISE < least
    grid = ZoiGrid.cover(Roi(16, 16, SHAPE[1] - 32, SHAPE[0] - 32), 32, 32)
    outside = (grid.x < INSIDE.start - 16) | (grid.x > INSIDE.stop + 16)
    ok = {}
    for noise in (0.0, least):
        field = PhaseKernel(first.astype(np.float32), grid, least_noise=noise).measure(second)
        ok[noise] = field.status == Status.OK
    assert ok[0.0][:, outside].sum() > 3 * ok[least][:, outside].sum()
    assert not (ok[least] & (np.hypot(field.u, field.v) > 1))[:, outside].any()
    assert ok[least][:, ~outside].sum() > 0.97 * ok[0.0][:, ~outside].sum()


def test_the_finder_takes_the_specimen_and_not_the_background() -> None:
    (first, steps), _ = still(92)
    found = find_specimen(first, hidden_noise(first, steps))
    assert found is not None
    assert found.box.x == pytest.approx(INSIDE.start, abs=12)
    assert found.box.x + found.box.width == pytest.approx(INSIDE.stop, abs=12)


def test_noise_that_a_coarse_table_hides_is_bounded_by_its_steps() -> None:
    """Of white noise below a fifth of the steps nothing is left; above it is seen."""
    rng = np.random.default_rng(2)
    even = np.full((256, 256), 100.0)
    assert hidden_noise(even, [10] * 64) == pytest.approx(2.0, rel=0.01)
    for sigma in (4.0, 8.0):
        assert hidden_noise(even + rng.normal(0, sigma, even.shape), [10] * 64) == pytest.approx(
            sigma, rel=0.15
        )
