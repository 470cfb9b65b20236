"""The straight line y = a + b x of each place through all instants, from sums that add up.

Weights are 1 / sigma^2. What is common to all instants measured against one reference, such as its noise, is in the
intercept of that reference and not in the slope. Where x has noise too, the slope is that of the moments without it
(W. A. Fuller, Measurement Error Models, 1987, doi:10.1002/9780470316665, sections 1.2 and 1.3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
MIN_INSTANTS = 3
"""Beyond the intercepts, that a line needs to have a chi2."""
_CLEAR = 5.0  # standard deviations of the noise that x must move by, in the sum of its squares


@dataclass(frozen=True, slots=True, eq=False)
class ResponseSums:
    """The state: nine sums a place and reference. Two parts of a test add up.

    Attributes
    ----------
    parts : mapping of int to (9, ...) float64
        By number of the reference: instants, then sums of w, w x, w y, w x^2, w x y, w y^2, and of w times the
        variance of x and the covariance of the noises.
    """

    parts: Mapping[int, Floats] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        x: ArrayLike,
        y: Floats,
        sigma: Floats,
        reference: int = 0,
        sigma_x: ArrayLike = 0.0,
        covariance: ArrayLike = 0.0,
    ) -> ResponseSums:
        """One instant.

        Parameters
        ----------
        x : float or (...)
            Of all places, or of each.
        y, sigma : (...) float64
            Value of each place, and its standard uncertainty without the noise of the reference. A place whose value
            is not finite, or whose sigma is not above 0, has no weight.
        reference : int
            What it was measured against; each has an intercept of its own.
        sigma_x, covariance : float or (...)
            Noise of x, and covariance of the noises of x and y, both without that of the reference.
        """
        x, y, sigma, sigma_x, covariance = np.broadcast_arrays(x, y, sigma, sigma_x, covariance)
        known = np.isfinite(x) & np.isfinite(y) & (sigma > 0) & np.isfinite(sigma + sigma_x + covariance)
        w = np.zeros(y.shape)
        np.divide(1.0, np.square(sigma), out=w, where=known)
        x, y, vx, both = (np.where(known, v, 0.0) for v in (x, y, np.square(sigma_x), covariance))
        return cls(
            {reference: np.stack([known, w, w * x, w * y, w * x * x, w * x * y, w * y * y, w * vx, w * both])}
        )

    def __add__(self, other: ResponseSums) -> ResponseSums:
        both = dict(self.parts)
        for reference, sums in other.parts.items():
            both[reference] = both[reference] + sums if reference in both else sums
        return ResponseSums(both)

    def lines(self) -> ResponseLines:
        """The line of each place; NaN where its instants do not give one."""
        n, refs, sxx, sxy, syy, vx, vxy = (np.zeros(()) for _ in range(7))
        middles = {}
        with np.errstate(divide="ignore", invalid="ignore"):
            for reference, (m, w, x, y, xx, xy, yy, noise, both) in self.parts.items():
                here = m > 0
                middles[reference] = (w, np.where(here, x / w, np.nan), np.where(here, y / w, np.nan))
                n, refs, vx, vxy = n + m, refs + here, vx + noise, vxy + both
                sxx = sxx + np.where(here, xx - x * x / w, 0.0)
                sxy = sxy + np.where(here, xy - x * y / w, 0.0)
                syy = syy + np.where(here, yy - y * y / w, 0.0)
            free = np.asarray(n - refs)
            # Noise of x and the covariance over the variance of y, of a typical instant.
            r, c = vx / n, vxy / n
            clean = sxx - free * r
            known = (free >= MIN_INSTANTS) & (clean > _CLEAR * r * np.sqrt(2.0 * np.maximum(free, 0)))
            clean = np.where(known & (clean > 0), clean, np.nan)
            slope = (sxy - free * c) / clean
            beyond = 1 + slope * slope * r - 2 * slope * c
            variance = (sxx * beyond + free * (c - slope * r) ** 2) / clean**2
            left = syy - 2 * slope * sxy + slope * slope * sxx
            chi2 = left / (beyond * (free - 1))
        return ResponseLines(slope, np.sqrt(variance), chi2, np.asarray(n), middles)


@dataclass(frozen=True, slots=True, eq=False)
class ResponseLines:
    """The line of each place.

    Attributes
    ----------
    slope, sigma : (...) float64
        In y over x, and its standard uncertainty: of the noise that differs from instant to instant alone.
    chi2 : (...) float64
        What is left over what noise leaves, by the degree of freedom; about 1 where y is in proportion.
    n : (...) float64
        Instants with weight.
    middles : mapping of int to (w, x, y)
        By reference: sum of the weights, and means of x and y.
    """

    slope: Floats
    sigma: Floats
    chi2: Floats
    n: Floats
    middles: Mapping[int, tuple[Floats, Floats, Floats]]

    def intercept(self, reference: int = 0) -> Floats:
        """y where x is 0, against one reference; NaN where no instant has weight."""
        _, x, y = self.middles[reference]
        return np.asarray(y - self.slope * x)

    def at(self, x: float, reference: int = 0) -> tuple[Floats, Floats]:
        """y of the line at ``x`` and its variance; NaN where the reference has no instant."""
        if reference not in self.middles:
            nothing = np.full(np.shape(self.slope), np.nan)
            return nothing, nothing
        w, middle, y = self.middles[reference]
        with np.errstate(divide="ignore", invalid="ignore"):
            return y + self.slope * (x - middle), 1 / w + (self.sigma * (x - middle)) ** 2
