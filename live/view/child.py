"""One process that draws, and the socket to it; nothing here waits for it but ``end``.

The process is a plain child in our own session, so that its nice value counts against our threads. It
ignores Ctrl-C, since a terminal sends that to all, and ends by itself when our end of the socket closes,
also when we are killed.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

from acquire.held_back import held_back
from live.view.exchange.wire import Message, Reader, encoded

_SEND_BYTES = 1 << 20
_ROOT = str(Path(__file__).parents[2])
_MODULE = "live.view.drawing"
_KILLED_S = 5.0


class Child:
    """A process that draws, from its start to its end.

    Attributes
    ----------
    pid : int
    progress_t : float, s
        When it last took or gave something (``time.monotonic``).
    """

    def __init__(self) -> None:
        ours, its = socket.socketpair()
        with its, held_back(signal.SIGINT, signal.SIGHUP):
            # It lets them through once it ignores them.
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", _MODULE],
                stdin=its.fileno(),
                stdout=subprocess.DEVNULL,
                env=_environment(),
            )
        with contextlib.suppress(OSError):
            ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
        ours.setblocking(False)
        self._socket, self._reader = ours, Reader(ours)
        self._waiting: deque[memoryview] = deque()
        self.pid, self.progress_t = self._process.pid, time.monotonic()

    def send(self, message: Message) -> None:
        """Put ``message`` behind what waits."""
        if not self._waiting:
            self.progress_t = time.monotonic()
        self._waiting.extend(encoded(message))

    def pushed(self) -> bool:
        """Hand over what the process takes at once; whether all is gone.

        Raises
        ------
        OSError
            The process is gone.
        """
        while self._waiting:
            try:
                sent = self._socket.sendmsg(list(self._waiting)[:16])
            except BlockingIOError:
                return False
            self.progress_t = time.monotonic()
            self._let_go(sent)
        return True

    def _let_go(self, sent: int) -> None:
        while sent:
            piece = self._waiting.popleft()
            if sent < piece.nbytes:
                self._waiting.appendleft(piece[sent:])
                return
            sent -= piece.nbytes

    def replies(self) -> Iterator[Message]:
        """What it has said since.

        Raises
        ------
        EOFError, OSError
            The process is gone.
        """
        with contextlib.suppress(BlockingIOError):
            while True:
                message = self._reader.next()
                self.progress_t = time.monotonic()
                yield message

    def wait(self, seconds: float, *, to_send: bool) -> None:
        """Until it says something (or takes something), at most ``seconds``."""
        select.select([self._socket], [self._socket] if to_send else [], [], seconds)

    def end(self, seconds: float = 0.0) -> int:
        """Close the socket and see the process off, killed after ``seconds``; what it ended with."""
        self._socket.close()
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self._process.wait(_KILLED_S)
        return -signal.SIGKILL


def _environment() -> dict[str, str]:
    """Ours, with this very code in front; -P keeps the folder we were started in out of it.

    Rerun's allocator is to give back at once what its server lets go: a tenth less memory in a long test.
    """
    paths = [_ROOT, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {"MIMALLOC_PURGE_DELAY": "0", **os.environ, "PYTHONPATH": os.pathsep.join(paths)}
