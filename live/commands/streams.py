"""Standard output and error that keep nobody waiting.

A terminal stopped with Ctrl-S, or a pipe that nobody reads, would hold up whatever writes to it: the
measurement, and through the log the grabbing of frames. Here a thread writes, and what finds no room is
left out and counted.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections import deque
from collections.abc import Iterator
from typing import TextIO

ROOM = 2000  # writes that may wait
LAST_S = 1.0  # how long the end waits for a stream that takes nothing


class NonBlockingStream:
    """Passes writes on to ``stream`` from a thread of its own; what a failing stream does not take is let go."""

    def __init__(self, stream: TextIO, room: int = ROOM) -> None:
        self._stream, self._room = stream, room
        self.encoding = getattr(stream, "encoding", None) or "utf-8"
        self._left_out = 0
        self._waiting: deque[str] = deque()
        # Re-entrant, since a signal handler may write in the middle of a write.
        self._changed = threading.Condition(threading.RLock())
        self._busy = False
        self._thread = threading.Thread(target=self._work, name="terminal", daemon=True)
        self._thread.start()

    def write(self, text: str) -> int:
        """Take ``text``; never waits."""
        with self._changed:
            if len(self._waiting) >= self._room:
                self._left_out += 1
                return len(text)
            if self._left_out:
                self._waiting.append(f"({self._left_out} writes left out: nobody read them)\n")
                self._left_out = 0
            self._waiting.append(text)
            self._changed.notify_all()
        return len(text)

    def flush(self) -> None:
        """Nothing to do: the thread flushes."""

    def isatty(self) -> bool:
        """As the stream says."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """As the stream says."""
        return self._stream.fileno()

    def drain(self, stall_s: float = LAST_S) -> bool:
        """Wait until all is written; False where the stream took nothing for ``stall_s``."""
        with self._changed:
            while self._waiting or self._busy:
                before = len(self._waiting)
                self._changed.wait(stall_s)
                if len(self._waiting) >= before and (self._waiting or self._busy):
                    return False
        return True

    def _work(self) -> None:
        while True:
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._waiting)
                text, self._busy = self._waiting.popleft(), True
            with contextlib.suppress(OSError, ValueError):
                self._put(text)

    def _put(self, text: str) -> None:
        """Past the buffer of the stream where that can be: its lock, held by a write that waits, outlives us."""
        try:
            number = self._stream.fileno()
        except (OSError, ValueError, AttributeError):
            self._stream.write(text)
            self._stream.flush()
            return
        data = text.encode(self.encoding, "backslashreplace")
        while data:
            data = data[os.write(number, data) :]


@contextlib.contextmanager
def unhurried_streams() -> Iterator[None]:
    """``sys.stdout`` and ``sys.stderr`` made ``NonBlockingStream`` meanwhile."""
    before = sys.stdout, sys.stderr
    ours = [NonBlockingStream(stream) for stream in before]
    sys.stdout, sys.stderr = ours
    try:
        yield
    finally:
        for one in ours:
            one.drain()
        sys.stdout, sys.stderr = before
