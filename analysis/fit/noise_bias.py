"""What the noise of the reference adds to the fit of a ZOI on average, which a mean over ZOIs does not lose.

That noise stands in J and in the difference, and in second order the two do not cancel (docs/method.md, section 7):
with a single frame of 2 GL as the reference, the mean exx on the dark side of a real picture was wrong by 400 um/m. For
the mean of N frames it is 1/N of that. The noise of the deformed picture should have a like part through its own
gradient; where it was tried, the means became worse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.fit.kernel_args import NUISANCES

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


def noise_bias(inverse: Singles, taken: Singles, own_noise: Floats, weight: float, size: int) -> Singles:
    """What to add to the parameters of each ZOI for noise of variance 1 GL^2 in the reference, (A, P).

    Parameters
    ----------
    inverse : (A, P, P)
        (J' w J)^-1.
    taken : (A, P)
        Diagonal of (J' w J)^-1 (J' w^2 J).
    own_noise : (3,)
        ``Pattern.own_noise``.
    weight : float
        Sum of the window.
    size : int, px
    """
    half = (taken.shape[1] - NUISANCES) // 2
    along_x, along_y, across = (taken[:, -k] for k in (3, 2, 1))
    moments = np.zeros_like(taken)
    moments[:, [2 * half, -3, -2]] = own_noise * weight  # of f, f_xx and f_yy
    moments[:, 1] = (taken.sum(axis=1) - 2 * along_x - across) / size  # of du_dx
    moments[:, half + 2] = (taken.sum(axis=1) - 2 * along_y - across) / size  # of dv_dy
    return np.asarray(np.einsum("apq,aq->ap", inverse, moments))
