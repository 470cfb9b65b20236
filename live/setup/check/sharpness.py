"""How much less sharp the picture is than the sharpest one so far, while lens and distance are adjusted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from analysis.field import Blur, mean_blur
from live.pipeline.reference import averaged, prepare
from live.setup.check.sample import CheckSample, around, moved
from live.setup.check.stillness import covered, middle
from live.setup.pictures import correction

if TYPE_CHECKING:
    from analysis import PhaseKernel

NOT_KNOWN = Blur(math.nan, math.nan)
SHARPER = 3.0
"""Sigmas by which a picture is sharper than the reference and takes its place."""


class SharpestPicture:
    """The sharpest picture of one region so far, as a reference for those that follow."""

    def __init__(self) -> None:
        self._kernel: PhaseKernel | None = None
        self._peak = math.nan  # sharpness figure of the reference

    def compare(self, sample: CheckSample, measurable: NDArray[np.bool_], sharpness: float) -> Blur:
        """The blur of a sample since the sharpest picture, over some dozens of ZOIs about the middle.

        Parameters
        ----------
        sample : CheckSample
        measurable : (R, C) bool
            ZOIs with a pattern. Without any the blur is NaN.
        sharpness : float
            Figure of the sample; decides where the blur has changed too much to be measured (NaN).
        """
        measurable = measurable & sample.check_region.grid.active
        if not measurable.any():
            return NOT_KNOWN
        chosen = middle(sample.check_region.grid.subset(active=measurable))
        cut = around(covered(chosen, sample.check_region.at_zois.shape))
        correct = correction(sample.check_region.config, sample.check_region.camera, cut)
        burst = correct(sample.stack.cut(*cut).mean())
        if self._kernel is None or burst.mean.shape != self._kernel.reference.prepared.shape:
            try:
                self._kernel, _ = prepare(burst, moved(chosen, cut), sample.settings, sample.noise)
            except DataError:
                return NOT_KNOWN
            self._peak = sharpness
        found = mean_blur(self._kernel.measure(burst.mean, noise=averaged(sample.noise, burst.n)))
        too_sharp = math.isnan(found.px) and sharpness > self._peak
        if too_sharp or found.px < -SHARPER * found.sigma:
            self._peak = sharpness
            self._kernel, _ = prepare(burst, self._kernel.grid, sample.settings, sample.noise)
        return found
