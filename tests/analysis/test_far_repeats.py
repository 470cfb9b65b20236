"""Repeats beyond the reach of a tile."""

import numpy as np

from analysis.field import Roi
from analysis.follow.repetition import side_peaks


def test_a_picture_of_whole_periods_has_the_nearest_of_them() -> None:
    tile = np.random.default_rng(1).normal(0, 100, (100, 100))
    image = np.tile(tile, (7, 9)).astype(np.float32)
    none = np.zeros(0)
    found = {place for place, _ in side_peaks(image, Roi(0, 0, 900, 700), none, none)}
    assert {(100, 0), (0, 100)} <= found
