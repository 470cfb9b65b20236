"""Who uses the processor: this program, its view, or somebody else (Linux, from /proc)."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path


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
