"""The stress-strain curve of a test and what is read from noisy values over time.

A curve has a part that can be evaluated (``Loading``), a break and true stresses. Its series of values have noise, a
running mean, and a value between samples; those of front and back are put together. Arrays in, arrays out; nothing is
corrected here. Strain is dimensionless, stress in Pa (or any multiple of the force), tension positive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_BROKEN = 0.02  # of the highest stress: below it there is no specimen any more
_FALL = 5.0  # times what is usual from one sample to the next
_BACK = 0.2  # of the highest stress: what has broken does not carry as much again
# Samples of a fall in which strain and stress go down together, and their correlation
_UNLOADED, _TOGETHER = 3, 0.9
_SURE, _LOOP = 8.0, 0.02  # of an unloading: standard deviations, and share of the highest stress
_PARTS, _WIDEST = 60, 4  # of a loading: half the width of its running means, and the most, samples
_MEDIAN_OF_NORMAL = 0.6745
TILT = math.radians(0.1)
"""Of the specimen beside one of two cameras that face one another; both then see it short by half its square."""
_SIGMA_OF_TILT = TILT**2 / 2 / math.sqrt(3)
ENOUGH = 6
"""Samples that a parabola is laid through."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A test as it was measured.

    Attributes
    ----------
    t : (N,) float64, s
    strain : (N,) float64
        Along the load, of the curve and what is read from it; NaN where unknown.
    stress : (N,) float64, Pa
        NaN where unknown.
    transverse : (N,) float64 or None
        Strain across the load.
    elastic : (N,) float64 or None
        Strain along the load for the slopes E and nu, where another has less noise than that of the curve.
    uneven : (N,) float64 or None
        How much ``elastic`` varies over its area, rms.
    misfit : (N,) float64 or None
        That over what noise makes of it.
    narrowing : (N,) float64 or None
        Elongation across the load over the length, where ``transverse`` may be another measure of strain.
    lens : (N,) float64 or None
        Standard uncertainty of the strain by the correction of a lens.
    blur : (N,) float64 or None, px
        Width of the blur since the reference; negative: sharper.
    source, elastic_source : str
        What ``strain`` and ``elastic`` are, in words.
    """

    t: Floats
    strain: Floats
    stress: Floats
    transverse: Floats | None = None
    elastic: Floats | None = None
    uneven: Floats | None = None
    misfit: Floats | None = None
    narrowing: Floats | None = None
    lens: Floats | None = None
    source: str = ""
    elastic_source: str = ""
    blur: Floats | None = None

    def __post_init__(self) -> None:
        n = len(self.t)
        optional = self.transverse, self.elastic, self.uneven, self.misfit, self.narrowing, self.lens
        for values in (self.strain, self.stress, *optional, self.blur):
            if values is not None and values.shape != (n,):
                raise ValueError(f"a curve needs arrays of one length, got {values.shape} beside {n} times")


@dataclass(frozen=True, slots=True, eq=False)
class Loading:
    """The part of a curve that has strain and stress, up to the break.

    Attributes
    ----------
    t, strain, stress, transverse, elastic, uneven, misfit, narrowing, lens, blur : (M,) float64
        As of the ``Curve``; NaN where unknown.
    level, course : (M,) float64
        Running means of stress and strain, to find places by; never a figure.
    noise_strain, noise_stress : float
        Standard deviations of one value.
    half : int
        Of the samples of those running means, 2 half + 1.
    top : int
        The highest stress.
    broke : bool
        The test went on to the break.
    idle : (M,) float64, s
        Time spent in unloadings that were taken out before.
    """

    t: Floats
    strain: Floats
    stress: Floats
    transverse: Floats
    elastic: Floats
    uneven: Floats
    misfit: Floats
    narrowing: Floats
    lens: Floats
    blur: Floats
    level: Floats
    course: Floats
    noise_strain: float
    noise_stress: float
    half: int
    top: int
    broke: bool
    idle: Floats | float = 0.0

    @classmethod
    def of(cls, curve: Curve) -> Loading:
        """What can be evaluated of ``curve``, without unloadings: the envelope of rising strain; may be empty."""
        end = broken_at(curve.stress, curve.strain)
        stop = len(curve.t) if end is None else end + 1
        elastic = curve.strain if curve.elastic is None else curve.elastic
        narrowing = curve.transverse if curve.narrowing is None else curve.narrowing
        known = np.isfinite(curve.strain[:stop]) & np.isfinite(curve.stress[:stop])
        seconds = curve.t[:stop][known]
        rising = _envelope(curve.strain[:stop][known], curve.stress[:stop][known], end is not None)
        known[known] = rising
        nothing = np.full(len(curve.t), math.nan)
        t, strain, stress, across, elastic, uneven, misfit, narrowing, lens, blur = (
            (nothing if a is None else a)[:stop][known]
            for a in (
                curve.t, curve.strain, curve.stress, curve.transverse, elastic, curve.uneven, curve.misfit,
                narrowing, curve.lens, curve.blur,
            )
        )  # fmt: skip
        top = int(np.argmax(stress)) if len(stress) else 0
        half = min(top // _PARTS, _WIDEST)
        return cls(
            t, strain, stress, across, elastic, uneven, misfit, narrowing, lens, blur,
            smoothed(stress, half), smoothed(strain, half),
            noise(strain), noise(stress), half, top, end is not None, _idle(seconds, rising),
        )  # fmt: skip

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.t)


def broken_at(stress: Floats, strain: Floats | None = None) -> int | None:
    """The last sample before the break, or None where there was none.

    The specimen has broken when the stress falls below 2 % of the highest and does not come back; the fall begins at
    the first sample that loses more than five times what is usual there (ISO 6892-1:2019, annex A, on fracture).
    Where the strain goes back with the stress over several samples it is unloaded.

    Parameters
    ----------
    stress : (N,) float64
    strain : (N,) float64, optional
    """
    known = np.flatnonzero(np.isfinite(stress))
    values = stress[known]
    if len(values) < 3 or values.max() <= 0:
        return None
    top = int(np.argmax(values))
    above = int(np.flatnonzero(values > _BACK * values[top])[-1])
    gone = np.flatnonzero(values[above:] < _BROKEN * values[top])
    if not len(gone):
        return None
    k = fallen = above + int(gone[0])
    steps = np.abs(np.diff(values[:k]))
    usual = max(float(np.median(steps)), 3 * noise(values[:k])) if len(steps) else np.inf
    while k > top and values[k - 1] - values[k] > _FALL * usual:
        k -= 1
    first = k if k < fallen else top + int(np.flatnonzero(values[top:fallen] >= values[top] / 2)[-1])
    if strain is not None and _go_down(strain[known][first : fallen + 1], values[first : fallen + 1]):
        return None
    return int(known[k])


def _go_down(strain: Floats, stress: Floats) -> bool:
    """Whether both fall together, over more samples than a break takes."""
    both = np.isfinite(strain)
    if np.count_nonzero(both) < _UNLOADED + 2:
        return False
    e, s = strain[both], stress[both]
    return bool(e[-1] < e[0] and np.corrcoef(e, s)[0, 1] > _TOGETHER)


def _envelope(strain: Floats, stress: Floats, broke: bool) -> NDArray[np.bool_]:
    """Which samples are no unloading and reloading, (N,): from where strain and stress go down to where strain is back.

    One that does not come back is an unloading where the stress goes down to none; before a break it may be a neck
    outside of the gauge.
    """
    rising = np.ones(len(strain), np.bool_)
    if len(strain) < ENOUGH:
        return rising
    least_strain, least = _SURE * noise(strain), max(_SURE * noise(stress), _LOOP * float(stress.max()))
    below = strain < np.maximum.accumulate(strain)
    turns = np.flatnonzero(np.diff(np.concatenate([[False], below, [False]])))
    for first, stop in turns.reshape(-1, 2):
        before, part = first - 1, slice(first, stop)
        deep = strain[before] - strain[part].min() > least_strain
        ends = stop == len(strain) and (broke or stress[-1] > _BACK * stress.max())
        if deep and stress[before] - stress[part].min() > least and not ends:
            rising[part] = False
    return rising


def _idle(t: Floats, rising: NDArray[np.bool_]) -> Floats:
    """Seconds spent in what is left out before each sample that is kept, (M,)."""
    steps = np.diff(t, prepend=t[:1])
    return np.asarray(np.cumsum(np.where(rising, 0.0, steps))[rising])


def true_curve(strain: Floats, stress: Floats) -> tuple[Floats, Floats]:
    """Logarithmic strain and true stress of engineering ones; NaN after the highest stress.

    Volume is kept and strain is uniform, so they hold for plastic metals up to the neck.

    Parameters
    ----------
    strain, stress : (N,) float64

    Returns
    -------
    (N,) float64 each
    """
    if not np.isfinite(stress).any():
        return np.full(len(strain), math.nan), np.full(len(strain), math.nan)
    uniform = np.arange(len(stress)) <= int(np.nanargmax(stress))
    stretch = np.where(uniform & (strain > -1), 1 + strain, math.nan)
    return np.log(stretch), stress * stretch


@dataclass(frozen=True, slots=True)
class UncertainValue:
    """A value, its standard uncertainty, and its slope a sample."""

    value: float
    sigma: float
    slope: float


def reading(values: Floats, at: float, first: int, last: int, min_sigma: float = 0.0) -> UncertainValue:
    """The value at a place between samples, by a parabola through ``values[first:last]``.

    Parameters
    ----------
    values : (N,) float64
    at : float, samples
    first, last : int
        A straight line between the two neighbours is taken where there are fewer samples than ``ENOUGH``.
    min_sigma : float
        Noise of one value, where that of the fit is smaller.
    """
    first, last = max(first, 0), min(last, len(values))
    if last - first < ENOUGH:
        return _between(values, at, min_sigma)
    k = np.arange(first, last) - at
    design = np.vander(k, 3, increasing=True)
    normal = np.linalg.inv(design.T @ design)
    found = normal @ (design.T @ values[first:last])
    rest = values[first:last] - design @ found
    scatter = math.sqrt(float(rest @ rest) / (len(k) - 3))
    return UncertainValue(float(found[0]), max(scatter, min_sigma) * math.sqrt(normal[0, 0]), float(found[1]))


def _between(values: Floats, at: float, sigma: float) -> UncertainValue:
    if len(values) < 2:
        return UncertainValue(float(values[0]), sigma, 0.0)
    k = min(max(math.floor(at), 0), len(values) - 2)
    slope = float(values[k + 1] - values[k])
    return UncertainValue(float(values[k] + (at - k) * slope), sigma, slope)


def noise(values: Floats, order: int = 2) -> float:
    """Standard deviation of white noise on a smooth course, from second differences; 0 of fewer than 5 values.

    Parameters
    ----------
    values : (N,) float64
        At equal distances in time. The median keeps steps and kinks out.
    order : int
        Of the differences: the higher, the less of a bend counts as noise.
    """
    differences = np.diff(values[np.isfinite(values)], n=order)
    if len(differences) < 3:
        return 0.0
    return float(np.median(np.abs(differences))) / _MEDIAN_OF_NORMAL / math.sqrt(math.comb(2 * order, order))


def smoothed(values: Floats, half: int) -> Floats:
    """Running mean over 2 ``half`` + 1 values; fewer, and still symmetric, towards the ends, (N,)."""
    n = len(values)
    total = np.concatenate([[0.0], np.cumsum(values)])
    reach = np.minimum(half, np.minimum(np.arange(n), np.arange(n)[::-1]))
    k = np.arange(n)
    return np.asarray((total[k + reach + 1] - total[k - reach]) / (2 * reach + 1))


def first_crossing(values: Floats, level: float, start: int = 0) -> float:
    """Where ``values`` first reach ``level`` from below, in samples; NaN where they never do, or begin above."""
    above = np.flatnonzero(values[start:] >= level)
    if not len(above) or above[0] == 0:
        return math.nan
    k = start + int(above[0])
    return k - 1 + float((level - values[k - 1]) / (values[k] - values[k - 1]))


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A strain over time.

    Attributes
    ----------
    t : (N,) float64, s
        Increasing.
    value, sigma : (N,) float64
        With its standard uncertainty; NaN where it was lost.
    """

    t: Floats
    value: Floats
    sigma: Floats

    def at(self, t: Floats, max_gap_s: float) -> Course:
        """Between its instants by straight lines; NaN before, after, and in gaps longer than ``max_gap_s``."""
        if len(self.t) < 2:
            return Course(t, *(np.full(len(t), np.nan) for _ in range(2)))
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        span = self.t[k + 1] - self.t[k]
        later = (t - self.t[k]) / span
        value = (1 - later) * self.value[k] + later * self.value[k + 1]
        sigma = np.hypot((1 - later) * self.sigma[k], later * self.sigma[k + 1])
        unknown = (later < 0) | (later > 1) | (span > max_gap_s)
        return Course(t, np.where(unknown, np.nan, value), np.where(unknown, np.nan, sigma))


@dataclass(frozen=True, slots=True, eq=False)
class TwoSides:
    """A strain on both sides of a specimen at the instants of the front.

    Motion towards one of two cameras that face one another enters their strains with opposite signs, as bending does:
    it leaves the mean, and cannot be told from bending in the difference.

    Attributes
    ----------
    t : (N,) float64, s
    mean : (N,) float64
    bending : (N,) float64
        Strain of the front minus the mean: positive where the front is the longer side.
    sigma : (N,) float64
        Standard uncertainty of either: the noise of the cameras, which is independent, and a tilt of up to 0.1 degree.
    """

    t: Floats
    mean: Floats
    bending: Floats
    sigma: Floats

    @classmethod
    def of(cls, front: Course, back: Course, max_gap_s: float) -> TwoSides:
        """Mean and bending; NaN where either side is not known."""
        other = back.at(front.t, max_gap_s)
        sigma = np.hypot(np.hypot(front.sigma, other.sigma) / 2, _SIGMA_OF_TILT)
        return cls(front.t, (front.value + other.value) / 2, (front.value - other.value) / 2, sigma)
