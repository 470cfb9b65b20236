"""The arguments of the compiled loops, in tuples with names.

Plain tuples: the compiler takes them apart, so they cost a loop nothing and a call a few microseconds.
In a parallel loop they are read by name; what is written to is given a name of its own before.
A ZOIs; P columns of the normal matrix; modes 6 or 12.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.picture.splines import TAPS, Box

Floats = NDArray[np.float64]

IMAGES = 4
"""Of a reference (``PreparedReference.images``)."""
NUISANCES, BLURS = 9, 3
"""Columns of J beside those of the displacement; the last of them, f_xx, f_yy and f_xy, are blur."""
RUNNING, CONVERGED, LEFT_IMAGE, DIVERGED = 0, 1, 2, 3
"""How the iteration of a ZOI ended (``OutArgs.state``)."""


class PictureArgs(NamedTuple):
    """A deformed image as a spline.

    Attributes
    ----------
    c : flat float32
        Coefficients (``prefilter.coefficients``), of a part of the image or of all.
    width : int, px
        Of the image.
    left, right, top, bottom : float, px
        Where the corners of a ZOI may lie.
    """

    c: NDArray[np.float32]
    width: int
    left: float
    right: float
    top: float
    bottom: float

    @classmethod
    def within(cls, c: NDArray[np.float32], shape: tuple[int, int], box: Box, over: float) -> PictureArgs:
        """With the coefficients of ``box``; a ZOI may stick ``over`` px out where that ends with the image."""
        columns = _ends((box.left, box.right), shape[1], over)
        return cls(c, shape[1], *columns, *_ends((box.top, box.bottom), shape[0], over))


def _ends(ends: tuple[int, int], length: int, over: float) -> tuple[float, float]:
    first, last = ends
    return (-over if first == 0 else first + TAPS / 2), (
        last - 1 + over if last == length else last - 1 - TAPS / 2
    )


class FitArgs(NamedTuple):
    """The reference and the linear fit of each of its ZOIs.

    Attributes
    ----------
    images : flat float32, ``samples`` of each, ``pitch`` a row
        See ``PreparedReference.images``.
    which : (B,) int64
        The ZOIs that are measured; all else is of all A. ``OutArgs`` are of the B.
    origins : (A, 2) int64
        First row and column of each ZOI.
    size : int, px
    spacing : int, px
        Between neighbouring ZOIs, which follow each other; only the speed depends on it.
    order : 1 or 2
    rows : (4, whole(size)) float32
        Window times P0 .. P3, zero beyond ``size``; ``mix`` (4, 4) has the polynomials (``shapes``).
    inverse : (A + 1, P, P) float32
    cross : (A + 1, P, 14) float32
    squares : (A, 2) float64
        Sums of w f_x^2 and w f_y^2.
    units, bias : (modes,) float64 and (A, P) float32
        See ``sensitivity.parameter_scale`` and ``noise_bias``.
    noise, expected : (A,) float64, GL^2
        Variance a pixel of the reference; the weighted sum of squares that the noise of both images leaves.
    """

    images: NDArray[np.float32]
    samples: int
    pitch: int
    which: NDArray[np.int64]
    origins: NDArray[np.int64]
    size: int
    spacing: int
    order: int
    rows: NDArray[np.float32]
    mix: Floats
    inverse: NDArray[np.float32]
    cross: NDArray[np.float32]
    squares: Floats
    units: Floats
    bias: NDArray[np.float32]
    noise: Floats
    expected: Floats


class StopArgs(NamedTuple):
    """When the iteration of a ZOI ends.

    Attributes
    ----------
    length, slope : (A,) float64
        Error that may be left in u and v (px) and in the gradients.
    trust : (A,) float64, px
        Predicted uncertainty of u and v from the noise of the deformed image.
    max_iterations : int
    """

    length: Floats
    slope: Floats
    trust: Floats
    max_iterations: int

    def at(self, places: NDArray[np.intp] | slice) -> StopArgs:
        """For some of the ZOIs."""
        return StopArgs(self.length[places], self.slope[places], self.trust[places], self.max_iterations)

    def after(self, iterations: int) -> StopArgs:
        """The same after so many iterations at most."""
        return StopArgs(self.length, self.slope, self.trust, iterations)


class OutArgs(NamedTuple):
    """What the iteration writes.

    Attributes
    ----------
    p : (A, modes) float64, px units
        Start values in, result out.
    left : (A,) float64, GL^2
        Weighted sum of squared differences after the fit.
    bending : (A,) float64, px^2
        What the fit leaves of a displacement that bends or jumps (``shapes.bent``).
    cubic : (A, 2) float64, px^2
        The part of it of third degree, of u and of v.
    nuisance : (A, 3) float64
        Gain, offset in GL, and growth of the variance of the blur in px^2.
    state, iterations : (A,) uint8
    """

    p: Floats
    left: Floats
    bending: Floats
    cubic: Floats
    nuisance: Floats
    state: NDArray[np.uint8]
    iterations: NDArray[np.uint8]

    @classmethod
    def starting(cls, guess: Floats) -> OutArgs:
        """Arrays for the results of ZOIs that start from ``guess`` (A, modes), which is copied."""
        count = len(guess)
        return cls(
            guess.copy(), np.empty(count), np.empty(count), np.empty((count, 2)), np.empty((count, 3)),
            np.full(count, RUNNING, np.uint8), np.zeros(count, np.uint8),
        )  # fmt: skip

    @classmethod
    def unmeasured(cls, count: int, modes: int) -> OutArgs:
        """Of ZOIs that were not iterated: NaN."""
        empty = cls.starting(np.full((count, modes), np.nan))
        for array in (empty.left, empty.bending, empty.cubic, empty.nuisance):
            array[:] = np.nan
        return empty

    def put(self, places: NDArray[np.intp], other: OutArgs) -> None:
        """Copy what ``other`` holds of the ZOIs ``places``."""
        self.p[places], self.left[places], self.bending[places] = other.p, other.left, other.bending
        self.cubic[places], self.nuisance[places] = other.cubic, other.nuisance
        self.state[places], self.iterations[places] = other.state, other.iterations

    def at(self, places: NDArray[np.intp]) -> OutArgs:
        """Those of some ZOIs."""
        return OutArgs(
            self.p[places], self.left[places], self.bending[places], self.cubic[places], self.nuisance[places],
            self.state[places], self.iterations[places],
        )  # fmt: skip


class ReferenceArgs(NamedTuple):
    """What is known of each ZOI from the reference, for its verdict.

    Attributes
    ----------
    signal : (A,), GL^2
        Variance of the pattern.
    pixels : (A,)
        Effective number of independent pixels.
    unit : (A, 2), px^2 per GL^2
        Variance of u and of v from noise of 1 GL, of a ZOI without anything else to find.
    centre : (A,), px per GL
        Standard deviation of the worse of u and v from noise of 1 GL, as it is found.
    white : (2,)
        ``white_noise.white_cubic`` of the kernel.
    bends : float
        Mean square of what white noise bends, over its variance of u and v (``shapes.Shapes.noise``).
    independent : float
        ZOIs that a ZOI counts for, since neighbours share pixels; at most 1.
    information : (A,)
        On the least known of u, v and the gradients, over that which the noise of the reference pretends.
    later : float
        Share of the noise as stated that is the deformed image's.
    """

    signal: Floats
    pixels: Floats
    unit: Floats
    centre: Floats
    white: Floats
    bends: float
    independent: float
    information: Floats
    later: float

    def at(self, places: NDArray[np.intp] | slice) -> ReferenceArgs:
        """That of some ZOIs."""
        return self._replace(
            signal=self.signal[places], pixels=self.pixels[places], unit=self.unit[places],
            centre=self.centre[places], information=self.information[places],
        )  # fmt: skip


class PooledError(NamedTuple):
    """What the fits of one picture leave in common (``pooling.pooled``).

    Attributes
    ----------
    ratio : (A,)
        Variance that a ZOI of this contrast leaves, over that expected from the noise as stated.
    forgiven : (A,)
        The same where it is the common state of the picture; 1 where that is as stated.
    usual : float
        Median of ``ratio``.
    scatter : float
        Standard deviation of what a single ZOI leaves over that; 0 where that is as stated.
    colour : (2,)
        Variance of u and of v over that of white noise of the same variance a pixel.
    bent : float
        Square by which the displacement of a usual ZOI bends, over that from white noise; not less than 1.
    apart : bool
        Whether ZOIs whose displacement bends were left out.
    """

    ratio: Floats
    forgiven: Floats
    usual: float
    scatter: float
    colour: Floats
    bent: float
    apart: bool

    @classmethod
    def none(cls, count: int) -> PooledError:
        """Of ``count`` ZOIs that leave what is expected."""
        return cls(np.ones(count), np.ones(count), 1.0, 0.0, np.ones(2), 1.0, False)

    def at(self, places: NDArray[np.intp] | slice) -> PooledError:
        """That of some ZOIs."""
        return self._replace(ratio=self.ratio[places], forgiven=self.forgiven[places])


class VerdictArgs(NamedTuple):
    """What holds for the verdict of every ZOI.

    Attributes
    ----------
    noise_known : bool
        Whether the expected variance stands on noise that was given.
    noise : (2,)
        ``shapes.Shapes.noise``.
    lever : float, px
        Width of the window that makes a displacement of a strain.
    limit : float, px
        What the displacement at the centre may be wrong by.
    far : float
        Of ``validity.CENTRE_VARIANCE``.
    corner_steps : float
        ``validity.CORNER_STEPS``; infinite for phases, whose fits take more.
    """

    noise_known: bool
    noise: Floats
    lever: float
    limit: float
    far: float
    corner_steps: float


class ReferenceImages(NamedTuple):
    """The channels of a reference.

    Attributes
    ----------
    plain : flat float32, ``samples`` of each, ``pitch`` a row
        f_x, f_y (GL/px), f of the filtered reference, (not read,) and its f_xx, f_yy, f_xy (GL/px^2).
    by_level : flat float32, or empty
        The same times the grey level, the level itself in the fourth place, for a noise that grows with it;
        empty: not wanted.
    """

    plain: NDArray[np.float32]
    by_level: NDArray[np.float32]
    samples: int
    pitch: int


class WindowRows(NamedTuple):
    """The window of a ZOI along one axis, with what it is multiplied with.

    Attributes
    ----------
    powers, squares : (6, line) and (5, line) float32
        Window and squared window times powers of xi (the window is the same along y).
    mix : (4, 4)
        See ``shapes.Shapes``.
    """

    powers: NDArray[np.float32]
    squares: NDArray[np.float32]
    mix: Floats


class NormalArgs(NamedTuple):
    """The linear fit of each ZOI, as ``sensitivity.prepare`` writes it.

    Attributes
    ----------
    inverse : (A + 1, P, P) float32
        Zero where there is no pattern.
    cross : (A + 1, P, 14) float32
        Of the shapes that the fit cannot follow with the columns of J (``shapes.cross_moments``). Both
        have a ZOI more than there is, of zeros, since loops read whole vectors.
    covariance, covariance_level : (A, 21) float32
        Of the six affine parameters, px units, for noise of variance 1 GL^2 and for noise of
        variance ``level``; the latter is empty where it is not wanted.
    freedom : (A,) float32
        Sum of the weights less what the fit takes: expected weighted residual per GL^2 of noise.
    energy : (A, 4) float32
        Over the window: mean of f_x^2 and f_y^2, (GL/px)^2, variance (GL^2) and mean (GL) of f.
    taken : (A, P) float32
        What each column takes of it, Gaussian windows: 0.5 for 1, 0.25 for x.
    blur : (A,) float32, px^4 per GL^2
        Variance of the blur for noise of variance 1 GL^2.
    """

    inverse: NDArray[np.float32]
    cross: NDArray[np.float32]
    covariance: NDArray[np.float32]
    covariance_level: NDArray[np.float32]
    freedom: NDArray[np.float32]
    energy: NDArray[np.float32]
    taken: NDArray[np.float32]
    blur: NDArray[np.float32]

    @classmethod
    def empty(cls, count: int, columns: int, shapes: int, by_level: bool) -> NormalArgs:
        """Arrays for ``count`` ZOIs."""
        inverse = np.empty((count + 1, columns, columns), np.float32)
        cross = np.empty((count + 1, columns, shapes), np.float32)
        inverse[count] = cross[count] = 0
        return cls(
            inverse, cross, np.empty((count, 21), np.float32),
            np.empty((count if by_level else 0, 21), np.float32),
            np.empty(count, np.float32), np.empty((count, 4), np.float32),
            np.empty((count, columns), np.float32), np.empty(count, np.float32),
        )  # fmt: skip
