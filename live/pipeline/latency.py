"""Whether the measurement keeps up, and what holds it up where it does not.

Who uses the processor: this program, its view, or somebody else (Linux, from /proc).

Who goes first when the processor is short: the camera and the disk before the measurement.

Nice values by thread (Linux; elsewhere nothing happens). Recording must outrank measuring: with the
recorder at +5 hundreds of frames went unrecorded at 150 fps, at 0 none. Threads that a thread
starts inherit its value, so the pool of the compiled loops is at that of the measuring thread.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True, slots=True)
class Use:
    """Processor time so far, s, and when that was (s, monotonic)."""

    t: float
    all: float
    own: float
    children: float

    def since(self, before: Use) -> tuple[float, float]:
        """Cores that others, and our child processes, have used since ``before``."""
        took = max(self.t - before.t, 1e-3)
        children = (self.children - before.children) / took
        rest = (self.all - before.all - self.own + before.own) / took - children
        return max(rest, 0.0), max(children, 0.0)


def used() -> Use | None:
    """Now; None where the system does not tell."""
    try:
        tick = os.sysconf("SC_CLK_TCK")
        fields = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
        # user, nice, system, (idle, iowait), irq, softirq
        busy = sum(fields[i] for i in (0, 1, 2, 5, 6)) / tick
        children = sum(_time_of(child) for child in _children()) / tick
    except (OSError, ValueError, IndexError):
        return None
    return Use(time.monotonic(), busy, time.process_time(), children)


def _children() -> list[str]:
    found: list[str] = []
    for task in Path("/proc/self/task").iterdir():
        found += (task / "children").read_text().split()
    return found


def _time_of(pid: str) -> int:
    """User and system time of a process, in ticks; 0 where it has just gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])


WINDOW_S = 5.0
"""Of the test, over which the pace is judged."""
START_S = 2.0
"""After the first result, until those whose bursts had to wait for it are through: they tell nothing of the pace."""
FEWEST = 10
EVERY_S = 30.0
"""The same warning is not told more often."""
LATE_PERIODS = 2.0
BUSY_CORES = 0.5
WAITING_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class LatencySample:
    """One measurement: when (s, monotonic), how late its result was, and how long the kernel took, s."""

    t: float
    latency_s: float
    kernel_s: float


class LatencyMonitor:
    """Judges the latency of the last seconds.

    Parameters
    ----------
    backlog : callable
        Share of the recorder's buffer that waits for the disk.
    use : callable
        Processor time used so far, by whom (``processor.used``).

    Attributes
    ----------
    p95_s : float, s
        Of the last seconds; NaN before anything was measured.
    """

    def __init__(self, backlog: Callable[[], float], use: Callable[[], Use | None] = used) -> None:
        self._backlog, self._use = backlog, use
        self._lags: deque[LatencySample] = deque()
        self._before: Use | None = (
            None  # when the pace was first found lost: nothing is read while all is well
        )
        self._told = -math.inf
        self._judged = -math.inf
        self._begin = math.nan
        self.p95_s = math.nan

    def look(self, lag: LatencySample, period_s: float) -> str:
        """Take note of a measurement; a warning where the pace has been lost for a second, else empty.

        Parameters
        ----------
        lag : LatencySample
        period_s : float, s
            Between bursts.
        """
        if math.isnan(self._begin):
            self._begin = lag.t + lag.latency_s + START_S
        if lag.t < self._begin:
            return ""
        self._lags.append(lag)
        while self._lags[0].t < lag.t - WINDOW_S:
            self._lags.popleft()
        if lag.t - self._judged < 1.0:
            return ""
        self.p95_s = float(np.percentile([one.latency_s for one in self._lags], 95))
        if len(self._lags) < FEWEST:
            return ""
        self._judged = lag.t
        if not self.p95_s > LATE_PERIODS * period_s or lag.t - self._told < EVERY_S:
            self._before = None
            return ""
        now, before = self._use(), self._before
        if before is None and now is not None:
            self._before = now
            return ""
        self._told, self._before = lag.t, None
        cause = self._cause(before, now, period_s)
        return f"results come up to {self.p95_s * 1e3:.0f} ms late (p95), bursts every {period_s * 1e3:.0f} ms: {cause}"

    def _cause(self, before: Use | None, now: Use | None, period_s: float) -> str:
        if self._backlog() > WAITING_SHARE:
            return "the disk is too slow; record less (--record bursts) or on a faster disk"
        others, view = (0.0, 0.0) if before is None or now is None else now.since(before)
        if others > BUSY_CORES:
            return f"another program takes {others:.1f} processor cores; end it"
        kernel = float(np.median([one.kernel_s for one in self._lags]))
        if kernel > 0.8 * period_s:
            return f"the kernel needs {kernel * 1e3:.0f} ms; take fewer ZOIs (--step, --roi) or longer bursts"
        if view > BUSY_CORES:
            return f"drawing takes {view:.1f} processor cores; close viewers or give --no-view"
        return "the processor is short; close what else runs, take fewer ZOIs or longer bursts"


MEASURE, LOAD, OUTPUT = 3, 5, 10
"""Grabbing and recording stay at the value the program was started with."""


def yield_to_others(nice: int) -> None:
    """Make the calling thread nicer by ``nice``; it cannot be taken back without privileges."""
    if sys.platform != "linux":
        return
    thread = threading.get_native_id()
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + nice)
