"""Where zero is: the tare, what it needs, and its undoing."""

from __future__ import annotations

import itertools
import math
import statistics
from collections import deque

from acquire.load_cell import Stillness, stillness

WINDOW_S, LONGEST_S = 0.5, 3.0  # of the samples that a tare looks at; of a slow device
KEPT = 4096  # samples
UNDONE = 16  # tares that can be undone

Seen = tuple[float, float, str]  # time, gross force, why it cannot be used


class Zero:
    """The offset that is taken off every force, and the samples that decide whether it may move.

    Attributes
    ----------
    offset : float, N
    step_N : float, N
        Value of the last digit seen.
    """

    def __init__(self) -> None:
        self.offset, self.step_N = 0.0, 0.0
        self._before: deque[float] = deque(maxlen=UNDONE)
        self._seen: deque[Seen] = deque(maxlen=KEPT)

    def saw(self, t: float, gross: float, unfit: str = "") -> None:
        """A sample of ``t``; ``unfit`` says why a tare must not rest on it."""
        self._seen.append((t, gross, unfit))

    def why_not(self, now: float) -> str:
        """Why no tare should be made now; "" where the load is still."""
        window = self._window_s()
        recent = [seen for seen in self._seen if seen[0] >= now - window]
        if not recent:
            return f"no valid sample in the last {window:.1f} s"
        unfit = [why for _, gross, why in recent if why and (math.isnan(gross) or why == recent[-1][2])]
        if unfit:
            return f"{len(unfit)} of the {len(recent)} samples of the last {window:.1f} s are {unfit[-1]}"
        found = self._judge(recent)
        if found.n < 3:
            return f"only {found.n} samples in the last {window:.1f} s"
        if not found.still:
            moved = max(abs(found.moved_N), found.range_N)
            return f"the load is not still: it moved by {moved:.4g} N in the last {window:.1f} s"
        return ""

    def _window_s(self) -> float:
        """Half a second; of a slow device as long as a few samples take."""
        last = [t for t, *_ in itertools.islice(reversed(self._seen), 8)]
        steps = [later - earlier for later, earlier in itertools.pairwise(last)]
        return min(max(WINDOW_S, 3.5 * statistics.median(steps)), LONGEST_S) if steps else WINDOW_S

    def _judge(self, seen: list[Seen]) -> Stillness:
        return stillness([t for t, *_ in seen], [gross for _, gross, _ in seen], self.step_N)

    def load(self) -> float:
        """The mean load before the offset, N, of the last valid samples, however old; NaN where there is none."""
        valid = [seen for seen in self._seen if math.isfinite(seen[1])]
        recent = [gross for t, gross, _ in valid if t >= valid[-1][0] - WINDOW_S]
        return math.fsum(recent) / len(recent) if recent else math.nan

    def take(self) -> float:
        """Make that load zero; by how much forces fall from now on, N."""
        return self._move(self.load())

    def undo(self) -> float | None:
        """As before the last tare; by how much forces fall from now on, None where there was no tare."""
        if not self._before:
            return None
        offset = self._before.pop()
        step, self.offset = offset - self.offset, offset
        return step

    def moved_in_device(self) -> float:
        """The device made the present load zero; by how much forces fall from now on, N.

        What was seen is void. An undoing is made here, by what the load was, since the device has none.
        """
        load = self.load()
        step = load - self.offset
        self._before.append(self.offset)
        self._before = deque((before - load for before in self._before), maxlen=UNDONE)
        self.offset = 0.0
        self._seen.clear()
        if math.isnan(load):
            self._before.clear()
        return step

    def _move(self, offset: float) -> float:
        self._before.append(self.offset)
        step, self.offset = offset - self.offset, offset
        return step
