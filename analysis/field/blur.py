"""How much less sharp a picture is than its reference: a width in px from the variance that its blur has grown by."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from analysis.field.strain_field import StrainField
from analysis.field.uncertainty import fixed_sum, variance_of_sum


class Blur(NamedTuple):
    """Standard deviation of the blur since the reference along one axis, and its standard uncertainty, px.

    Negative where the picture is sharper than its reference: the width by which that one is blurred. NaN where it is
    not known.
    """

    px: float
    sigma: float

    @classmethod
    def of_variance(cls, variance: float, sigma: float) -> Blur:
        """From a variance and its standard uncertainty, px^2: half of what that makes either way."""
        low, high = _signed_root(variance - sigma), _signed_root(variance + sigma)
        return cls(_signed_root(variance), (high - low) / 2)

    @property
    def text(self) -> str:
        """The change of sharpness in words, "less sharp by 0.41 +- 0.02 px"; empty where it is not known."""
        if not math.isfinite(self.px):
            return ""
        return f"{'less sharp' if self.px >= 0 else 'sharper'} by {abs(self.px):.2f} +- {self.sigma:.2f} px"


def mean_blur(field: StrainField) -> Blur:
    """The blur of the whole picture: from the mean variance over the valid ZOIs, whose windows overlap."""
    count = field.n_valid
    if field.blur is None or not count:
        return Blur(math.nan, math.nan)
    variance, sigma = field.blur.astype(np.float64)
    mean = fixed_sum(variance[field.ok]) / count
    # The weight of the blur in a window is even like that of a displacement: the same correlation of neighbours.
    of_sum = variance_of_sum(np.where(field.ok, sigma, 0.0), "u", field.grid, field.window)
    return Blur.of_variance(mean, math.sqrt(max(of_sum, 0.0)) / count)


def _signed_root(variance: float) -> float:
    return math.copysign(math.sqrt(abs(variance)), variance)
