"""Keeps a process that draws alive and supplied: one thread, which alone may wait for it.

One process that draws, and the socket to it; nothing here waits for it but ``end``.

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
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from acquire.events import Level
from acquire.held_back import held_back
from live.pipeline.latency import OUTPUT, lower_priority
from live.ui.rerun.messages import Where
from live.ui.rerun.outbox import Outbox
from live.ui.rerun.wire import Kind, Message, Reader, WireError, encoded

_SEND_BYTES = 1 << 20
_ROOT = str(Path(__file__).parents[3])
_MODULE = "live.ui.rerun.drawing"
_KILLED_S = 5.0


class RenderProcess:
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
        self._pending: deque[memoryview] = deque()
        self.pid, self.progress_t = self._process.pid, time.monotonic()

    def send(self, message: Message) -> None:
        """Put ``message`` behind what waits."""
        if not self._pending:
            self.progress_t = time.monotonic()
        self._pending.extend(encoded(message))

    def pushed(self) -> bool:
        """Hand over what the process takes at once; whether all is gone.

        Raises
        ------
        OSError
            The process is gone.
        """
        while self._pending:
            try:
                sent = self._socket.sendmsg(list(self._pending)[:16])
            except BlockingIOError:
                return False
            self.progress_t = time.monotonic()
            self._let_go(sent)
        return True

    def _let_go(self, sent: int) -> None:
        while sent:
            piece = self._pending.popleft()
            if sent < piece.nbytes:
                self._pending.appendleft(piece[sent:])
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


TICK_S = 0.05
STUCK_S, START_S = 15.0, 90.0
"""A process that takes nothing for so long is replaced (a busy machine starts one slowly)."""

MOST_STARTS, MOST_TOLD = 5, 3
"""Without success, in a row: starts until it is given up, ends of the process that are told."""

_LIVED_S, _LONGEST_S = 60.0, 60.0
"""A process that lived so long begins a new row; the longest wait before a start."""

Tell = Callable[[str, Level], None]


class Stuck(OSError):
    """The process takes nothing any more."""


class Supervisor:
    """Starts the process, talks to it, starts it anew where it ends; gives up where that is of no use.

    Parameters
    ----------
    outbox : Outbox
    where : Where
        As it is wanted.
    tell : callable
        Told what a person should know: words and level.
    serving : callable
        Called once viewers can connect, and again where they must anew.

    Attributes
    ----------
    served : Where
        What there really is: port and file, None until they are.
    failed : str
        Why there is no view any more; empty while all is well.
    pid : int or None
        Of the process.
    starts : int
    """

    def __init__(self, outbox: Outbox, where: Where, tell: Tell, serving: Callable[[], None]) -> None:
        self._outbox, self._where, self._tell, self._serving = outbox, where, tell, serving
        self.served = replace(where, port=None, rrd=None)
        self.failed = ""
        self.pid: int | None = None
        self.starts = self._row = 0
        self._child: RenderProcess | None = None
        self._again_t = self._begun_t = 0.0
        self._is_up = self._is_done = False
        self._why = ""
        self._closing, self._patience_s = threading.Event(), 0.0
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def start(self) -> None:
        """Begin; the process inherits the nice value of the caller, which the thread's would make slow to start."""
        self._guarded(self._started)
        self._thread.start()

    def close(self, seconds: float) -> None:
        """Have all drawn and the file closed within ``seconds``; else the process is killed, and it is told."""
        self._patience_s = seconds
        self._closing.set()
        self._thread.join(seconds + STUCK_S)

    def _run(self) -> None:
        lower_priority(OUTPUT)
        while not self._closing.is_set() and not self.failed:
            self._guarded(self._turn)
        if self._child is not None or not self.starts:
            self._outbox.end()
            self._finish(time.monotonic() + self._patience_s)

    # -- talking ------------------------------------------------------------------------------

    def _turn(self) -> None:
        child = self._child or self._started()
        if child is None or self._is_told(child):
            self._closing.wait(TICK_S)
        else:
            child.wait(TICK_S, to_send=True)

    def _is_told(self, child: RenderProcess) -> bool:
        """Talk with it; whether it has taken all there is."""
        for message in child.replies():
            self._hear(message)
        while child.pushed():
            more = self._outbox.next(time.monotonic())
            if more is None:
                return True
            child.send(more)
        silent = time.monotonic() - child.progress_t
        if silent > (STUCK_S if self._is_up else START_S):
            raise Stuck(f"took nothing for {silent:.0f} s (stopped?)")
        return False

    def _hear(self, message: Message) -> None:
        meta = message.meta
        if message.kind is Kind.SERVING:
            self._is_up = True
            before, self.served = self.served.port, replace(self._where, port=meta["port"], rrd=meta["rrd"])
            if before not in (None, meta["port"]):
                self._tell(f"the view is now on port {meta['port']}", "warning")
            self._serving()
        elif message.kind is Kind.TROUBLE:
            self._tell(meta["text"], "warning")
            self.failed = meta["text"] if meta["lasting"] else self.failed
        elif message.kind is Kind.FULL:
            self._why = f"had grown to {meta['memory_MiB']} MiB"
        elif message.kind is Kind.ENDED:
            self._is_done = True

    # -- its life -----------------------------------------------------------------------------

    def _started(self) -> RenderProcess | None:
        now = time.monotonic()
        if now < self._again_t:
            return None
        self.starts += 1
        self._is_up = False
        self._why, self._begun_t = "", now
        self._child = RenderProcess()
        self.pid = self._child.pid
        self._outbox.begin(self._next_where())
        return self._child

    def _next_where(self) -> Where:
        """The port that viewers know, and a file that is not there yet: view.rrd, view-2.rrd ..."""
        where = self._where
        if self.served.port is not None:
            where = replace(where, port=self.served.port)
        if where.rrd is not None and self.starts > 1:
            path = Path(where.rrd)
            where = replace(where, rrd=str(path.with_stem(f"{path.stem}-{self.starts}")))
        return where

    def _guarded(self, step: Callable[[], object]) -> None:
        try:
            step()
        except (OSError, EOFError, WireError) as error:
            self._lost(error)

    def _lost(self, error: Exception) -> None:
        """The process is gone, or as good as gone."""
        child, self._child, self.pid = self._child, None, None
        code = child.end() if child is not None else 0
        if self.failed:
            return
        lived = time.monotonic() - self._begun_t
        self._row = 1 if self._is_up and lived > _LIVED_S else self._row + 1
        if not self._is_up and self._row >= MOST_STARTS:
            self.failed = f"its process does not start ({_ended(code, error)})"
            return
        self._again_t = time.monotonic() + (0.0 if self._why else min(2.0 ** (self._row - 1), _LONGEST_S))
        if self._why:
            self._tell(f"the view's process {self._why} and is started anew", "info")
        elif self._row <= MOST_TOLD:
            last = "; that is not told again" * (self._row == MOST_TOLD)
            self._tell(f"the view's process {_ended(code, error)} and is started anew{last}", "warning")

    def _finish(self, until: float) -> None:
        try:
            while not self._is_done and time.monotonic() < until:
                child = self._child or self._started()
                if child is None:
                    return
                child.wait(TICK_S, to_send=not self._is_told(child))
        except (OSError, EOFError, WireError) as error:
            self._why = str(error) or "ended early"
        code = self._child.end(max(0.0, until - time.monotonic())) if self._child is not None else 0
        self.pid = None
        if not self._is_done and not self.failed:
            why = self._why or "did not finish in time and was ended"
            self._tell(f"the view's process {why} ({code}); its file may lack the last seconds", "warning")


def _ended(code: int, error: Exception) -> str:
    if isinstance(error, (Stuck, WireError)):
        return str(error)
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended with {code}"
