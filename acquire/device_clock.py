"""The clock of a device tied to ours: of a load cell that sends its milliseconds, of a camera that stamps its frames.

A device's own stamps are free of the jitter of USB, network and this machine; the least delayed arrivals tie them to
the host's clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

BEGIN_S = 5.0  # in which the first offset settles
LATE_S = 5.0  # a device that stays late for so long has set its clock back


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
