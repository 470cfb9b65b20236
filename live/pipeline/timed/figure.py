"""The age of figures: one rule for the whole program says what is live, what is old, and what is not there.

A source gives its figures again and again: the load cell with each reading, the camera with each measured burst. A
figure is old after ``OLD_S``, and of a slow source after ``OLD_INTERVALS`` of its usual intervals.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from statistics import median

from acquire.text import Message

OLD_S, OLD_INTERVALS, ARRIVALS = 2.0, 5, 20
TOGETHER_S = 0.1
"""What comes within this time of another arrival came with it: lines that a device sends in one go."""


class FigureState(StrEnum):
    """What is known of a figure at one moment; the values are what screens and strain output write."""

    LIVE = "live"
    OLD = "old"  # nothing has come for longer than the rule allows
    UNKNOWN = "unknown"  # what comes gives no value
    OVERLOAD = "overload"  # as the load cell says
    UNDERLOAD = "underload"
    NOT_YET = Message("not yet")  # at the start, and after a pause
    PAUSED = "paused"
    ENDED = "ended"
    NONE = "none"  # there is no such source


LACKING = (FigureState.OLD, FigureState.UNKNOWN)
BEYOND = (FigureState.OVERLOAD, FigureState.UNDERLOAD)


class Arrivals:
    """The last arrivals of a source, for one thread to add and any to read.

    Parameters
    ----------
    usual_s : float, s
        The usual interval until two have arrived.

    Attributes
    ----------
    usual_s : float, s
        The median interval of the last ``ARRIVALS``.
    """

    def __init__(self, usual_s: float = 0.0) -> None:
        self.usual_s = usual_s
        self._began: deque[float] = deque(maxlen=ARRIVALS)

    def add(self, t: float) -> None:
        """Something arrived at ``t``, s."""
        if self._began and t - self._began[-1] < TOGETHER_S:
            return
        self._began.append(t)
        if len(self._began) > 1:
            self.usual_s = median(later - earlier for earlier, later in pairwise(self._began))

    @property
    def lasts_s(self) -> float:
        """How long a figure of this source is not old, s."""
        return max(OLD_S, OLD_INTERVALS * self.usual_s)


@dataclass(frozen=True, slots=True)
class TimedFigure:
    """A figure as it stands at one moment.

    Attributes
    ----------
    value, sigma : float
        NaN unless it is live.
    t : float, s
        When it was measured, monotonic.
    age : float, s
        Infinite where nothing was measured.
    state : FigureState
    why : str
        Why it is unknown.
    last : float
        The last value, whatever its age; NaN where there was none.
    """

    value: float = math.nan
    sigma: float = math.nan
    t: float = math.nan
    age: float = math.inf
    state: FigureState = FigureState.NONE
    why: str = ""
    last: float = math.nan

    @classmethod
    def at(
        cls,
        now: float,
        t: float,
        value: float,
        sigma: float = math.nan,
        lasts_s: float = OLD_S,
        why: str = "",
    ) -> TimedFigure:
        """A value that was measured at ``t``, NaN because of ``why``, as it stands at ``now`` (s, monotonic)."""
        age = max(now - t, 0.0)
        if age > lasts_s:
            return cls(t=t, age=age, state=FigureState.OLD, last=value)
        if math.isnan(value):
            return cls(t=t, age=age, state=FigureState.UNKNOWN, why=why)
        return cls(value, sigma, t, age, FigureState.LIVE, "", value)

    def but(self, state: FigureState, why: str = "") -> TimedFigure:
        """The same without its value, in another state."""
        return replace(self, value=math.nan, sigma=math.nan, state=state, why=why)

    def scaled(self, factor: float) -> TimedFigure:
        """The figure times ``factor``."""
        value, sigma, last = self.value * factor, self.sigma * abs(factor), self.last * factor
        return replace(self, value=value, sigma=sigma, last=last)

    @property
    def known(self) -> bool:
        """Whether it has a value."""
        return self.state is FigureState.LIVE

    def trouble(self, name: str) -> str:
        """What is wrong with the figure ``name``, in words; empty where nothing is."""
        if self.state in BEYOND:
            return Message("{name}: {upper}", name, self.state.upper())
        if self.state not in LACKING:
            return ""
        return (
            Message("no value of {name}: {why}", name, self.why)
            if self.why
            else Message("no value of {name} for {age:.0f} s", name, self.age)
        )
