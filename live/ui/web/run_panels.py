"""What the page shows of a running test beside the map: curves, limits, and what several cameras do.

A page requests what it lacks of the rows of its curves. Of the sides of a specimen there are mean, bending and E.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from acquire.clock import Clock
from analysis.evaluate import TensileFigures
from live.config.cameras import BACK, FRONT
from live.config.figures import figure_of
from live.config.sections import AlarmConfig, SpecimenConfig
from live.pipeline.queues import Thinned
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import AXIAL, FPS
from live.results.figures import evaluate, headline, tensile_options
from live.results.sides import SideOfTest, SidesOfTest, newest

MAX_POINTS = 4000


NEAR, SOON_S = 0.9, 10.0
"""A figure is near its limit from this share of it, or where it reaches it within this time at the present rate."""
RATE_S, LEAST_S = 2.0, 0.5
"""The rate is that of the last ``RATE_S``; over less than ``LEAST_S`` there is none."""


FIGURES_S = 2.0
"""Between two evaluations of all that was measured so far."""


class CurveHistory:
    """Rows of numbers by time, bounded: a long test is thinned evenly, and a page then requests all rows again.

    Parameters
    ----------
    names : sequence of str
        Of the columns.
    colours : sequence of int or None
        Stored indices of the colours of those after the third; None: by their place.
    """

    def __init__(self, names: Sequence[str], colours: Sequence[int | None] = ()) -> None:
        self._names, self._colours = list(names), list(colours)
        self._rows: Thinned[Sequence[float]] = Thinned(MAX_POINTS)
        self._lock = threading.Lock()

    def add(self, row: Sequence[float]) -> None:
        """Add a row; a long curve is thinned."""
        with self._lock:
            self._rows.append(row)

    @property
    def position(self) -> tuple[int, int]:
        """Edition (rows of another edition are useless) and number of rows."""
        with self._lock:
            return self._rows.halvings, len(self._rows.kept)

    def outline(self, count: int) -> dict[str, Any]:
        """The curve of a finished test, to be drawn behind the next one: at most ``count`` of its points, SI units."""
        with self._lock:
            rows = [row for row in self._rows.kept if math.isfinite(row[1]) and math.isfinite(row[2])]
        rows = rows[:: max(1, math.ceil(len(rows) / count))]
        return {
            "stress": self._names[1] == "stress",
            "load": [row[1] for row in rows],
            "strain": [row[2] for row in rows],
        }

    def since(self, edition: int, count: int) -> dict[str, Any]:
        """The rows that a page with ``count`` rows of ``edition`` lacks."""
        with self._lock:
            first = count if edition == self._rows.halvings else 0
            return {
                "names": self._names,
                "colours": self._colours,
                "edition": self._rows.halvings,
                "first": first,
                "rows": self._rows.kept[first:],
            }


class FigureLimits:
    """The limits of force, stress and axial strain of one test; for one thread.

    Parameters
    ----------
    alarms : sequence of AlarmConfig
    """

    def __init__(self, alarms: Sequence[AlarmConfig]) -> None:
        self._alarms = alarms
        self._last: deque[tuple[float, Mapping[str, float]]] = deque()
        self._beyond = [False] * len(alarms)

    def add(self, t: float, values: Mapping[str, float]) -> None:
        """The figures by name at ``t``, s, in SI units."""
        self._last.append((t, values))
        while t - self._last[0][0] > RATE_S:
            self._last.popleft()

    def rate(self, name: str) -> float:
        """Rate of a figure, 1/s; NaN where it is not known."""
        known = [(t, values[name]) for t, values in self._last if math.isfinite(values[name])]
        if len(known) < 2 or known[-1][0] - known[0][0] < LEAST_S:
            return math.nan
        return (known[-1][1] - known[0][1]) / (known[-1][0] - known[0][0])

    def of(self, name: str, value: float, axial_name: str = "") -> dict[str, Any] | None:
        """The limit that the figure is nearest to; None without one, and of a figure that is not known.

        Returns
        -------
        dict
            value (SI), share of it, near, beyond, and ends: the alarm ends the test.
        """
        found = [self._one(k, name, value, axial_name) for k in range(len(self._alarms))]
        return max((one for one in found if one), key=lambda one: float(one["share"]), default=None)

    @staticmethod
    def of_range(force: float, range_N: float) -> dict[str, Any] | None:
        """The range of the load cell in place of a limit; None where force or range is not known."""
        share = abs(force) / range_N
        if not math.isfinite(share):
            return None
        return {
            "value": range_N, "share": share, "near": share >= NEAR, "beyond": False, "ends": False, "range": True,
        }  # fmt: skip

    def _one(self, k: int, name: str, value: float, axial_name: str) -> dict[str, Any] | None:
        alarm = self._alarms[k]
        own = {axial_name, f"gauge_{axial_name}"} if axial_name else set()
        channel = figure_of(AXIAL if alarm.channel in own else alarm.channel)
        unit = channel.one
        if (channel.of, channel.part) != (name, "value") or not math.isfinite(value):
            return None
        sign, limit = (1.0, alarm.above) if alarm.above is not None else (-1.0, alarm.below or 0.0)
        limit, over = limit * unit, sign * (value - limit * unit)
        beyond = over > 0 or (self._beyond[k] and over > -alarm.hysteresis * unit)
        self._beyond[k] = beyond
        if sign * limit <= 0:  # a least force, say: no share of it
            return (
                {"value": limit, "share": 1.0, "near": False, "beyond": True, "ends": alarm.end}
                if beyond
                else None
            )
        near = sign * value >= NEAR * sign * limit or -over < SOON_S * sign * self.rate(name)
        return {
            "value": limit,
            "share": max(value / limit, 0.0),
            "near": near and not beyond,
            "beyond": beyond,
            "ends": alarm.end,
        }


class CamerasPanel:
    """What the page shows of all cameras.

    Parameters
    ----------
    states : mapping of str to RunState
    specimen : SpecimenConfig
    now : callable giving monotonic seconds
    """

    def __init__(self, states: Mapping[str, RunState], specimen: SpecimenConfig, now: Clock) -> None:
        self._states, self._specimen, self._now = states, specimen, now
        self._due, self._figures = 0.0, list[dict[str, str]]()

    def state(self) -> dict[str, Any]:
        """Strains at the newest instant of both sides, figures of the test so far, and the cameras."""
        now = self._now()
        if now >= self._due:
            self._figures = side_figures(figures_of(self._states, self._specimen), self._specimen)
            self._due = max(now + FIGURES_S, self._now() + 10 * (self._now() - now))
        return {
            "strains": [{"name": name, **one._asdict()} for name, one in newest(self._states, now).items()],
            "figures": self._figures,
            "cameras": [self._camera(side, now) for side in self._states],
        }

    def _camera(self, side: str, now: float) -> dict[str, Any]:
        state = self._states[side]
        s = state.snapshot(now)
        return {
            "side": side,
            "failed": state.health.camera_failed,
            "valid": s.valid,
            "zois": s.zois,
            "fps": s.figure(FPS).value,
            "skipped": s.frames["skipped"],
            "lost": s.lost,
        }


def figures_of(states: Mapping[str, RunState], specimen: SpecimenConfig) -> dict[str, TensileFigures]:
    """The figures of a test so far, by the mean ("both") and by each side; of fields by each. None before strains."""
    if not all(state.history.has_values for state in states.values()):
        return {}
    if FRONT not in states:
        return {name: evaluate(state.history, state.loads, specimen) for name, state in states.items()}
    front, back = (SideOfTest.of_state(states[side], specimen) for side in (FRONT, BACK))
    return SidesOfTest.of(front, back, tensile_options(specimen)).figures


def side_figures(found: Mapping[str, TensileFigures], specimen: SpecimenConfig) -> list[dict[str, str]]:
    """E, nu and strengths that are known."""
    return [
        {"side": where, "name": row.name, "text": row.text}
        for where, figures in found.items()
        for row in headline(figures, stresses=specimen.area_m2 is not None)
        if row.figure.known
    ]
