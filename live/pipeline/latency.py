"""The latency of the measurement: a monitor that names the cause of delays, and the priorities of the threads.

Priorities are nice values of threads, on Linux only. Recording
needs a higher priority than measuring: with the recorder at nice +5 hundreds of frames were not recorded
at 150 fps, at 0 none. A thread inherits the value of the thread that starts it, so the pool of the compiled
loops has that of the measuring thread.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acquire.system import processor_times
from acquire.text import Message

WINDOW_S = 5.0
"""The monitor judges the latencies of this time."""
START_S = 2.0
"""After the first result: the bursts that waited for it are late, and give no information on the latency."""
MIN_SAMPLES = 10
REPEAT_S = 30.0
"""A warning is not repeated earlier."""
LATE_PERIODS = 2.0
BUSY_CORES = 0.5
WAITING_SHARE = 0.1
BUSY = 0.8
"""Share of the time between bursts that the kernel may take."""
MEASURE, LOAD, OUTPUT = 3, 5, 10
"""Nice values of threads. Grabbing and recording keep the value that the program was started with."""


@dataclass(frozen=True, slots=True)
class ProcessorUse:
    """Processor time so far, s, and the time of reading (s, monotonic)."""

    t: float
    all: float
    own: float
    children: float

    def since(self, before: ProcessorUse) -> tuple[float, float]:
        """Cores that other programs, and our child processes, have used since ``before``."""
        took = max(self.t - before.t, 1e-3)
        children = (self.children - before.children) / took
        rest = (self.all - before.all - self.own + before.own) / took - children
        return max(rest, 0.0), max(children, 0.0)


def processor_use() -> ProcessorUse | None:
    """The processor time now; None where the system does not provide it."""
    times = processor_times()
    return None if times is None else ProcessorUse(time.monotonic(), times[0], time.process_time(), times[1])


@dataclass(frozen=True, slots=True)
class LatencySample:
    """One measurement: its time (s, monotonic), its latency and the time of the kernel, s."""

    t: float
    latency_s: float
    kernel_s: float


@dataclass(frozen=True, slots=True)
class KernelWork:
    """What the time of the kernel depends on: size and distance of the ZOIs, px, and frames in a burst."""

    zoi: int
    step: int
    burst: int

    def keeping_up(self, share: float) -> str:
        """What would keep up, where the kernel takes ``share`` of the time between bursts."""
        over = share / BUSY
        step, zoi = math.ceil(self.step * math.sqrt(over)), math.floor(self.zoi / math.sqrt(over))
        return Message(
            "--step {step}, --zoi {zoi} or --burst {burst}", step, zoi, math.ceil(self.burst * over)
        )


class LatencyMonitor:
    """Warns when the latency of the last seconds is too large, with the cause.

    Parameters
    ----------
    backlog : callable
        Share of the recorder's buffer that waits for the disk.
    use : callable
        Gives the processor use so far (``processor_use``).
    work : KernelWork, optional
        Of the settings; None: a kernel that is too slow is told again and again, without what would keep up.

    Attributes
    ----------
    p95_s : float, s
        Of the last seconds; NaN before anything was measured.
    """

    def __init__(
        self,
        backlog: Callable[[], float],
        use: Callable[[], ProcessorUse | None] = processor_use,
        work: KernelWork | None = None,
    ) -> None:
        self._backlog, self._use, self._work, self._told = backlog, use, work, False
        self._samples: deque[LatencySample] = deque()
        # The use when the latency was first too large; not read before.
        self._before: ProcessorUse | None = None
        self._warned_t = -math.inf
        self._checked_t = -math.inf
        self._begin_t = math.nan
        self.p95_s = math.nan

    def check(self, sample: LatencySample, period_s: float, *, newest_only: bool = False) -> str:
        """Add a measurement; a warning where the latency has been too large for a second, else empty.

        Parameters
        ----------
        sample : LatencySample
        period_s : float, s
            Between bursts.
        newest_only : bool
            The kernel has been slower than the camera, and gets the newest bursts; that is told once.
        """
        if math.isnan(self._begin_t):
            self._begin_t = sample.t + sample.latency_s + START_S
        if sample.t < self._begin_t:
            return ""
        self._samples.append(sample)
        while self._samples[0].t < sample.t - WINDOW_S:
            self._samples.popleft()
        if sample.t - self._checked_t < 1.0:
            return ""
        self.p95_s = float(np.percentile([one.latency_s for one in self._samples], 95))
        if len(self._samples) < MIN_SAMPLES:
            return ""
        self._checked_t = sample.t
        late = self.p95_s > LATE_PERIODS * period_s or newest_only
        if not late or sample.t - self._warned_t < REPEAT_S:
            self._before = None
            return ""
        now, before = self._use(), self._before
        if before is None and now is not None:
            self._before = now
            return ""
        self._warned_t, self._before = sample.t, None
        cause = self._cause(before, now, period_s, newest_only)
        return cause and Message(
            "results come up to {p95_s:.0f} ms late (p95), bursts every {period_s:.0f} ms: {cause}",
            self.p95_s * 1e3,
            period_s * 1e3,
            cause,
        )

    def _cause(
        self, before: ProcessorUse | None, now: ProcessorUse | None, period_s: float, newest_only: bool
    ) -> str:
        """Why results are late; empty where that was told."""
        if self._backlog() > WAITING_SHARE:
            return Message("the disk is too slow; record less (--record bursts) or on a faster disk")
        others, view = (0.0, 0.0) if before is None or now is None else now.since(before)
        if others > BUSY_CORES:
            return Message("another program takes {others:.1f} processor cores; end it", others)
        kernel = float(np.median([one.kernel_s for one in self._samples]))
        if kernel > BUSY * period_s and newest_only and self._work is not None:
            if self._told:
                return ""
            self._told = True
            return Message(
                "measuring takes {kernel:.0f} ms, so only the newest are measured; {what} would keep up",
                kernel * 1e3,
                self._work.keeping_up(kernel / period_s),
            )
        if kernel > BUSY * period_s:
            return Message(
                "the kernel needs {kernel:.0f} ms; take fewer ZOIs (--step, --roi) or longer bursts",
                kernel * 1e3,
            )
        if view > BUSY_CORES:
            return Message("drawing takes {view:.1f} processor cores; close viewers or give --no-view", view)
        return Message("the processor is short; close what else runs, take fewer ZOIs or longer bursts")
