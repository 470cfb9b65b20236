"""Whether the measurement keeps up, and what holds it up where it does not."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from live.pace.processor import Use, used

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
class Lag:
    """One measurement: when (s, monotonic), how late its result was, and how long the kernel took, s."""

    t: float
    latency_s: float
    kernel_s: float


class Pace:
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
        self._lags: deque[Lag] = deque()
        self._before: Use | None = (
            None  # when the pace was first found lost: nothing is read while all is well
        )
        self._told = -math.inf
        self._judged = -math.inf
        self._begin = math.nan
        self.p95_s = math.nan

    def look(self, lag: Lag, period_s: float) -> str:
        """Take note of a measurement; a warning where the pace has been lost for a second, else empty.

        Parameters
        ----------
        lag : Lag
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
