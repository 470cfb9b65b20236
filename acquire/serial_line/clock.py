"""When a message began: from the time a read returned, the speed of the line, and the device's own clock.

A read returns some time after the last of its bytes arrived; a byte before it came one byte time
earlier (``ArrivalTimes``). Where the device sends its own milliseconds they replace the arrival times, since they are
free of the jitter of USB and of this machine; the least delayed arrivals tie them to the host's clock
(``DeviceClock``). ``ArrivalRate`` finds messages that waited somewhere.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

BEGIN_S = 5.0  # in which the first offset settles
LATE_S = 5.0  # a device that stays late for so long has set its clock back


class ArrivalTimes:
    """Times of single bytes.

    Parameters
    ----------
    byte_time_s : float, s
    """

    def __init__(self, byte_time_s: float) -> None:
        self._byte_time_s = byte_time_s
        self._received = 0
        self._emptied = -math.inf  # when the read before the oldest kept one returned
        self._reads: deque[tuple[int, float]] = deque(maxlen=4096)  # (bytes received after it, its time)

    def received(self, count: int, t: float) -> None:
        """A read returned ``count`` bytes at ``t``."""
        self._received += count
        self._reads.append((self._received, t))

    def began(self, number: int) -> float:
        """When byte ``number`` began on the wire, s; bytes are asked for in ascending order.

        Not before the read that came before it returned, less a byte: that one took all there was.
        """
        while len(self._reads) > 1 and self._reads[0][0] <= number:
            self._emptied = self._reads.popleft()[1]
        until, t = self._reads[0]
        return max(t - (until - number) * self._byte_time_s, self._emptied - self._byte_time_s)


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

    The offset is the least ever seen of host minus device, since delays are never negative; it is
    let rise by ``drift_limit`` so that a slow device clock is followed. Stamps that go back, or leap
    ahead, are old messages or a clock that jumped (a restart): only when they keep their new pace for
    ``settle_s`` is the clock tied anew.

    Attributes
    ----------
    jumps : int
        Times that the device's clock was tied anew.
    """

    def __init__(self, drift_limit: float = 3e-4, jump_s: float = 0.5, settle_s: float = 0.5) -> None:
        self._drift_limit, self._jump_s, self._settle_s = drift_limit, jump_s, settle_s
        self._offset = self._last_ms = math.nan
        self._first_offset = self._first_t = self._last_t = math.nan
        self._other_offset = self._other_since = self._late_since = math.nan
        self._count, self._square = 0, 0.0
        self.jumps = 0

    @property
    def tied(self) -> bool:
        """Whether its stamps can be converted to the host's clock."""
        return not math.isnan(self._offset)

    def begin(self, messages: Sequence[tuple[float, float]]) -> None:
        """Tie to the least delayed of the first ``messages`` (ms, s): they may have waited together."""
        if messages and not self.tied:
            offset, arrived = min((arrived - device_ms * 1e-3, arrived) for device_ms, arrived in messages)
            self._tie(offset, arrived)

    def stamp(self, device_ms: float, arrived: float) -> DeviceTime:
        """The stamp of a message.

        Parameters
        ----------
        device_ms : float, ms
        arrived : float, s
            When the message began to arrive.
        """
        offset = arrived - device_ms * 1e-3
        if math.isnan(self._offset):
            self._tie(offset, arrived)
        elif self._fits(offset, device_ms, arrived):
            risen = self._offset + self._drift_limit * max(arrived - self._last_t, 0.0)
            self._offset, self._other_offset = min(risen, offset), math.nan
            if arrived - self._first_t < BEGIN_S:
                self._first_offset = self._offset
        elif not self._keeps_pace(offset, arrived):
            return DeviceTime(arrived, doubtful=True)
        else:
            self._tie(offset, arrived)
            self.jumps += 1
            self._last_ms, self._last_t = device_ms, arrived
            return DeviceTime(arrived, jumped=True)
        self._last_ms, self._last_t = device_ms, arrived
        t = device_ms * 1e-3 + self._offset
        self._count += 1
        self._square += (arrived - t) ** 2
        return DeviceTime(t)

    def _tie(self, offset: float, arrived: float) -> None:
        self._offset = self._first_offset = offset
        self._first_t = self._last_t = arrived
        self._other_offset = self._late_since = math.nan

    def _fits(self, offset: float, device_ms: float, arrived: float) -> bool:
        if device_ms < self._last_ms or offset < self._offset - self._jump_s:
            return False
        # A clock restarted a moment ago has soon passed its last stamp, but not found its old offset.
        if abs(offset - self._other_offset) < abs(offset - self._offset):
            return False
        if offset <= self._offset + self._jump_s:
            self._late_since = math.nan
            return True
        # Late arrivals after a stall of the host catch up; a clock that lost time does not.
        if math.isnan(self._late_since):
            self._late_since = arrived
        return arrived - self._late_since < LATE_S

    def _keeps_pace(self, offset: float, arrived: float) -> bool:
        """Whether the clock has kept a new pace for long enough."""
        if math.isnan(self._other_offset) or abs(offset - self._other_offset) > self._jump_s / 5:
            self._other_offset, self._other_since = offset, arrived
        return arrived - self._other_since >= self._settle_s

    @property
    def drift(self) -> float:
        """Seconds gained (positive) or lost a second by the device; NaN in the first 15 s."""
        span = self._last_t - self._first_t
        return (self._first_offset - self._offset) / (span - BEGIN_S) if span > 3 * BEGIN_S else math.nan

    @property
    def jitter_s(self) -> float:
        """Root mean square delay of arrivals, s; NaN before the first."""
        return math.sqrt(self._square / self._count) if self._count else math.nan


