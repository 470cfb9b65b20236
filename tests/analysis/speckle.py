"""A small analytic speckle pair for the unit tests; the judging is done in tests/accuracy."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tests.accuracy.truth import Speckle, affine, digitise

SHAPE = (200, 240)


@lru_cache(maxsize=32)
def level(
    radius: float = 2.0, seed: int = 1, shape: tuple[int, int] = SHAPE, **motion: float
) -> NDArray[np.float64]:
    return Speckle(radius, seed, span=400).at(*affine(shape, **motion))


def picture(noise: float = 0.0, seed: int = 0, bits: int | None = 12, **motion: float) -> NDArray:
    """A frame of the pattern moved by ``motion`` (arguments of ``truth.affine``)."""
    return digitise(level(**motion), bits, noise, np.random.default_rng(seed))
