"""The share of a ZOI on saturated pixels is that of plain arithmetic."""

from __future__ import annotations

import numpy as np

from analysis.field import profile
from analysis.fit.clipping import clipped_share


def test_it_is_the_weight_of_the_marked_pixels() -> None:
    rng = np.random.default_rng(0)
    clipped = rng.random((60, 80)) < 0.1
    line = profile("gaussian", 32)
    first = np.array([[0, 0], [28, 48], [7, 13], [-5, 70], [40, -3]], np.int64)
    inside = np.clip(first, 0, [60 - 32, 80 - 32])
    weight = np.outer(line, line) / line.sum() ** 2
    expected = [float((weight * clipped[y : y + 32, x : x + 32]).sum()) for y, x in inside]
    np.testing.assert_allclose(clipped_share(clipped, first, line), expected, rtol=1e-5)


def test_nothing_marked_is_nothing() -> None:
    share = clipped_share(np.zeros((40, 40), bool), np.zeros((3, 2), np.int64), profile("uniform", 16))
    assert (share == 0).all()
