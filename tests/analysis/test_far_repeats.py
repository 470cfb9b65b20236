"""Repeats beyond the reach of a tile."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.field import Roi
from analysis.follow.repetition import side_peaks


def test_a_picture_of_whole_periods_has_the_nearest_of_them() -> None:
    tile = np.random.default_rng(1).normal(0, 100, (100, 100))
    image = np.tile(tile, (7, 9)).astype(np.float32)
    none = np.zeros(0)
    found = {place for place, _ in side_peaks(image, Roi(0, 0, 900, 700), none, none)}
    assert {(100, 0), (0, 100)} <= found


@pytest.mark.parametrize("sigma", [1.0, 2.0])
def test_odd_periods_are_seen_in_a_picture_that_is_halved(sigma: float) -> None:
    """To a pixel or two, from where each ZOI is brought to its own place."""
    tile = gaussian_filter(np.random.default_rng(1).normal(0, 100, (283, 301)), sigma, mode="wrap")
    image = np.tile(tile, (4, 4))[:1001, :1201].astype(np.float32)
    none = np.zeros(0)
    found = {place for place, _ in side_peaks(image, Roi(40, 40, 1121, 921), none, none)}
    for period in ((301, 0), (0, 283)):
        assert min(math.dist(period, place) for place in found) <= 2
