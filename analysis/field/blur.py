"""How much less sharp a picture is than its reference: a width in px, from the variance that its blur has grown by."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.field.strain_field import StrainField
from analysis.field.uncertainty import Floats, fixed_sum, variance_of_sum


class Blur(NamedTuple):
    """Standard deviation of the blur since the reference along one axis, and its standard uncertainty, px.

    Negative where the picture is sharper: the width by which the reference is blurred against it. NaN where it is not
    known.
    """

    px: float
    sigma: float

    @property
    def text(self) -> str:
        """In words, "less sharp by 0.41 ± 0.02 px"; empty where it is not known."""
        if not math.isfinite(self.px):
            return ""
        return Message(
            "{value} by {size:.2f} ± {sigma:.2f} px",
            Message("less sharp") if self.px >= 0 else Message("sharper"),
            abs(self.px),
            self.sigma,
        )


def mean_blur(field: StrainField) -> Blur:
    """The blur of the whole picture: from the mean variance over the valid ZOIs, whose windows overlap."""
    count = field.n_valid
    if field.blur is None or not count:
        return Blur(math.nan, math.nan)
    variance, sigma = field.blur.astype(np.float64)
    mean = fixed_sum(variance[field.ok]) / count
    # The blur weighs the pixels of a window evenly, as a displacement does: neighbours correlate alike.
    of_sum = variance_of_sum(np.where(field.ok, sigma, 0.0), "u", field.grid, field.window)
    px, uncertainty = widths(np.array([mean]), np.array([math.sqrt(max(of_sum, 0.0)) / count]))
    return Blur(float(px[0]), float(uncertainty[0]))


def blur_maps(field: StrainField) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Blur of each ZOI and its standard uncertainty, (R, C) px, as of ``Blur``."""
    nothing = np.full((2, *field.grid.shape), np.nan)
    px, sigma = widths(*(nothing if field.blur is None else field.blur.astype(np.float64)))
    return px.astype(np.float32), sigma.astype(np.float32)


def widths(variance: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """Signed roots of variances, px, and half of what their standard uncertainty either way makes of them."""
    px, low, high = (
        np.copysign(np.sqrt(np.abs(v)), v) for v in (variance, variance - sigma, variance + sigma)
    )
    return px, (high - low) / 2
