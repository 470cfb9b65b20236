"""An error that all ZOIs of a field have in common, of a correction that was applied to all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.field.uncertainty import combination

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CommonError:
    """What the noise of the parameters of a correction makes of each ZOI.

    Attributes
    ----------
    shapes : (K, 6, R, C) float64
        Of u, du_dx, du_dy, v, dv_dx, dv_dy by each parameter.
    covariance : (K, K) float64
        Of the parameters.
    """

    shapes: Floats
    covariance: Floats

    def variance(self, name: str) -> Floats:
        """Of a value of each ZOI, (R, C)."""
        of_value = sum(share * self.shapes[:, i] for i, share in combination(name).items())
        return np.asarray(np.einsum("krc,kl,lrc->rc", of_value, self.covariance, of_value))

    def variance_of_sum(self, weights: Floats) -> float:
        """Of the sum of the six parameters of all ZOIs times ``weights`` (6, R, C)."""
        made = np.einsum("kirc,irc->k", self.shapes, weights)
        return float(made @ self.covariance @ made)

    def beside(self, other: CommonError | None) -> CommonError:
        """Both errors, which have nothing to do with each other."""
        if other is None:
            return self
        k, n = len(self.covariance), len(self.covariance) + len(other.covariance)
        covariance = np.zeros((n, n))
        covariance[:k, :k], covariance[k:, k:] = self.covariance, other.covariance
        return CommonError(np.concatenate([self.shapes, other.shapes]), covariance)

    def part(self, rows: slice, columns: slice) -> CommonError:
        """That of some rows and columns of ZOIs."""
        return CommonError(self.shapes[:, :, rows, columns], self.covariance)
