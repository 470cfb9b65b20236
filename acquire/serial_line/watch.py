"""Watching a stream: silence, its end, lines that are no readings, and more than can be read, each told once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from acquire.load_sample import LoadFlag, LoadSample

BAD_LINES_TOLD = 10  # in a row
LATE_S = 0.05
SKIP_S = 0.25  # that a port may stay full before what waits in it is skipped
AGAIN_S = 10.0  # without a flood until it is told anew

Tell = Callable[[str, str], None]  # level, sentence


class LoadWatch:
    """What a person is told of a stream.

    Parameters
    ----------
    timeout_s : float, s
        Silence that is told.
    tell : callable taking level and text
    now : float, s
        When the watch begins.
    """

    def __init__(self, timeout_s: float, tell: Tell, now: float) -> None:
        self._timeout_s, self._tell = timeout_s, tell
        self._since = now
        self._last_good: LoadSample | None = None
        self._silent = self._bad_told = False
        self._bad = 0

    def restart(self, now: float) -> None:
        """Silence counts from ``now``."""
        self._since = now

    def look(self, samples: Sequence[LoadSample], now: float) -> None:
        """Take what one read brought, nothing included."""
        good = [sample for sample in samples if not math.isnan(sample.force)]
        if samples:
            self._count_bad(samples, bool(good))
        if good:
            self._last_good, self._since, self._bad_told = good[-1], now, False
            if self._silent:
                self._tell("info", "readings come again")
            self._silent = False
        elif not self._silent and now - self._since > self._timeout_s:
            self._silent = True
            self._tell("warning", f"no reading for {self._timeout_s:g} s; {self.last_words(now)}")

    def _count_bad(self, samples: Sequence[LoadSample], any_good: bool) -> None:
        self._bad = 0 if any_good else self._bad + sum(LoadFlag.ERROR in s.flags for s in samples)
        if self._bad < BAD_LINES_TOLD or self._bad_told:
            return
        self._bad_told = True
        shown = samples[-1].raw[:60].decode("ascii", "backslashreplace")
        told = f"{self._bad} lines in a row give no reading, the last one {shown!r}"
        self._tell("warning", f"{told}; check protocol, baud, column and decimal")

    def last_words(self, now: float) -> str:
        """Of the last good sample: its force and age."""
        good = self._last_good
        if good is None:
            return "there was no good sample before"
        return f"last good sample {good.force:.6g} N, {now - good.t:.1f} s ago"


class Flood:
    """Knows when the port was last found empty.

    Parameters
    ----------
    tell : callable taking level and text
    now : float, s
    """

    def __init__(self, tell: Tell, now: float) -> None:
        self._tell = tell
        self._emptied, self._begun, self._told = now, math.inf, -math.inf  # begun: the first full read
        self._lines = 0

    def read(self, full: bool, lines: int, now: float) -> None:
        """A read returned; ``full`` when more may wait behind what it brought."""
        if not full:
            self._emptied, self._begun = now, math.inf
        elif self._begun == math.inf:
            self._begun, self._lines = now, 0
        self._lines += lines

    def late(self, now: float) -> bool:
        """Whether what was just read may have waited for longer than anybody should."""
        return now - self._emptied > LATE_S

    def too_late(self, now: float) -> bool:
        """Whether what still waits should be skipped; tells of it."""
        if now - self._begun <= SKIP_S:
            return False
        if now - self._told > AGAIN_S:
            rate = self._lines / (now - self._begun)
            text = f"lines come faster than they are read ({rate:.0f}/s); what waits is skipped and flagged STALE:"
            self._tell("warning", f"{text} have the device send fewer")
        self._told = now
        return True

    def skip(self, empty: bool, now: float) -> None:
        """What waited was thrown away; ``empty`` when nothing was left."""
        self._begun = math.inf
        if empty:
            self._emptied = now
