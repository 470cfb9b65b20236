"""How late the load comes beside the frames, from the test itself.

Up to the end of the elastic part the strain follows the force: strain(t) = a + b f + c f^2 with f = force(t + lag).
The lag is the one for which the two fit best. It shows where the force changes its pace, at the onset above all: on
a straight ramp alone a lag and an offset are the same, and there is no answer; nor where a bend of the curve (c) or, in
a cyclic test, a loop of the material explains as much.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate.curve import Curve, noise
from analysis.evaluate.figure import Figure, quantile
from analysis.evaluate.programme import KindOfTest, reversals

Floats = NDArray[np.float64]

MIN_FRAMES = 20
"""Frames that a lag needs."""

_IN_PART = 10  # of them in the elastic part
_SMOOTH_S = 0.15  # over which the pace of the force is read
_GRID_S = 0.02
_STEPS = 20
_SHARES = (0.2, 0.25, 0.3, 0.38, 0.47, 0.6, 0.75, 1.0)
"""Of the highest force: how far the elastic part is tried to reach."""
_CURVED = 3.5  # standard deviations of a curvature that ends the elastic part
_APART_S, _SEPARATION = 0.2, 20.0  # a lag this far away must fit worse by this many variances
_BENT = 5.0  # times the noise: second differences of the force that are no bend
_BACK = 0.1  # of the highest force: a fall by more ends the first rise
# Without a reading: s, and median intervals; of the highest force, meanwhile
_GAP_S, _GAP, _GAP_MOVED = 0.5, 10.0, 0.02
_KNOWN = 0.95  # of the information that must come from the force itself and not from its noise


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Values over time: (N,) s, ascending, and (N,); NaN where unknown."""

    t: Floats
    values: Floats

    def known(self) -> Track:
        """Without what is not known."""
        good = np.isfinite(self.t) & np.isfinite(self.values)
        return Track(self.t[good], self.values[good])

    @classmethod
    def joined(cls, pieces: Iterable[Track]) -> Track:
        """One after the other; without pieces it is empty."""
        none, parts = np.empty(0), [*pieces]
        t, values = np.concatenate([none, *(one.t for one in parts)]), [none, *(one.values for one in parts)]
        return cls(t, np.concatenate(values))


def find_lag(strain: Track, force: Track, max_lag: float = 1.0, max_half_width: float = 0.1) -> Figure:
    """The time by which the force is stamped later than the strain it belongs to.

    Parameters
    ----------
    strain : Track
        Of the frames, one value a measurement.
    force : Track, N
        Of the load cell, at its own times.
    max_lag : float, s
        Lags up to this, early or late, are tried.
    max_half_width : float, s
        A half-width of the interval above this is no answer.

    Returns
    -------
    Figure, s
        Positive where the load comes late: the force at the time t of a frame is force(t + lag). ``why`` is
        the reason why there is none.
    """
    strain, force = strain.known(), force.known()
    if why := _too_little(strain, force, max_lag) or _turns_round(strain, force):
        return Figure.none(why)
    best: _Fit | None = None
    for share in _SHARES:
        part = _elastic(strain, force, share, max_lag)
        if len(part.t) < _IN_PART:
            continue
        fit = _fit(part, force, max_lag, noise(strain.values))
        if not fit.straight:
            break
        best = fit
    if best is None:
        return Figure.none(
            Message(
                "nowhere from the start on do {IN_PART} frames follow the force in a straight line; begin to measure "
                "some seconds before the load",
                _IN_PART,
            )
        )
    return _accepted(best, max_lag, max_half_width)


@dataclass(frozen=True, slots=True)
class _Fit:
    """The lag over a part of the test.

    lag and its uncertainty (s); by how many variances any other lag fits worse; how significantly the strain
    follows the force; whether in a straight line; and the share of what is known of the lag that the noise of
    the force does not imitate.
    """

    lag: float
    sigma: float
    n: int
    separation: float
    significance: float
    straight: bool
    known: float


