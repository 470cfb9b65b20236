"""Motions from features of the region alone."""

from __future__ import annotations

import numpy as np

from analysis import Roi
from analysis.follow.features import feature_motions
from tests.analysis.speckle import SHAPE, picture


def test_what_lies_beside_the_region_moves_nothing() -> None:
    """The left part moves, and only the right one is asked for."""
    reference, later = picture().astype(np.float32), picture().astype(np.float32)
    half = SHAPE[1] // 2
    later[:, :half] = picture(u=12.0).astype(np.float32)[:, :half]
    region = Roi(half + 8, 0, SHAPE[1] - half - 8, SHAPE[0])
    motions = [m[:, 2] for m in feature_motions(reference, later, region)]
    assert motions and all(np.abs(m).max() < 1 for m in motions)
