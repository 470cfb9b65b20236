"""What noise adds to the fit of a ZOI on average: its second order, which a mean over ZOIs does not lose.

The noise of the reference stands in J and in the difference. Taken together they do not cancel (docs/method.md,
section 7): measured on pictures of a still specimen, a single frame of 2 GL as the reference made the mean exx of the
dark side of a real picture wrong by 400 um/m. With bursts it vanishes, as 1/N.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.fit.kernel_args import NUISANCES

Floats = NDArray[np.float64]


class NoiseBias(NamedTuple):
    """What to add to the parameters of each ZOI for noise of variance 1 GL^2 of the two images, (A, P) float32."""

    reference: NDArray[np.float32]
    current: NDArray[np.float32]

    @classmethod
    def of(
        cls,
        inverse: NDArray[np.float32],
        taken: NDArray[np.float32],
        own_noise: Floats,
        weight: float,
        size: int,
    ) -> NoiseBias:
        """Of every ZOI.

        Parameters
        ----------
        inverse : (A, P, P) float32
            (J' w J)^-1.
        taken : (A, P) float32
            Diagonal of (J' w J)^-1 (J' w^2 J).
        own_noise : (3,)
            ``Pattern.own_noise``.
        weight : float
            Sum of the window.
        size : int, px
        """
        half = (taken.shape[1] - NUISANCES) // 2
        along_x, along_y, across = (taken[:, -k] for k in (3, 2, 1))
        of_reference, of_current = np.zeros((2, *taken.shape), np.float32)
        level, slopes = 2 * half, (1, half + 2)  # places of f, and of du_dx and dv_dy
        of_reference[:, [level, -3, -2]] = own_noise * weight
        for at, bent, modes in zip(
            slopes, (along_x, along_y), (slice(half), slice(half, level)), strict=True
        ):
            of_reference[:, at] = (taken.sum(axis=1) - 2 * bent - across) / size
            of_current[:, at] = -taken[:, modes].sum(axis=1) / size
        return cls(_solved(inverse, of_reference), _solved(inverse, of_current))


def _solved(inverse: NDArray[np.float32], moments: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.einsum("apq,aq->ap", inverse, moments))
