"""How late the load comes beside the frames, from the test itself.

Up to the end of the elastic part the strain follows the force: strain(t) = a + b force(t + lag). The lag is
the one for which the two fit best. It shows where the force changes its pace, at the onset above all: on
a straight ramp alone a lag and an offset are the same, and there is no answer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.curve import noise
from analysis.evaluate.figure import Figure, quantile

Floats = NDArray[np.float64]

MIN_FRAMES = 20
"""Frames that a lag needs."""

_SMOOTH_S = 0.15  # over which the pace of the force is read
_GRID_S = 0.02
_STEPS = 20
_SHARES = (0.2, 0.25, 0.3, 0.38, 0.47, 0.6, 0.75, 1.0)
"""Of the highest force: how far the elastic part is tried to reach."""
_CURVED = 3.5  # standard deviations of a curvature that ends the elastic part
_APART_S, _SEPARATION = 0.2, 20.0  # a lag this far away must fit worse by this many variances
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
    if why := _too_little(strain, force, max_lag):
        return Figure.none(why)
    best: _Fit | None = None
    for share in _SHARES:
        part = _elastic(strain, force, share, max_lag)
        if len(part.t) < MIN_FRAMES:
            continue
        fit = _fit(part, force, max_lag, noise(strain.values))
        if not fit.straight:
            break
        best = fit
    if best is None:
        return Figure.none(
            f"nowhere from the start on do {MIN_FRAMES} frames follow the force in a straight line;"
            " begin to measure some seconds before the load"
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
        return f"{len(strain.t)} frames have a strain, {MIN_FRAMES} are needed"
    if len(force.t) < MIN_FRAMES:
        return f"{len(force.t)} load samples, {MIN_FRAMES} are needed"
    if strain.t[-1] - strain.t[0] < 2 * max_lag or force.t[-1] - force.t[0] < 2 * max_lag:
        return f"the test is shorter than twice the largest lag looked for, {max_lag:g} s"
    if np.ptp(force.values) <= 10 * noise(force.values):
        return "the force does not change beyond its noise"
    return ""


def _elastic(strain: Track, force: Track, share: float, max_lag: float) -> Track:
    """The frames until the force reaches ``share`` of its highest, that have force around them at any lag."""
    base = float(np.median(force.values[: max(len(force.t) // 50, 3)]))
    swing = np.abs(force.values - base)
    end = min(float(force.t[np.argmax(swing >= share * swing.max())]), force.t[-1] - max_lag - _SMOOTH_S)
    inside = (strain.t >= force.t[0] + max_lag + _SMOOTH_S) & (strain.t <= end)
    return Track(strain.t[inside], strain.values[inside])


def _fit(part: Track, force: Track, max_lag: float, noise_strain: float) -> _Fit:
    """The best lag over ``part``; a fit that leaves much more than the noise of one strain is not straight."""
    lags = np.arange(-max_lag, max_lag + _GRID_S / 2, _GRID_S)
    left = np.array([_left(part, force, lag)[0] for lag in lags])
    lag = float(lags[np.argmin(left)])
    for _ in range(_STEPS):
        step = float(np.clip(_step(part, force, lag), -_GRID_S, _GRID_S))
        lag = float(np.clip(lag + step, -max_lag, max_lag))
        if abs(step) < 1e-5:
            break
    elsewhere = left[np.abs(lags - lag) > _APART_S]
    return _assessed(part, force, lag, float(elsewhere.min()) if len(elsewhere) else 0.0, noise_strain)


def _columns(part: Track, force: Track, lag: float) -> tuple[Floats, Floats]:
    """1 and the force at the shifted times, (N, 2), and the pace of that force, (N,)."""
    shifted = part.t + lag
    level = np.interp(shifted, force.t, force.values)
    half = _SMOOTH_S / 2
    pace = (_mean_force(force, shifted + half) - _mean_force(force, shifted - half)) / _SMOOTH_S
    return np.column_stack([np.ones_like(level), level]), pace


def _mean_force(force: Track, t: Floats) -> Floats:
    """The force averaged over ``_SMOOTH_S`` about each time."""
    steps = np.diff(force.t) * 0.5 * (force.values[1:] + force.values[:-1])
    integral = np.concatenate([[0.0], np.cumsum(steps)])
    ends = (np.interp(t + side * _SMOOTH_S / 2, force.t, integral) for side in (1, -1))
    return np.asarray(np.subtract(*ends) / _SMOOTH_S)


def _left(part: Track, force: Track, lag: float) -> tuple[float, Floats]:
    """Sum of squares that the best line leaves, and that line: offset and slope."""
    level = np.interp(part.t + lag, force.t, force.values)
    x, y = level - level.mean(), part.values - part.values.mean()
    slope = float(x @ y) / max(float(x @ x), 1e-300)
    rest = y - slope * x
    return float(rest @ rest), np.array([part.values.mean() - slope * level.mean(), slope])


def _step(part: Track, force: Track, lag: float) -> float:
    shape, pace = _columns(part, force, lag)
    found = np.linalg.lstsq(shape, part.values, rcond=None)[0]
    full = np.column_stack([shape, found[1] * pace])
    return float(np.linalg.lstsq(full, part.values, rcond=None)[0][2])


def _assessed(part: Track, force: Track, lag: float, elsewhere: float, noise_strain: float) -> _Fit:
    shape, pace = _columns(part, force, lag)
    left, line = _left(part, force, lag)
    n = len(part.t)
    variance = max(left / (n - 3), 1e-30)
    free = _without(pace, shape)
    information, spurious = float(free @ free), n * _pace_noise(force) ** 2
    true = (information - spurious) * line[1] ** 2
    level = shape[:, 1] - shape[:, 1].mean()
    bent = _without(level**2, np.column_stack([shape, pace]))
    curved = abs(float(bent @ part.values)) / math.sqrt(float(bent @ bent) * variance)
    expected = max(noise_strain, 1e-15) ** 2 * (1 + 5 * math.sqrt(2 / n))
    return _Fit(
        lag=lag,
        sigma=math.sqrt(variance / true) if true > 0 else math.inf,
        n=n,
        separation=(elsewhere - left) / variance,
        significance=abs(line[1]) * math.sqrt(float(level @ level) / variance),
        straight=curved < _CURVED and variance < expected,
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
        return Figure.none("the strain does not follow the force")
    half = quantile(fit.n - 3) * fit.sigma
    if fit.known < _KNOWN or fit.separation < _SEPARATION or not half <= max_half_width:
        return Figure.none(
            "the force rises too evenly to tell a lag from an offset; begin to measure some seconds before the load"
        )
    if abs(fit.lag) > 0.95 * max_lag:
        return Figure.none(f"no lag within {max_lag:g} s fits; the clocks differ by more")
    return Figure.about(fit.lag, fit.sigma, fit.n - 3)
