"""The search of whole pixels, ZOI by ZOI."""

from __future__ import annotations

import numpy as np

from analysis import Roi
from analysis.follow.search import search
from tests.analysis.speckle import picture


def test_every_zoi_is_found_on_its_nearest_pixel() -> None:
    reference, deformed = picture().astype(np.float32), picture(u=-11.7, v=6.2).astype(np.float32)
    origins = np.array([[60, 60], [100, 90], [30, 150]], np.int64)
    found = search(reference, deformed, np.float32(reference.mean()), Roi(24, 24, 190, 150), origins, 32)
    assert found.shape == (3, 6)
    assert np.array_equal(found[:, [0, 3]], np.broadcast_to([-12, 6], (3, 2)))
    assert np.abs(found[:, [1, 2, 4, 5]]).max() < 0.02
