"""Which ZOIs can be believed: from the state of the iteration and what the fit leaves to a status.

Each ZOI is judged by its own numbers alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.strain_field import Status

Floats = NDArray[np.float64]

NOISE_FACTOR = 1.05
"""The fit may leave this many times the variance expected from the noise, and CHANCE standard ..."""
CHANCE = 4.0
"""... deviations of such a variance more ..."""
UNKNOWN_NOISE_FACTOR = 5.0
"""(in place of both where nobody gave the noise: its guess from the spectrum misses coloured noise) ..."""
MODEL_SHARE = 0.002
"""... plus this share of the variance of the pattern, for what no noise explains."""
LOST_SHARE = 0.5
"""A fit that leaves more than this share of the pattern's variance has found something else."""
BENDING_CHANCE = 5.0
"""Standard deviations by which the square of a bending displacement must exceed its noise ..."""
BENDING_SHARE = 0.15
"""... beyond the squares of a limit in px and of this share of the displacement that the strain makes in
the ZOI, which a crack exceeds."""
LEAST_GAIN, MOST_GAIN = 0.2, 5.0
PATTERN_OVER_NOISE = 3.0
"""Gradient energy of a ZOI over that of filtered noise alone; less is no pattern."""
WORST_SIGMA_U = 0.3
"""Pixels; a ZOI that predicts a larger uncertainty has no pattern."""
CLIPPED_SHARE = 0.05
"""Share of the window weight on clipped pixels from which on a ZOI is not believed."""


def has_pattern(
    energy: Floats, unit_variance: Floats, noise: float, noise_energy: float
) -> NDArray[np.bool_]:
    """Whether each ZOI can be measured at all, (A,).

    Parameters
    ----------
    energy : (A, 2), (GL/px)^2
        Mean square of the filtered gradients.
    unit_variance : (A, 2), px^2 per GL^2
        Variance of u and v for a noise of 1 GL.
    noise : float, GL
    noise_energy : float, (GL/px)^2
        What noise alone gives for ``energy``.
    """
    strong = np.all(energy > PATTERN_OVER_NOISE * noise_energy, axis=1)
    sigma = np.sqrt(unit_variance.max(axis=1)) * max(noise, 0.1)
    return np.asarray(strong & (unit_variance.min(axis=1) > 0) & (sigma < WORST_SIGMA_U))


def judge(
    converged: NDArray[np.bool_],
    outside: NDArray[np.bool_],
    left: Floats,
    expected: Floats,
    signal: Floats,
    gain: Floats,
    pixels: Floats,
    noise_known: bool,
) -> NDArray[np.uint8]:
    """A status for each measured ZOI, (A,).

    Parameters
    ----------
    converged, outside : (A,) bool
    left : (A,), GL^2
        Variance a pixel that the fit leaves.
    expected : (A,), GL^2
        Variance expected from the noise of both images.
    signal : (A,), GL^2
        Variance of the pattern in the reference.
    gain : (A,)
    pixels : (A,)
        Effective number of independent pixels of each ZOI.
    noise_known : bool
        Whether ``expected`` stands on noise that was given.
    """
    chance = NOISE_FACTOR + CHANCE * np.sqrt(2 / np.maximum(pixels, 1))
    allowed = (chance if noise_known else np.maximum(chance, UNKNOWN_NOISE_FACTOR)) * expected
    pattern = signal * np.minimum(gain, 1.0) ** 2
    status = np.full(len(left), Status.OK, np.uint8)
    status[~(left <= allowed + MODEL_SHARE * pattern)] = Status.POOR_MATCH
    status[~((gain > LEAST_GAIN) & (gain < MOST_GAIN))] = Status.POOR_MATCH
    status[~converged] = Status.NOT_CONVERGED
    status[~(left <= allowed + LOST_SHARE * pattern)] = Status.LOST
    status[outside] = Status.OUTSIDE
    return status


def bends(
    bending: Floats, unit: Floats, noise: Floats, stretch: Floats | float, limit: float
) -> NDArray[np.bool_]:
    """Whether the displacement in each ZOI jumps, or bends so much that its centre is wrong, (A,).

    Parameters
    ----------
    bending : (A,), px^2
        See ``shapes.bent``.
    unit : (A, 2), px^2
        Variance of u and of v from the noise, of a ZOI without anything else to find.
    noise : (2,)
        ``shapes.Shapes.noise``.
    stretch : (A,) or float, px
        Displacement that the strain makes over the width of the window (``stretch_of``). Where a
        specimen necks the strain is steep, but small beside itself; across a crack it is not.
    limit : float, px
        What the displacement at the centre may be wrong by.
    """
    mean = (unit[:, 0] + unit[:, 1]) * noise[0]
    spread = np.sqrt(2 * noise[1] * (unit[:, 0] ** 2 + unit[:, 1] ** 2))
    allowed = limit**2 + (BENDING_SHARE * stretch) ** 2
    return np.asarray(~(bending <= mean + BENDING_CHANCE * spread + allowed))


def stretch_of(parameters: Floats, lever: float) -> Floats:
    """Magnitude of the Green-Lagrange strain times ``lever`` px, (A,); (A, 6 or 12) as the kernel has them."""
    half = parameters.shape[1] // 2
    du_dx, du_dy = parameters[:, 1], parameters[:, 2]
    dv_dx, dv_dy = parameters[:, half + 1], parameters[:, half + 2]
    xx = du_dx + (du_dx**2 + dv_dx**2) / 2
    yy = dv_dy + (du_dy**2 + dv_dy**2) / 2
    xy = (du_dy + dv_dx + du_dx * du_dy + dv_dx * dv_dy) / 2
    return np.asarray(lever * np.sqrt(xx**2 + yy**2 + 2 * xy**2))
