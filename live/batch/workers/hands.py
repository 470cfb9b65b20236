"""Worker processes, as their caller sees them: given a task at a time, killed, ended.

Each is a Python of its own with one thread for the numerics (the libraries read that before they are imported). To fork
them off from one that has loaded everything was tried: as many as there are cores load it in the same time.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable

from acquire.held_back import held_back
from live.batch.work import Progress, Row, Task
from live.batch.workers.there import ONE_THREAD

# Of glibc: what one task leaves free goes back to the system before the next one.
_LEAN = {
    "MALLOC_ARENA_MAX": "1", "MALLOC_MMAP_THRESHOLD_": "6000000", "MALLOC_TRIM_THRESHOLD_": "20000000",
}  # fmt: skip
_LAST_S = 5.0

Told = Callable[[Task, Progress], object]


class Hands:
    """``count`` processes that load their libraries while it is found out what there is to do."""

    def __init__(self, count: int) -> None:
        self._idle = deque(Hand() for _ in range(count))

    def are_ready(self) -> bool:
        """Whether all loops are compiled on this machine; waits until a worker has looked.

        Raises
        ------
        OSError
            No process can be started.
        """
        if not self._idle:
            self._idle.append(Hand())
        return self._idle[0].is_ready()

    def take(self) -> Hand:
        """One of them, or a new one where none is left.

        Raises
        ------
        OSError
            No process can be started.
        """
        try:
            return self._idle.popleft()
        except IndexError:
            return Hand()

    def close(self) -> None:
        """Let go of those that nobody took."""
        while self._idle:
            worker = self._idle.popleft()
            worker.kill()
            worker.end()


class Hand:
    """One process; raises OSError where it cannot be started."""

    def __init__(self) -> None:
        with held_back(signal.SIGINT):
            self._process = subprocess.Popen(
                [sys.executable, "-m", "live.batch.workers"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=_LEAN | os.environ | dict.fromkeys(ONE_THREAD, "1"),
                text=True,
                encoding="utf-8",
            )
        self.pid = self._process.pid

    def is_ready(self) -> bool:
        """Its first word, whether it finds all loops compiled; False where it died before."""
        assert self._process.stdout is not None
        try:
            return bool(json.loads(self._process.stdout.readline()).get("compiled"))
        except (OSError, ValueError):
            return False

    def perform(self, task: Task, told: Told) -> Row | None:
        """The row of ``task``; None where the process died over it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(task.to_json() + "\n")
            self._process.stdin.flush()
            for line in self._process.stdout:
                message = json.loads(line)
                if "row" in message:
                    return Row.of(message["row"])
                if "progress" in message:
                    told(task, Progress(**message["progress"]))
        except (OSError, ValueError):  # half a line is the last word of a process that was killed
            pass
        return None

    def kill(self) -> None:
        """At once."""
        self._process.kill()

    def end(self) -> None:
        """Let it go; it ends where nothing comes any more."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._process.wait(_LAST_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
