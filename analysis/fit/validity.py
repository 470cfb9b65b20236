"""Which ZOIs are valid: the limits of what a fit may leave, and which ZOIs have a pattern at all.

Each ZOI is judged by its own numbers and by what all leave in common (``verdict``, ``pooling``), so that a verdict
depends neither on threads nor on neighbours. Tried and rejected (of 75 wrong ZOIs accepted before the shares were
added, 34 are left):

- squares of the two shares, or powers of 1.5: found 14 and 28 of the 75, their sum 39;
- further limits on what is left and on bending (of 43 wrong ZOIs accepted, 17 at 0.16 % of the good ones refused);
- half of MODEL_SHARE: found 46, but real pictures (an open hole, noise estimated) come to 0.87 of the present one;
- a fixed share (3 %) of the variance of the pattern: accepted one in seven wrong ZOIs at cracks, holes and edges;
- refusing all with more than 4 times the variance of a full pattern: 5 to 8 % of a real open hole, most of them right;
- a smaller CLIPPED_SHARE: wrong ZOIs at the rim of a glare have 0 to 0.6 %, right ones farther in have more;
- comparing neighbours: a live selection of ZOIs has none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.fit.kernel_args import NUISANCES

Floats = NDArray[np.float64]

NOISE_FACTOR = 1.05
"""The fit may leave this many times the variance expected from the noise, and CHANCE standard ..."""
CHANCE = 4.0
"""... deviations of such a variance more ..."""
UNKNOWN_NOISE_FACTOR = 5.0
"""(in place of both where nobody gave the noise: its guess from the spectrum misses coloured noise) ..."""
POOLED_NOISE_FACTOR = 3.5
"""(or this, where the ZOIs together show that it does not) ..."""
MODEL_SHARE = 0.002
"""... plus this share of the variance of the pattern, for what no noise explains."""
AGREES = 0.8, 1.1
"""What is left over what the given noise explains, between which the given noise stands. Where the warp reads between
the pixels it smooths the noise, and white noise of the strength given leaves down to 0.84 (quintic splines)."""
LOST_SHARE = 0.5
"""A fit that leaves more than this share of the pattern's variance has found something else."""
BENDING_CHANCE = 6.0
"""Standard deviations by which the square of a bending displacement must exceed its noise ..."""
BENDING_SHARE = 0.15
"""... beyond the squares of a limit in px and of this share of the displacement that the strain makes in
the ZOI, which a crack exceeds."""
COLOURED = 1.5
"""Variance of u or v over that of white noise from which on bending is allowed as much more noise."""
CENTRE_VARIANCE = (2.5, 16.0)
"""The shares of the two limits above that a ZOI uses up are added and must not exceed 1: cracks, blur and glare often
show a little in both (of 645,000 good simulated ZOIs 10 are lost so, of 295 wrong ones that pass both limits 157
found). The sum counts as much more as the variance of u or v exceeds these times (order 1 and 2) that of a ZOI with
nothing else to find, which a full pattern multiplies by 1 and by 3 to 4: there the centre lies beyond its pattern."""
EMPTY_SHARES, EMPTY_SIGMA = (0.1, 0.4), 0.05
"""A fit that leaves between these shares of what the noise should leave, where u or v is more uncertain than this
(px), had nothing to fit: a dark or blurred background with hardly noise and hardly pattern. One that leaves still
less has the same picture before it."""
MANY_STEPS, SLOW_SIGMA = 8, 0.065
"""A fit that took so many steps, where u or v is more uncertain than this (px), has been led along an edge of the
specimen or through clutter (seen on a polymer bar and an open hole; a pattern takes one to five)."""
CORNER_STEPS, CORNER_SIGMA, CORNER_VARIANCE = 6.0, 0.1, 10.0
"""The same where u and v are more certain than this (px), but vary as many times more than those of a ZOI with nothing
else to find: a small one on the corner of a box. Of speckles of 3 px radius in ZOIs of 12 px it refuses up to 0.7 %."""
MIN_GAIN, MAX_GAIN = 0.2, 5.0
PATTERN_OVER_NOISE = 3.0
"""Gradient energy of a ZOI over that of filtered noise alone; less is no pattern."""
MAX_SIGMA_U = 0.3
"""Pixels; a ZOI that predicts a larger uncertainty has no pattern."""
MIN_INFORMATION = 0.04
"""Information on u, v or a gradient beside the others, over that of a pattern with the same gradients everywhere: a
corner or an edge has less. Where u and v of real ZOIs agree with their neighbours to 0.05 px, 4 of 18,303 have less."""
SMALL_PX, SMALL_POWER = (20.0, 28.0), 4.3
"""ZOIs (order 1 and 2) below which also random patterns have less, since few speckles lie in them, and how fast."""
INFORMATION_OVER_NOISE = 1.4
"""The same over what noise alone pretends: a fit along an edge follows the noise of the reference (8 of the 18,303)."""
QUIETER = 2.0
"""Standard deviations that a ZOI must leave less than expected for its noise to be taken as less."""
SHOWN_SHARE = 0.5
"""Mean square difference of pixels of a ZOI as it was recorded over that of the gradients of its filtered pattern: with
less along x or y, what is in it was spread there by the filter. The noise of the picture is not taken off first: where
it is dark it has less."""
CLIPPED_SHARE = 0.05
"""Share of the window weight on clipped pixels from which on a ZOI is refused."""


def information(
    inverse: NDArray[np.float32], energy: Floats, noise_energy: float, line: Floats
) -> tuple[Floats, Floats]:
    """Information on the least known of u, v and the gradients, when all else is sought, too, (A,) each.

    Over that of a pattern with the same mean square gradients everywhere, and over that of noise of 1 GL.

    Parameters
    ----------
    inverse : (A, P, P)
        Of the normal matrices.
    energy : (A, 2), (GL/px)^2
        Mean square of the filtered gradients.
    noise_energy : float, 1/px^2
        What noise of 1 GL gives for ``energy``.
    line : (n,)
        The window along one side.
    """
    size, half = len(line), (inverse.shape[1] - NUISANCES) // 2
    xi = (np.arange(size) - (size - 1) / 2) / (size / 2)
    affine = [0, 1, 2, half, half + 1, half + 2]
    even = line.sum() * np.tile([line.sum(), line @ xi**2, line @ xi**2], 2)
    found = 1 / (np.maximum(inverse[:, affine, affine], 1e-30) * even)
    least = np.where(energy > 0, energy, np.inf).repeat(3, axis=1)
    return (found / least).min(axis=1), found.min(axis=1) / max(noise_energy, 1e-12)


def least_information(size: int, order: int) -> float:
    """Share of the information of an even pattern below which a ZOI of ``size`` px has none (``information``)."""
    share: float = min(1.0, size / SMALL_PX[order - 1]) ** SMALL_POWER
    return MIN_INFORMATION * share


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
    sigma = np.sqrt(np.maximum(unit_variance.max(axis=1), 0)) * max(noise, 0.1)
    return np.asarray(strong & (unit_variance.min(axis=1) > 0) & (sigma < MAX_SIGMA_U))