def _too_little(strain: Track, force: Track, max_lag: float) -> str:
    if len(strain.t) < MIN_FRAMES:
        return Message("{count} frames have a strain, {MIN_FRAMES} are needed", len(strain.t), MIN_FRAMES)
    if len(force.t) < MIN_FRAMES:
        return Message("{count} load samples, {MIN_FRAMES} are needed", len(force.t), MIN_FRAMES)
    if strain.t[-1] - strain.t[0] < 2 * max_lag or force.t[-1] - force.t[0] < 2 * max_lag:
        return Message("the test is shorter than twice the largest lag looked for, {max_lag:g} s", max_lag)
    if np.ptp(force.values) <= 10 * noise(force.values):
        return Message("the force does not change beyond its noise")
    return ""


def _turns_round(strain: Track, force: Track) -> str:
    """Why the course of the test gives no lag; empty where it may."""
    curve = Curve(strain.t, strain.values, np.interp(strain.t, force.t, force.values))
    cyclic = KindOfTest.of(curve).kind == "cyclic"
    return Message("in a cyclic test a loop of the material looks like a lag") if cyclic else ""


def _elastic(strain: Track, force: Track, share: float, max_lag: float) -> Track:
    """The frames until the force reaches ``share`` of its highest, goes back or has a gap, with force at any lag."""
    base = float(np.median(force.values[: max(len(force.t) // 50, 3)]))
    swing = np.abs(force.values - base)
    turns = reversals(swing, max(_BACK * float(swing.max()), 10 * noise(force.values)))
    first = turns[0] if turns else len(swing) - 1
    reached = min(int(np.argmax(swing >= share * swing.max())), first)
    steps, moved = np.diff(force.t), np.abs(np.diff(force.values)) > _GAP_MOVED * swing.max()
    gaps = np.flatnonzero((steps > max(_GAP_S, _GAP * float(np.median(steps)))) & moved)
    known = min([float(force.t[-1]) - _SMOOTH_S, *force.t[gaps[:1]].tolist()])
    end = min(float(force.t[reached]), known - max_lag)
    inside = (strain.t >= force.t[0] + max_lag + _SMOOTH_S) & (strain.t <= end)
    return Track(strain.t[inside], strain.values[inside])


def _fit(part: Track, force: Track, max_lag: float, noise_strain: float) -> _Fit:
    """The best lag over ``part``; a fit that leaves much more than the noise is not straight."""
    lags = np.arange(-max_lag, max_lag + _GRID_S / 2, _GRID_S)
    bends = _bends(force)
    slope = abs(float(_Model.at(0.0, part, force, 0 * bends, 1.0).found[1]))
    sigma = max(math.hypot(noise_strain, slope * noise(force.values)), 1e-15)
    left = np.array([_Model.at(lag, part, force, slope * bends, sigma).left for lag in lags])
    lag = float(lags[np.argmin(left)])
    for _ in range(_STEPS):
        step = _Model.at(lag, part, force, slope * bends, sigma).step(force)
        lag = float(np.clip(lag + np.clip(step, -_GRID_S, _GRID_S), -max_lag, max_lag))
        if abs(step) < 1e-5:
            break
    elsewhere = left[np.abs(lags - lag) > _APART_S]
    model = _Model.at(lag, part, force, slope * bends, sigma)
    return _assessed(model, force, lag, float(elsewhere.min()) if len(elsewhere) else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """The strain as a parabola over the force at shifted times, each frame by its weight.

    A frame counts less where the force bends between two samples: what lies between them is not known.

    Attributes
    ----------
    t : (N,) float64, s
        Shifted.
    shape : (N, 3) float64
        1, force and its square, weighted.
    values, weight : (N,) float64
    found : (3,) float64
        Factors of ``shape``.
    sigma : float
        Noise of the strain, with that of the force.
    """

    t: Floats
    shape: Floats
    values: Floats
    weight: Floats
    found: Floats
    sigma: float

    @classmethod
    def at(cls, lag: float, part: Track, force: Track, bends: Floats, sigma: float) -> _Model:
        """For a lag; ``bends`` are those of the strain between two samples of the force."""
        t = part.t + lag
        k = np.clip(np.searchsorted(force.t, t, side="right") - 1, 0, len(bends) - 1)
        level, scale = np.interp(t, force.t, force.values), max(float(np.abs(force.values).max()), 1e-300)
        weight = np.asarray(sigma / np.hypot(sigma, bends[k]), np.float64)
        shape = np.column_stack([weight, weight * level, weight * level**2 / scale])
        values = part.values * weight
        found = np.asarray(np.linalg.lstsq(shape, values, rcond=None)[0], np.float64)
        return cls(t, shape, values, weight, found, sigma)

    @property
    def left(self) -> float:
        """Sum of squares that is not explained."""
        rest = self.values - self.shape @ self.found
        return float(rest @ rest)

    def pace(self, force: Track) -> Floats:
        """Weighted change of the strain with the lag, (N,)."""
        half = _SMOOTH_S / 2
        pace = (_mean_force(force, self.t + half) - _mean_force(force, self.t - half)) / _SMOOTH_S
        bent = 2 * self.found[2] * self.shape[:, 2] / np.where(self.shape[:, 1] == 0, 1.0, self.shape[:, 1])
        return np.asarray((self.found[1] + bent) * pace * self.weight)

    def step(self, force: Track) -> float:
        """By how much another lag fits better, s."""
        full = np.column_stack([self.shape, self.pace(force)])
        return float(np.linalg.lstsq(full, self.values, rcond=None)[0][-1])


def _bends(force: Track) -> Floats:
    """How far the force may be from the straight line between two samples, beyond noise, (N - 1,)."""
    bend = np.abs(np.diff(force.values, 2, prepend=force.values[0], append=force.values[-1]))
    return np.asarray(np.maximum((bend[:-1] + bend[1:]) / 4 - _BENT * noise(force.values), 0.0))


def _mean_force(force: Track, t: Floats) -> Floats:
    """The force averaged over ``_SMOOTH_S`` about each time."""
    steps = np.diff(force.t) * 0.5 * (force.values[1:] + force.values[:-1])
    integral = np.concatenate([[0.0], np.cumsum(steps)])
    ends = (np.interp(t + side * _SMOOTH_S / 2, force.t, integral) for side in (1, -1))
    return np.asarray(np.subtract(*ends) / _SMOOTH_S)


def _assessed(model: _Model, force: Track, lag: float, elsewhere: float) -> _Fit:
    n = float(model.weight @ model.weight)
    variance = max(model.left / max(n - 4, 1.0), 1e-30)
    pace = model.pace(force)
    free = _without(pace, model.shape)
    information, spurious = float(free @ free), n * (model.found[1] * _pace_noise(force)) ** 2
    level = _without(model.shape[:, 1], model.shape[:, :1])
    bent = _without(model.shape[:, 2], np.column_stack([model.shape[:, :2], pace]))
    curved = abs(float(bent @ model.values)) / math.sqrt(max(float(bent @ bent), 1e-300) * variance)
    return _Fit(
        lag=lag,
        sigma=math.sqrt(variance / (information - spurious)) if information > spurious else math.inf,
        n=round(n),
        separation=(elsewhere - model.left) / variance,
        significance=abs(model.found[1]) * math.sqrt(float(level @ level) / variance),
        straight=curved < _CURVED and variance < model.sigma**2 * (1 + 5 * math.sqrt(2 / n)),
        known=1 - spurious / information if information > 0 else 0.0,
    )


def _without(values: Floats, columns: Floats) -> Floats:
    """What the columns do not explain."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _pace_noise(force: Track) -> float:
    """Standard deviation that the noise of the force puts into its pace."""
    # Of samples that come in bunches, several with one stamp, the mean distance counts, not the median.
    spacing = float(np.median(np.diff(force.t))) or float(np.ptp(force.t)) / (len(force.t) - 1)
    samples = max(_SMOOTH_S / spacing, 1.0)
    return noise(force.values) * math.sqrt(2 / samples) / _SMOOTH_S


def _accepted(fit: _Fit, max_lag: float, max_half_width: float) -> Figure:
    if fit.significance < 10:
        return Figure.none(Message("the strain does not follow the force"))
    half = quantile(fit.n - 3) * fit.sigma
    if fit.known < _KNOWN or fit.separation < _SEPARATION or not half <= max_half_width:
        return Figure.none(
            Message(
                "the force rises too evenly to tell a lag from an offset; begin to measure some seconds before the "
                "load"
            )
        )
    if abs(fit.lag) > 0.95 * max_lag:
        return Figure.none(Message("no lag within {max_lag:g} s fits; the clocks differ by more", max_lag))
    return Figure.about(fit.lag, fit.sigma, fit.n - 3)
