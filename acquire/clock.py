"""The one clock of a test, how it hangs together with the calendar, and the clocks of devices tied to it.

Everything is stamped in ``time.monotonic()`` seconds; a ``ClockPair`` names the instant of UTC one of them was, so
that a file can be put beside those of other machines. A device's own stamps are free of the jitter of USB, network and
this machine; the least delayed arrivals tie them to ours, and tell at which rate the device's clock runs.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import ClassVar

import numpy as np

from acquire.text import Message

Clock = Callable[[], float]
"""Says the time, s: ``time.monotonic``, or in a test a clock that is moved by hand."""

LATE_S = 5.0  # a device that stays late for so long has set its clock back
TURNS_S = (2**32 * 1e-6, 2**32 * 1e-3)  # after which counters of 32 bits begin again: micros(), millis()
PIECE_S, WINDOW_S = 0.5, 60.0  # the least delayed arrival of each piece of the window is kept
KNOWN, KEPT = 8, 16  # pieces: from which the rate is known, and which are kept however old they are
TICK_S = 2e-3  # of the coarsest clock that is usual, and of USB
NEAR_PART = 0.3  # more than one beat of a latency timer of 16 ms with a clock that is 0.1 % wrong: 16 s
DRIFT_S = 15.0  # from which on the drift is told

Point = tuple[float, float]  # device's time, offset of the host's from it, s


@dataclass(frozen=True, slots=True)
class ClockPair:
    """The same instant on both clocks.

    Attributes
    ----------
    monotonic : float, s
    utc : datetime
        With its time zone.
    """

    monotonic: float
    utc: datetime

    @classmethod
    def now(cls) -> ClockPair:
        """Read both clocks, one right after the other."""
        return cls(time.monotonic(), datetime.now(UTC))

    def iso(self) -> str:
        """UTC in ISO 8601 with microseconds: ``2026-05-09T07:35:25.123456Z``."""
        return self.utc.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")

    @classmethod
    def from_iso(cls, monotonic: float, text: str) -> ClockPair:
        """The pair that ``iso`` wrote.

        Raises
        ------
        ValueError
            Not an ISO 8601 time.
        """
        utc = datetime.fromisoformat(text)
        return cls(monotonic, utc if utc.tzinfo else utc.replace(tzinfo=UTC))


@dataclass(frozen=True, slots=True)
class DeviceTime:
    """When the device stamped a message.

    Attributes
    ----------
    t : float, s
        On the host's clock; of a doubtful one the time of arrival.
    doubtful : bool
        The device's clock does not fit: an old message, or a clock that jumped.
    jumped : bool
        The clock did jump: from here on it is tied anew.
    """

    t: float
    doubtful: bool = False
    jumped: bool = False


class DeviceClock:
    """Ties a device's milliseconds to the host's clock.

    Arrivals are never early: host minus device lies on or above a straight line, whose slope is the rate of the
    device's clock. The slope is an edge of the lower convex hull of the least delayed arrivals (as that of Moon,
    Skelly, Towsley, INFOCOM 1999, doi:10.1109/INFCOM.1999.749287): the one of the newer half that most are near to, so
    that neither a time of load nor its end bends it. From each of these arrivals the offset may have risen by that
    slope and what it may be wrong by, and before it is known by ``rate_limit``; the least of that is the offset. So a
    time lies between the true one and that of the arrival wherever the rate is within its bound.

    Stamps that go back, or leap ahead, are old messages or a clock that jumped (a restart): only when they keep their
    new pace for ``SETTLE_S`` is the clock tied anew. A counter of 32 bits that begins again is followed.

    Parameters
    ----------
    rate_limit : float
        What the rate of the device's clock may be wrong by, before it is known: 2 % of a ceramic resonator.

    Attributes
    ----------
    jumps : int
        Times that the device's clock was tied anew.
    """

    JUMP_S, SETTLE_S = 0.5, 0.5

    def __init__(self, rate_limit: float = 0.02) -> None:
        self._rate_limit = rate_limit
        self._offset = self._last = math.nan
        self._other_offset = self._other_since = self._late_since = math.nan
        self._points: deque[Point] = deque()
        self._piece_since = self._first = math.nan
        self._rate, self._rise, self._turned = 0.0, rate_limit, 0.0
        self._count, self._square = 0, 0.0
        self.jumps = 0

    @property
    def tied(self) -> bool:
        """Whether its stamps can be converted to the host's clock."""
        return not math.isnan(self._offset)

    def begin(self, messages: Sequence[tuple[float, float]]) -> None:
        """Tie to the least delayed of the first ``messages`` (ms, s): they may have waited together."""
        if messages and not self.tied:
            offset = min(arrived - device_ms * 1e-3 for device_ms, arrived in messages)
            self._tie(messages[0][0] * 1e-3, offset)

    def stamp(self, device_ms: float, arrived: float) -> DeviceTime:
        """The stamp of a message.

        Parameters
        ----------
        device_ms : float, ms
        arrived : float, s
            When the message began to arrive.
        """
        device = self._unturned(device_ms * 1e-3 + self._turned, arrived)
        offset = arrived - device
        if not self.tied:
            self._tie(device, offset)
        elif not self._fits(offset, device, arrived):
            if not self._keeps_pace(offset, arrived):
                return DeviceTime(arrived, doubtful=True)
            self._tie(device, offset)
            self.jumps += 1
            return DeviceTime(arrived, jumped=True)
        self._offset = min(self._offset + self._rise * max(device - self._last, 0.0), offset)
        self._last, self._other_offset = device, math.nan
        if math.isnan(self._late_since):
            self._keep((device, offset), arrived)
        t = device + self._offset
        self._count += 1
        self._square += (arrived - t) ** 2
        return DeviceTime(t)

    def _tie(self, device: float, offset: float) -> None:
        self._first = self._last = device
        self._offset, self._rise = offset, self._rate_limit
        self._other_offset = self._late_since = self._piece_since = math.nan
        self._points.clear()

    def _unturned(self, device: float, arrived: float) -> float:
        """The device's time without the turns of its counter."""
        if device < self._last:
            for turn in TURNS_S:
                if abs(arrived - device - turn - self._offset) < self.JUMP_S:
                    self._turned += turn
                    return device + turn
        return device

    def _fits(self, offset: float, device: float, arrived: float) -> bool:
        elapsed = device - self._last
        slack = self.JUMP_S + self._rate_limit * elapsed
        if elapsed < 0 or offset < self._offset - slack:
            return False
        # A clock restarted a moment ago has soon passed its last stamp, but not found its old offset.
        if abs(offset - self._other_offset) < abs(offset - self._offset):
            return False
        if offset <= self._offset + slack:
            self._late_since = math.nan
            return True
        # Late arrivals after a stall of the host catch up; a clock that lost time does not.
        if math.isnan(self._late_since):
            self._late_since = arrived
        return arrived - self._late_since < LATE_S

    def _keeps_pace(self, offset: float, arrived: float) -> bool:
        """Whether the clock has kept a new pace for long enough."""
        if math.isnan(self._other_offset) or abs(offset - self._other_offset) > self.JUMP_S / 5:
            self._other_offset, self._other_since = offset, arrived
        return arrived - self._other_since >= self.SETTLE_S

    # -- its rate

    def _keep(self, point: Point, arrived: float) -> None:
        """Keep the least delayed point of a piece of time."""
        if self._points and arrived - self._piece_since < PIECE_S:
            before = self._points[-1]
            if point[1] - before[1] < self._rate * (point[0] - before[0]):
                self._points[-1] = point
            return
        self._piece_since = arrived
        if not self._points or point[0] > self._points[-1][0]:
            self._points.append(point)
            self._learn()

    def _learn(self) -> None:
        """The slope of the offset, by how much it may rise, and with that the offset now."""
        points = self._points
        while len(points) > KEPT and points[0][0] < points[-1][0] - WINDOW_S:
            points.popleft()
        if len(points) < KNOWN:
            return
        self._rate, above = _best_edge(points)
        self._rise = self._rate + (2 * above + TICK_S) / (points[-1][0] - points[0][0])
        self._offset = min(offset + self._rise * (self._last - device) for device, offset in points)

    @property
    def drift(self) -> float:
        """Seconds gained (positive) or lost a second by the device; NaN in the first 15 s."""
        return -self._rate if self._last - self._first > DRIFT_S else math.nan

    @property
    def jitter_s(self) -> float:
        """Root mean square delay of arrivals, s; NaN before the first."""
        return math.sqrt(self._square / self._count) if self._count else math.nan


