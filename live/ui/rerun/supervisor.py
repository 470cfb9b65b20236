"""Supervises the process that draws: starts it, sends it messages, restarts it where it ends.

All of it runs in one thread of the view; only that thread may wait for the process. The process is a plain
child in the session of the test, so that its nice value counts against the threads of the test. It ignores
Ctrl-C, since a terminal sends that to all processes, and ends when the other end of its socket is closed, also
where the test is killed.
"""

from __future__ import annotations

import contextlib
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from acquire.events import Level
from acquire.system import (
    HANGUP,
    KILLED,
    blocked_signals,
    lower_priority,
    python_command,
    python_environment,
    send_within,
    start_with_socket,
)
from acquire.text.message import Message, from_json, word
from live.pipeline.latency import OUTPUT
from live.ui.rerun.messages import ViewTarget
from live.ui.rerun.outbox import Outbox
from live.ui.rerun.wire import Kind, MessagePipe, Parcel, WireError

TICK_S = 0.05
STUCK_S, START_S = 15.0, 90.0
"""A process that takes nothing for so long is replaced (a busy machine starts one slowly)."""

MAX_STARTS, MAX_REPORTED = 5, 3
"""Failures in a row: until the view is given up; that are reported."""

_STABLE_S, _MAX_DELAY_S = 60.0, 60.0
"""A process that ran so long starts the count of failures again; the longest delay of a restart."""

Notify = Callable[[str, Level], None]
"""Takes a message for a person and its level."""

_SEND_BYTES = 1 << 20
_MODULE = "live.ui.rerun.drawing"
_KILLED_S = 5.0


class RenderProcess:
    """A process that draws, and the pipe to it.

    Attributes
    ----------
    pid : int
    """

    def __init__(self) -> None:
        # The allocator of rerun returns freed memory at once: a tenth less memory in a long test. Its file has no
        # footer (``sinks.write``), of which it would warn.
        own = {"MIMALLOC_PURGE_DELAY": "0", "RUST_LOG": "warn,re_log_encoding::rrd::file_sink=error"}
        with blocked_signals(signal.SIGINT, *HANGUP):
            # The process unblocks them once it ignores them.
            self._process, ours = start_with_socket(python_command(_MODULE), own | python_environment())
        with contextlib.suppress(OSError):
            ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
        self._socket, self._pipe = ours, MessagePipe(ours)
        self.pid = self._process.pid
        self.may_take(START_S)

    def may_take(self, seconds: float) -> None:
        """Let it be stuck where it takes nothing of a message for so long."""
        self._limit_s = seconds
        send_within(self._socket, seconds)

    def send(self, message: Parcel) -> None:
        """Send ``message``, waiting while the process draws.

        Raises
        ------
        OSError
            The process has ended, or is ``Stuck``.
        """
        try:
            self._pipe.send(message)
        except (BlockingIOError, TimeoutError):
            raise Stuck(Message("took nothing for {silent:.0f} s (stopped?)", self._limit_s)) from None

    def replies(self, seconds: float = 0.0) -> Iterator[Parcel]:
        """The messages received since the last call; waits at most ``seconds`` for one.

        Raises
        ------
        EOFError, OSError
            The process has ended.
        """
        while self._pipe.ready(seconds):
            yield self._pipe.next()
            seconds = 0.0

    def end(self, seconds: float = 0.0) -> int:
        """Close the socket, wait ``seconds`` and kill the process after that; its exit code."""
        self._socket.close()
        self._pipe.close()
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self._process.wait(_KILLED_S)
        return KILLED


class Stuck(OSError):
    """The process receives nothing any more."""


