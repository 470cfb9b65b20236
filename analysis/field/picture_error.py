"""The error of a picture beside its noise: how much it is, what made it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Cause = Literal["", "noise", "compression", "bands", "blur", "filter"]


@dataclass(frozen=True, slots=True)
class PictureError:
    """What the fits of a picture leave in common, over what its noise as given (or as its reference shows) explains.

    Attributes
    ----------
    over_noise : float
        Standard deviation over that expected.
    colour : tuple of two floats
        Variance of u and of v over that of white noise of this strength.
    cause : str
        What it looks like where ``factor`` exceeds ``LIMIT``: "noise", "compression" (blocks of 8 px), "bands" (rows
        or columns), "blur" (or sharpening), "filter" (not white), else "".
    """

    over_noise: float
    colour: tuple[float, float]
    cause: Cause = ""

    @property
    def factor(self) -> float:
        """Uncertainty of a value over that from the noise as given."""
        return float(self.over_noise * max(self.colour) ** 0.5)


LIMIT = 1.5
"""Factor of the uncertainty from which on the picture is another than its noise says."""
