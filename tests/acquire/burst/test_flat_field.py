from __future__ import annotations

import math

import numpy as np
import pytest

from acquire.burst.flat_field import FlatField
from acquire.errors import DataError
from acquire.frame import Burst


def burst(mean: np.ndarray) -> Burst:
    clipped = np.zeros(mean.shape, np.bool_)
    return Burst(mean.astype(np.float32), 4, math.nan, clipped, 12, 0.0, 0.1, 0, 3, 0, "device")


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    true = rng.uniform(200, 3000, (40, 50))
    return true, rng.uniform(0, 60, true.shape), rng.uniform(0.7, 1.3, true.shape)


def test_fixed_pattern_is_taken_out() -> None:
    true, dark, gain = scene()
    field = FlatField.from_images(dark, dark + 2000 * gain)
    corrected = field.apply(burst(dark + true * gain)).mean
    scale = np.median(corrected / true)
    assert np.abs(corrected / (scale * true) - 1).max() < 1e-5
    assert scale == pytest.approx(np.median(gain), rel=0.01)
    assert corrected.dtype == np.float32
    assert not corrected.flags.writeable


def test_dark_alone_and_flat_alone() -> None:
    true, dark, gain = scene()
    assert np.allclose(FlatField.from_images(dark, None).apply(burst(true + dark)).mean, true, rtol=1e-5)
    corrected = FlatField.from_images(None, 2000 * gain).apply(burst(true * gain)).mean / true
    assert np.ptp(corrected) < 1e-4


def test_pixels_that_see_nothing_are_marked() -> None:
    true, dark, gain = scene()
    flat = dark + 2000 * gain
    flat[3, 4] = dark[3, 4]
    result = FlatField.from_images(dark, flat).apply(burst(dark + true * gain))
    assert np.argwhere(result.clipped).tolist() == [[3, 4]]
    assert np.isfinite(result.mean).all()


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(DataError, match="dark or a flat"):
        FlatField.from_images(None, None)
    with pytest.raises(DataError, match="of one size"):
        FlatField.from_images(np.ones((2, 2)), np.ones((2, 3)))
    with pytest.raises(DataError, match="no brighter"):
        FlatField.from_images(np.ones((2, 2)), np.ones((2, 2)))
    with pytest.raises(DataError, match="for 50x40 pictures, the camera gives 6x5"):
        FlatField.from_images(scene()[1], None).apply(burst(np.ones((5, 6))))
