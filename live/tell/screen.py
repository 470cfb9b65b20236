"""The screen: plain sentences, and one status line that is renewed in place on a terminal.

A terminal that has gone away must not end a recording: what cannot be printed is let go. What was read
from a file or a device may hold anything, and is made harmless.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from acquire.printable import printable

if TYPE_CHECKING:
    from live.measure import Instant
    from live.setup import Rig
    from live.tell.ledger import Ledger

_TERMINAL_EVERY_S, _FILE_EVERY_S = 0.25, 5.0
_MOST_GAUGES = 4  # in the status line


def say(text: str = "") -> None:
    """A line on standard output, made harmless; for commands that need no status line."""
    Screen().say(text)


class Screen:
    """Prints to ``stream``; the status line at most four times a second (a log: every 5 s)."""

    def __init__(
        self, stream: TextIO | None = None, now: Callable[[], float] = time.monotonic, quiet: bool = False
    ) -> None:
        self._stream = stream or sys.stdout
        self._now, self._quiet = now, quiet
        self._terminal = self._stream.isatty()
        self._every = _TERMINAL_EVERY_S if self._terminal else _FILE_EVERY_S
        self._last = -math.inf
        self._width = 0

    def say(self, text: str = "") -> None:
        """A line that stays."""
        if not self._quiet:
            self._write(" " * self._width + "\r" * (self._width > 0) + printable(text) + "\n")
            self._width = 0

    def bell(self) -> None:
        """Ring, where it is a terminal."""
        if self._terminal and not self._quiet:
            self._write("\a")

    def status(self, text: str) -> None:
        """The status line, renewed in place on a terminal."""
        if self._quiet or self._now() - self._last < self._every:
            return
        self._last = self._now()
        text = printable(text)
        if self._terminal:
            self._write(text.ljust(self._width) + "\r")
            self._width = len(text)
        else:
            self._write(text + "\n")

    def waiting(self, ledger: Ledger, what: str) -> None:
        """Nothing to show yet."""
        self.status(f"{what} ... {ledger.grabbed} frames")

    def instant(self, i: Instant, ledger: Ledger, fps: float, p95_s: float = math.nan) -> None:
        """Where the test stands."""
        lost = f"  LOST {ledger.lost + ledger.unrecorded}" if ledger.loss else ""
        late = "" if math.isnan(p95_s) else f"  latency {p95_s * 1e3:.0f} ms"
        self.status(
            f"{fps:.0f} fps{_force(i)}  {_strains(i)}"
            f"  {i.n_valid}/{i.n_zoi} ZOIs in {i.measure_s * 1e3:.0f} ms"
            f"  recorded {ledger.recorded}  skipped {ledger.skipped}{lost}{late}"
        )

    def progress(self, i: Instant, done: int, expected: int | None, elapsed_s: float) -> None:
        """Where a replay stands: ``done`` bursts of the ``expected``, ZOIs a second, the time that is left."""
        of = left = rate = ""
        if expected is not None and done <= expected:
            of, left = f" of {expected}", f"  {_duration(elapsed_s / done * (expected - done))} left"
        if elapsed_s > 0:
            rate = f"  {done * i.n_zoi / elapsed_s:.0f} ZOI/s"
        self.status(f"{done}{of} bursts{_force(i)}  {_strains(i)}  {i.n_valid}/{i.n_zoi} ZOIs{rate}{left}")

    def announce(self, rig: Rig, folder: Path) -> None:
        """What is about to happen."""
        c, cell = rig.camera.info, rig.load.info
        fps = f", {c.fps:g} fps" if c.fps else ""
        self.say(f"camera: {c.name}, {c.width} x {c.height} px, {c.bits} bits{fps}")
        self.say(f"load cell: {cell.name}")
        for warning in (*c.warnings, *cell.warnings):
            self.say(f"warning: {warning}")
        self.say(f"files: {folder}")

    def _write(self, text: str) -> None:
        coding = getattr(self._stream, "encoding", None) or "utf-8"
        try:
            self._stream.write(text.encode(coding, "backslashreplace").decode(coding))
            self._stream.flush()
        except (OSError, ValueError):
            self._quiet = True


def _force(i: Instant) -> str:
    return "" if math.isnan(i.force) else f"  {i.force:.1f} N"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _strains(i: Instant) -> str:
    """The virtual gauges with their sigmas, or the means where there are none."""
    if not i.gauges:
        return f"exx {i.exx * 1e6:+.0f}  eyy {i.eyy * 1e6:+.0f}  exy {i.exy * 1e6:+.0f} um/m"
    words = [
        f"{name} lost" if gauge.reason else f"{name} {gauge.value * 1e6:+.0f} +- {gauge.sigma * 1e6:.0f}"
        for name, gauge in list(i.gauges.items())[:_MOST_GAUGES]
    ]
    return "  ".join(words) + " um/m"