def _best_edge(points: Sequence[Point]) -> tuple[float, float]:
    """The slope of that edge of the lower convex hull which ``NEAR_PART`` of the points are nearest to; how near, s.

    Points have ascending times. Delays of a time of load, before or after, make edges that few points are near to. Of
    the older half no edge counts: slopes rise from edge to edge, and a time too early is worse than one too late.
    """
    hull: list[Point] = []
    for x, y in points:
        while len(hull) > 1 and _slope(hull[-2], (x, y)) <= _slope(hull[-2], hull[-1]):
            hull.pop()
        hull.append((x, y))
    times, offsets = np.array(points).T
    near, best = int(NEAR_PART * len(points)), (math.inf, 0.0)
    for left, right in pairwise(hull):
        if right[0] >= (times[0] + times[-1]) / 2:
            slope = _slope(left, right)
            above = offsets - left[1] - slope * (times - left[0])
            best = min(best, (float(np.partition(above, near)[near]), slope))
    return best[1], best[0]


def _slope(left: Point, right: Point) -> float:
    return (right[1] - left[1]) / (right[0] - left[0])


class ClockUnit:
    """What a device's own time counts: milliseconds, unless its pace is that of microseconds or seconds.

    Attributes
    ----------
    ms : float or None, ms
        Of one count; None: it is no clock.
    """

    UNITS: ClassVar = {1.0: "milliseconds", 1e-3: "microseconds", 1e3: "seconds"}
    SOON_S, NEAR = 0.25, 1.25  # from when on a pace tells the unit, and how near it must be
    SURE_S, SURE = 10.0, 1.05  # and so for good
    AGREE, GIVE_UP_S = 3, 3.0

    def __init__(self) -> None:
        self.ms: float | None = 1.0
        self._first: tuple[float, float] | None = None
        self._begun, self._near = math.inf, 0  # looks in a row that agree
        self._found = self._sure = self._fine = False

    def look(self, count: float, arrived: float) -> str:
        """Take the least delayed stamp of a read; what a person must know of the clock now, else "".

        Parameters
        ----------
        count : float
        arrived : float, s
        """
        if self.ms is None or self._sure:
            return ""
        self._fine |= round(10 * count) != 10 * count
        if self._first is None or count < self._first[0]:
            self._first, self._begun = (count, arrived), min(self._begun, arrived)
        elapsed = arrived - self._first[1]
        pace = (count - self._first[0]) / elapsed if elapsed > 0 else 0.0
        if self._found:
            self._sure = elapsed >= self.SURE_S and _near(pace * self.ms, self.SURE)
            return self._refuse(pace) if not self._sure and elapsed > 2 * self.SURE_S else ""
        unit = next((ms for ms in self.UNITS if elapsed >= self.SOON_S and _near(pace * ms, self.NEAR)), None)
        self._near = 0 if unit is None else self._near + 1
        if unit is None or self._near < self.AGREE:
            return self._refuse(pace) if not self._near and arrived - self._begun > self.GIVE_UP_S else ""
        changed, self.ms, self._found = unit != self.ms, unit, True
        if unit == 1e3 and not self._fine:
            self.ms = None
            return Message(
                "the device's own time has whole seconds or tenths only: times are those of arrival"
            )
        return (
            Message("the device's own time counts {unit}, and is taken so", self.UNITS[unit])
            if changed
            else ""
        )

    def _refuse(self, pace: float) -> str:
        self.ms = None
        return Message(
            "the device's own time is no clock in s, ms or us ({pace:.4g} counts a second): times are those of arrival;"
            " check the column of its time (millis=)",
            pace,
        )


def _near(ms_per_s: float, factor: float) -> bool:
    return 1000 / factor < ms_per_s < 1000 * factor
