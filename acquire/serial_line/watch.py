"""Watching a stream of samples: silence, its end, and lines that are no readings, each told once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from acquire.load_sample import LoadFlag, LoadSample

BAD_LINES_TOLD = 10  # in a row

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
        self._tell("warning", f"{told}; check protocol, baud and column")

    def last_words(self, now: float) -> str:
        """Of the last good sample: its force and age."""
        good = self._last_good
        if good is None:
            return "there was no good sample before"
        return f"last good sample {good.force:.6g} N, {now - good.t:.1f} s ago"
