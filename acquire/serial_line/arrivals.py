"""What arrives on a serial line: an echo of the poll taken out, and when a message began.

Two wires of RS-485 carry both directions, and many adapters hear themselves. An answer may also begin with the poll, or
be equal to it, where no adapter echoes: what was sent is an echo only where the bytes behind it make more sense without
it (``Echo``). A read returns some time after the last of its bytes arrived; a byte before it came one byte time earlier
(``ArrivalTimes``). ``ArrivalRate`` finds messages that waited somewhere. Where the device sends its own milliseconds
``acquire.clock`` replaces the arrival times.
"""

from __future__ import annotations

import copy
import math
import statistics
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

from acquire.clock import ClockUnit
from acquire.protocols.base import Parser, Reading
from acquire.text import Message

LIMIT = 1024  # bytes held
DOUBT = Message("if the adapter echoes, the values are wrong: let the poll end with a line end")


class Echo:
    """Takes the echo out of what follows each poll.

    Until it is known whether the adapter echoes, what begins like the poll is held until the answer behind it is
    whole, or silence comes. Known, it is taken out as it comes, in pieces or at once.

    Parameters
    ----------
    parser : Parser
        That of the line, at the place where it is; copies of it try what the bytes mean.
    report : callable taking level and text

    Attributes
    ----------
    known : bool
        The adapter echoes.
    """

    def __init__(self, parser: Parser, report: Callable[[str, str], None]) -> None:
        self._parser, self._report = parser, report
        self._sent = self._held = b""
        self._told: set[str] = set()
        self.known = False

    def sent(self, data: bytes) -> None:
        """A poll was sent, or a command among polls."""
        self._sent += data

    def take(self, data: bytes) -> bytes:
        """What of the bytes that came, and of those held, goes on to the parser now."""
        self._held += data
        if not self._sent or len(self._held) > LIMIT:
            return self.release()
        if not (self._held.startswith(self._sent) or self._sent.startswith(self._held)):
            self.known = False
            return self.release()
        rest = self._held[len(self._sent) :]
        if len(self._held) < len(self._sent) or not (self.known or self._decided(rest)):
            return b""
        whole = self.release()
        return rest if self.known else whole

    def release(self) -> bytes:
        """What is held: it is no echo."""
        held, self._held, self._sent = self._held, b"", b""
        return held

    def _decided(self, rest: bytes) -> bool:
        """Whether the answer is whole, with the echo or without."""
        raw, bare = self._values(self._held), self._values(rest)
        self.known = any(bare) and not (all(raw) and len(raw) == len(bare))
        if self.known:
            self._tell(
                "info", Message("the adapter sends back what is sent to it (an echo): it is taken out")
            )
        elif any(bare):
            self._tell(
                "warning",
                Message(
                    "answers begin with the poll itself, {sent}, and are taken whole: {DOUBT}",
                    repr(self._sent),
                    DOUBT,
                ),
            )
        return any(bare) or (bool(bare) and all(raw))

    def _tell(self, level: str, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._report(level, text)

    def _values(self, data: bytes) -> list[bool]:
        """Whether each reading in the bytes is a value."""
        parser = copy.deepcopy(self._parser)
        return [not math.isnan(reading.value) for reading in (*parser.feed(data), *parser.silence())]


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


class ArrivalRate:
    """Which messages come later than the device's own pace lets them.

    A device sends at a pace of its own; the least delayed messages tie that pace to the host's clock, as
    ``DeviceClock`` does with milliseconds. What comes more than 50 ms, or one period, after its time has
    waited somewhere. So have more messages than the device can have made. After a pause it is
    unknown whether the device or the line has paused: messages are late until they have come at their pace for
    ``SETTLE_S``. Where no pace is known (at first, or of a device that sends when it likes) all but the last
    message of a read are late.
    """

    RISE, FALL = 0.1, 0.2  # how far the pace known may be wrong, slow and fast
    GROUP_S, GROUPS, KNOWN = 0.25, 31, 2
    LATE_S, SETTLE_S = 0.05, 0.25

    def __init__(self) -> None:
        self._periods: deque[float] = deque(maxlen=self.GROUPS)
        self.restart()

    def restart(self) -> None:
        """The connection was interrupted."""
        self._periods.clear()
        self._group: tuple[float, int] | None = None  # its beginning, messages in it
        self._due = self._tie = self._last = math.nan
        self._other = self._other_since = math.nan
        self._credit = self.LATE_S

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
        delays = []
        for t in times:
            self._due += period
            delays.append(t - self._due)
        limit = max(self.LATE_S, period)
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

    def _doubtful(self, delay: float, now: float, limit: float) -> bool:
        """Whether the last message is late, or one too many; else it may tie the pace anew."""
        elapsed, self._last = now - self._last, now
        self._credit = min(self.LATE_S, self._credit + self.FALL * elapsed)
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
        if elapsed < max(self.SETTLE_S, 1.2 * period):
            return False
        self._tie, self._credit = delay, self.LATE_S
        return True


def in_milliseconds(
    unit: ClockUnit, readings: Sequence[Reading], arrived: float
) -> tuple[list[Reading], str]:
    """Readings with the device's own time in ms, or without it where it is no clock; what a person must know of it.

    Parameters
    ----------
    unit : ClockUnit
        Looks at the last of them.
    readings : sequence of Reading
        Not empty.
    arrived : float, s
        When the last began to arrive; NaN where they may have waited.
    """
    count = readings[-1].device_ms
    told = "" if count is None or math.isnan(arrived) else unit.look(count, arrived)
    ms = unit.ms
    if ms == 1.0:
        return list(readings), told
    return [
        replace(r, device_ms=None if ms is None or r.device_ms is None else r.device_ms * ms)
        for r in readings
    ], told
