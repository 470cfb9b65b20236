"""What the simulated camera looks at: the pattern on the specimen, at any instant of the test."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hw_mocks.specimen import VirtualSpecimen
from hw_mocks.speckle import Hole, Speckle

FRINGE = 8.0  # px of pattern beyond what the test can move into view


class Scene:
    """A specimen with its pattern; the strain field at the speckles is computed once.

    Parameters
    ----------
    specimen : VirtualSpecimen
    radius : float, px
    contrast : float
        Standard deviation of the pattern, part of full scale.
    seed : int
    """

    def __init__(
        self, specimen: VirtualSpecimen, radius: float = 2.0, contrast: float = 0.18, seed: int = 0
    ) -> None:
        self.specimen = specimen
        shape, modes = (specimen.height, specimen.width), specimen.modes
        hole = Hole(modes.x0, modes.y0, specimen.hole_radius_px) if specimen.kind == "hole" else None
        margin = math.ceil(FRINGE + _travel(specimen))
        self.speckle = Speckle(shape, radius, contrast=contrast, seed=seed, margin=margin, hole=hole)
        self._modes = modes.at(self.speckle.blobs.x, self.speckle.blobs.y)

    def render(self, t: float) -> NDArray[np.float32]:
        """The picture ``t`` seconds since the start, (H, W), part of full scale, without noise."""
        motion = self.specimen.at(t)
        u, v = motion.displaced(self._modes)
        blobs = self.speckle.blobs
        return self.speckle.fast_at(blobs.x + u, blobs.y + v, motion.strained(self._modes), motion)

    def exact(self, t: float) -> NDArray[np.float64]:
        """The same by the exact road of ``Speckle``, slowly."""
        return self.speckle.exact(self.specimen.at(t))


def _travel(specimen: VirtualSpecimen) -> float:
    """The furthest that a corner of the image moves during the test, px."""
    x, y = np.array([0.0, 0.0, 1.0, 1.0]) * specimen.width, np.array([0.0, 1.0, 0.0, 1.0]) * specimen.height
    u, v = specimen.at(specimen.duration_s).displacement(x, y)
    return float(np.max(np.hypot(u, v)))
