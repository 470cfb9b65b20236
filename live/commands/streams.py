"""Standard output and error that never block.

A terminal stopped with Ctrl-S, or a pipe that nobody reads, would block its writers: the measurement and, through
the log, the grabbing of frames. Here a thread writes; writes beyond its queue are dropped and counted.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections import deque
from collections.abc import Iterator
from typing import TextIO

QUEUE_SIZE = 2000  # writes
STALL_S = 1.0  # the end waits so long for a blocked stream


class NonBlockingStream:
    """Passes writes to ``stream`` in its own thread; writes that the stream refuses are dropped."""

    def __init__(self, stream: TextIO, queue_size: int = QUEUE_SIZE) -> None:
        self._stream, self._queue_size = stream, queue_size
        self.encoding = getattr(stream, "encoding", None) or "utf-8"
        self._left_out = 0
        self._waiting: deque[str] = deque()
        # Re-entrant: a signal handler may write during a write.
        self._changed = threading.Condition(threading.RLock())
        self._busy = False
        self._thread = threading.Thread(target=self._work, name="terminal", daemon=True)
        self._thread.start()

    def write(self, text: str) -> int:
        """Queue ``text``; never waits."""
        with self._changed:
            if len(self._waiting) >= self._queue_size:
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
        """As of the stream."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """As of the stream."""
        return self._stream.fileno()

    def drain(self, stall_s: float = STALL_S) -> bool:
        """Wait until all is written; False if the stream accepted nothing for ``stall_s``."""
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
        """Write to the file descriptor if there is one: a blocked write would hold the lock of the buffer at exit."""
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
def nonblocking_streams() -> Iterator[None]:
    """``sys.stdout`` and ``sys.stderr`` replaced by ``NonBlockingStream`` within the context."""
    before = sys.stdout, sys.stderr
    replaced = [NonBlockingStream(stream) for stream in before]
    sys.stdout, sys.stderr = replaced
    try:
        yield
    finally:
        for stream in replaced:
            stream.drain()
        sys.stdout, sys.stderr = before