class ArrivalRate:
    """Which messages come later than the device's own pace lets them.

    A device sends at a pace of its own; the least delayed messages tie that pace to the host's clock, as
    ``DeviceClock`` does with milliseconds. What comes more than 50 ms, or one period, after its time has
    waited somewhere. So have more messages than the device can have made. After a pause it is
    unknown whether the device or the line has paused: messages are late until they have come at their pace for
    ``settle_s``. Where no pace is known (at first, or of a device that sends when it likes) all but the last
    message of a read are late.

    Parameters
    ----------
    late_s, settle_s : float, s
    """

    RISE, FALL = 0.1, 0.2  # how far the pace known may be wrong, slow and fast
    GROUP_S, GROUPS, KNOWN = 0.25, 31, 2

    def __init__(self, late_s: float = 0.05, settle_s: float = 0.25) -> None:
        self._late_s, self._settle_s = late_s, settle_s
        self._periods: deque[float] = deque(maxlen=self.GROUPS)
        self.restart()

    def restart(self) -> None:
        """The connection was interrupted."""
        self._periods.clear()
        self._group: tuple[float, int] | None = None  # its beginning, messages in it
        self._due = self._tie = self._last = math.nan
        self._other = self._other_since = math.nan
        self._credit = self._late_s

    @property
    def period(self) -> float:
        """Seconds from one message to the next, the median of the last groups; NaN where they keep no pace."""
        found = sorted(self._periods)
        quarter = len(found) // 4
        if len(found) < self.KNOWN or (quarter >= 2 and found[-1 - quarter] > 1.5 * found[quarter]):
            return math.nan
        return statistics.median(found)

    def late(self, times: Sequence[float]) -> list[bool]:
        """Whether each of the messages that one read brought, with these stamps, is late.

        Parameters
        ----------
        times : sequence of float, s
            Not empty, ascending.
        """
        period = self.period
        self._learn(times)
        if math.isnan(period):
            return [True] * (len(times) - 1) + [False]
        if math.isnan(self._tie):
            self._due, self._tie, self._last = times[0] - period, 0.0, times[-1]
        delays = self._delays(times, period)
        limit = max(self._late_s, period)
        if self._doubtful(delays[-1], times[-1], limit) and not self._keeps_pace(
            delays[-1], times[-1], period
        ):
            return [True] * len(times)
        self._other = math.nan
        return [delay - self._tie > limit for delay in delays]

    def _learn(self, times: Sequence[float]) -> None:
        """The period of messages in groups of a quarter of a second; a stall makes a single odd group."""
        if self._group is None:
            self._group = times[-1], 0
            return
        begun, count = self._group[0], self._group[1] + len(times)
        if times[-1] - begun >= self.GROUP_S:
            self._periods.append((times[-1] - begun) / count)
            begun, count = times[-1], 0
        self._group = begun, count

    def _delays(self, times: Sequence[float], period: float) -> list[float]:
        delays = []
        for t in times:
            self._due += period
            delays.append(t - self._due)
        return delays

    def _doubtful(self, delay: float, now: float, limit: float) -> bool:
        """Whether the last message is late, or one too many; else it may tie the pace anew."""
        elapsed, self._last = now - self._last, now
        self._credit = min(self._late_s, self._credit + self.FALL * elapsed)
        fall = max(self._tie - delay, 0.0)
        if delay - self._tie > limit or fall > self._credit:
            return True
        self._credit -= fall
        self._tie = min(self._tie + self.RISE * min(elapsed, limit), delay)
        return False

    def _keeps_pace(self, delay: float, now: float, period: float) -> bool:
        """Whether messages have come at their pace, not faster, for long enough: it was the device that paused."""
        elapsed = now - self._other_since
        if math.isnan(self._other) or self._other - delay > self.FALL * elapsed + period:
            self._other, self._other_since = delay, now
            return False
        if elapsed < max(self._settle_s, 1.2 * period):
            return False
        self._tie, self._credit = delay, self._late_s
        return True