class Supervisor:
    """Starts the process, exchanges messages, restarts it where it ends; gives up after ``MAX_STARTS`` failures.

    Parameters
    ----------
    outbox : Outbox
    target : ViewTarget
        As configured.
    notify : callable
        Called with a message for a person and its level.
    on_serving : callable
        Called once viewers can connect, and again after a restart.

    Attributes
    ----------
    served : ViewTarget
        The port that is served and the file that is written; None until they are.
    failed : str
        Why there is no view any more; empty while it runs.
    pid : int or None
        Process id, while there is one.
    starts : int
    """

    def __init__(
        self, outbox: Outbox, target: ViewTarget, notify: Notify, on_serving: Callable[[], None]
    ) -> None:
        self._outbox, self._target, self._notify, self._on_serving = outbox, target, notify, on_serving
        self.served = replace(target, port=None, rrd=None)
        self.failed = ""
        self.pid: int | None = None
        self.starts = self._failures = 0
        self._renderer: RenderProcess | None = None
        self._restart_t = self._started_t = 0.0
        self._is_up = self._is_done = False
        self._cause = ""
        self._closing, self._close_s = threading.Event(), 0.0
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def start(self) -> None:
        """Start the process, which inherits the nice value of the caller, then the thread, which has its own."""
        with self._guarded():
            self._start_process()
        self._thread.start()

    def close(self, seconds: float) -> None:
        """Draw all and close the file within ``seconds``; else kill the process and warn."""
        self._close_s = seconds
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join(seconds + STUCK_S)

    def _run(self) -> None:
        lower_priority(OUTPUT)
        while not self._closing.is_set() and not self.failed:
            with self._guarded():
                self._step()
        if self._renderer is not None or not self.starts:
            self._outbox.end()
            self._finish(time.monotonic() + self._close_s)

    # -- messages -----------------------------------------------------------------------------

    def _step(self) -> None:
        renderer = self._renderer or self._start_process()
        if renderer is not None:
            self._exchange(renderer)
        self._closing.wait(TICK_S)

    def _exchange(self, renderer: RenderProcess, seconds: float = 0.0) -> None:
        """Receive, for which it waits at most ``seconds``, and send all that is due."""
        for message in renderer.replies(seconds):
            self._handle(message)
        while (more := self._outbox.next(time.monotonic())) is not None:
            renderer.send(more)

    def _handle(self, message: Parcel) -> None:
        meta = message.meta
        if message.kind is Kind.SERVING:
            self._is_up = True
            if self._renderer is not None:
                self._renderer.may_take(STUCK_S)
            before, self.served = self.served.port, replace(self._target, port=meta["port"], rrd=meta["rrd"])
            if before not in (None, meta["port"]):
                self._notify(Message("the view is now on port {port}", meta["port"]), "warning")
            self._on_serving()
        elif message.kind is Kind.TROUBLE:
            text = from_json(meta["text"])
            self._notify(text, "warning")
            self.failed = text if meta["lasting"] else self.failed
        elif message.kind is Kind.FULL:
            self._cause = Message("had grown to {size} MiB", meta["memory_MiB"])
        elif message.kind is Kind.ENDED:
            self._is_done = True

    # -- start and end ------------------------------------------------------------------------

    def _start_process(self) -> RenderProcess | None:
        now = time.monotonic()
        if now < self._restart_t:
            return None
        self.starts += 1
        self._is_up = False
        self._cause, self._started_t = "", now
        self._renderer = RenderProcess()
        self.pid = self._renderer.pid
        # The same port as before, and a new file: view.rrd, view-2.rrd ...
        target = self._target
        if self.served.port is not None:
            target = replace(target, port=self.served.port)
        if target.rrd is not None and self.starts > 1:
            path = Path(target.rrd)
            target = replace(target, rrd=str(path.with_stem(f"{path.stem}-{self.starts}")))
        self._outbox.begin(target)
        return self._renderer

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except (OSError, EOFError, WireError) as error:
            self._handle_loss(error)

    def _handle_loss(self, error: Exception) -> None:
        """The process has ended or hangs: end it, and schedule a restart."""
        renderer, self._renderer, self.pid = self._renderer, None, None
        code = renderer.end() if renderer is not None else 0
        if self.failed:
            return
        lived = time.monotonic() - self._started_t
        self._failures = 1 if self._is_up and lived > _STABLE_S else self._failures + 1
        if not self._is_up and self._failures >= MAX_STARTS:
            self.failed = Message("its process does not start ({why})", _reason(code, error))
            return
        self._restart_t = time.monotonic() + (
            0.0 if self._cause else min(2.0 ** (self._failures - 1), _MAX_DELAY_S)
        )
        if self._cause:
            self._notify(Message("the view's process {why} and is restarted{more}", self._cause, ""), "info")
        elif self._failures <= MAX_REPORTED:
            more = Message("; further restarts are not reported") * (self._failures == MAX_REPORTED)
            why = _reason(code, error)
            self._notify(Message("the view's process {why} and is restarted{more}", why, more), "warning")

    def _finish(self, until: float) -> None:
        try:
            while not self._is_done and time.monotonic() < until:
                renderer = self._renderer or self._start_process()
                if renderer is None:
                    return
                renderer.may_take(max(TICK_S, until - time.monotonic()))
                self._exchange(renderer, TICK_S)
        except (OSError, EOFError, WireError) as error:
            self._cause = str(error) or Message("ended early")
        code = self._renderer.end(max(0.0, until - time.monotonic())) if self._renderer is not None else 0
        self.pid = None
        if not self._is_done and not self.failed:
            why = self._cause or Message("did not finish in time and was ended")
            lacks = Message(
                "the view's process {why} ({code}); its file may lack the last seconds", why, code
            )
            self._notify(lacks, "warning")


def _reason(code: int, error: Exception) -> str:
    if isinstance(error, (Stuck, WireError)):
        return word(error.args[0])
    if code < 0:
        return Message("was ended by {name}", signal.Signals(-code).name)
    return Message("ended with {code}", code)
