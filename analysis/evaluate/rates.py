"""The strain rate of parts of a test, and its duration, held against a standard."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from acquire.text import Message
from acquire.text.message import joined
from analysis.evaluate.curve import Floats, Loading, first_crossing
from analysis.evaluate.elastic import FittedLine
from analysis.evaluate.figure import Figure
from analysis.evaluate.standards import Band, Standard

_PARTS, _IN_PART = 10, 5  # of a strain rate held against a standard, and the points that each needs


def strain_rate(loading: Loading, first: int, last: int, bands: tuple[Band, ...]) -> Figure:
    """The slope of strain over time, held against the bands of a standard."""
    t, strain = (loading.t - loading.idle)[first:last], loading.strain[first:last]
    if len(t) < 3 or np.ptp(t) == 0:
        return Figure.none(Message("{count} points of that part are known", len(t)))
    dt, de = t - t.mean(), strain - strain.mean()
    stt = float(dt @ dt)
    slope = float(dt @ de) / stt
    rest = de - slope * dt
    found = Figure.about(slope, math.sqrt(float(rest @ rest) / (len(t) - 2) / stt), len(t) - 2)
    return replace(found, why=_against(slope, _rates(t, strain), bands))


def _rates(t: Floats, strain: Floats) -> list[float]:
    """The rates of the tenths of a part; none of few points."""
    if len(t) < _PARTS * _IN_PART:
        return []
    parts = zip(np.array_split(t, _PARTS), np.array_split(strain, _PARTS), strict=True)
    return [float(np.polyfit(one - one.mean(), values, 1)[0]) for one, values in parts]


def midway(loading: Loading, line: FittedLine) -> int:
    """Where half the strain between the elastic interval and the highest stress has gone."""
    first, last = line.last - 1, loading.top
    if last <= first:
        return last + 1
    half = 0.5 * (loading.course[first] + loading.course[last])
    return first + int(np.argmax(loading.course[first:] >= half))


def _against(rate: float, parts: list[float], bands: tuple[Band, ...]) -> str:
    """Which of the bands a rate is in, and whether the parts have kept to it."""
    if not bands:
        return ""
    inside = [band for band in bands if band.low <= rate <= band.high]
    if inside:
        kept = all(inside[0].low <= one <= inside[0].high for one in parts)
        tenths = (
            ""
            if kept
            else Message(" on average, its tenths at {least:.2g} to {most:.2g} 1/s", min(parts), max(parts))
        )
        return Message("within {name}{tenths}", inside[0].name, tenths)
    texts = [Message("{name} {low:.2g} to {high:.2g} 1/s", band.name, band.low, band.high) for band in bands]
    allowed = joined(", ", texts)
    return Message("outside the standard ({allowed})", allowed)


def seconds_of(loading: Loading, standard: Standard) -> Figure:
    begins = first_crossing(loading.level, 0.02 * float(loading.stress[loading.top]))
    start = loading.t[0] if math.isnan(begins) else np.interp(begins, np.arange(loading.n), loading.t)
    last = loading.n - 1 if loading.broke else loading.top
    value, step = float(loading.t[last] - start), float(np.median(np.diff(loading.t)))
    wanted, words = standard.seconds_to_break, ""
    if wanted and loading.broke:
        inside = wanted[0] <= value <= wanted[1]
        words = Message(
            "{value} {wanted:g} to {wanted2:g} s of the standard",
            "within" if inside else "outside",
            wanted[0],
            wanted[1],
        )
    return Figure(value, value - step, value + step, words)
