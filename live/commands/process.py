"""The process of a command: signals, environment variables, and standard streams that never block.

What numba and reproducible builds cannot use of the environment is refused; loops are kept where it says.

A terminal stopped with Ctrl-S, or a pipe that nobody reads, would block its writers: the measurement and, through
the log, the grabbing of frames. Here a thread writes; writes beyond its queue are dropped and counted.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, TextIO

from acquire.errors import ConfigError
from acquire.system import HANGUP, can_write, limit_memory_pools, private_folder, signal_handler
from acquire.text import Message

if TYPE_CHECKING:
    from live.pipeline.consumer import Screen

log = logging.getLogger(__name__)

_LEAST = {"NUMBA_NUM_THREADS": 1, "SOURCE_DATE_EPOCH": 0}
"""Whole numbers in the environment for which numba ends the program where they are none."""
_LAYERS = ("NUMBA_THREADING_LAYER", "NUMBA_THREADING_LAYER_PRIORITY")

QUEUE_SIZE = 2000  # writes
STALL_S = 1.0  # the end waits so long for a blocked stream


@contextlib.contextmanager
def signals(stop: Callable[[], None], screen: Screen | None) -> Iterator[None]:
    """SIGINT and SIGTERM call ``stop``, the third one kills; the loss of the terminal is ignored."""
    times = 0

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal times
        times += 1
        if times > 2:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        again = Message("still closing; a third signal ends it at once")
        if screen is not None:
            screen.print(Message("closing the files ...") if times == 1 else again)
        stop()

    with signal_handler(handle, signal.SIGINT, signal.SIGTERM), signal_handler(signal.SIG_IGN, *HANGUP):
        yield


@contextlib.contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """SIGTERM and the loss of the terminal end a command as Ctrl-C does, where it has no handler of its own.

    A loss of the terminal that is ignored (nohup) stays so.
    """

    def end(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = [number for number in HANGUP if signal.getsignal(number) != signal.SIG_IGN]
    with signal_handler(end, signal.SIGTERM, *heard):
        yield


@contextlib.contextmanager
def interrupts() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C sets; the second one ends the program, where nothing can be lost."""
    stop = threading.Event()

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with signal_handler(handle, signal.SIGINT):
        yield stop


def limit_resources() -> None:
    """Give OpenBLAS one thread and memory few pools, unless the environment says else; called before numpy is loaded.

    The matrices are small: a second thread mostly spins, and keeps the camera and the recording from their cores.
    Preparing a reference of 5 megapixels took 10 s beside busy programs and takes 4; alone 1.0 and 1.1, with a tenth
    less of processor time (2 cores, November 2026).
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    limit_memory_pools()


def check_environment() -> None:
    """Refuse what numba would end the program for, or raise while it measures; raises ConfigError."""
    for name, least in _LEAST.items():
        value = os.environ.get(name, "1")
        if not (value.isascii() and value.isdecimal() and int(value) >= least):
            raise ConfigError(
                "{name}={value} is not possible; give a whole number from {least}, or unset the variable",
                name,
                value,
                least,
            )
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        raise ConfigError(
            "NUMBA_DISABLE_JIT is set: without compiled loops nothing can be measured; unset the variable"
        )
    keep_loops()
    if given := [f"{name}={os.environ[name]}" for name in _LAYERS if name in os.environ]:
        _check_threading_layer(" ".join(given))


def keep_loops() -> None:
    """Keep compiled loops below the temporary folder where numba finds no folder for them: read-only, without a home.

    Child processes get it with the environment.
    """
    given, home = os.environ.get("NUMBA_CACHE_DIR"), Path("~").expanduser()
    own = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") if sys.platform == "linux" else home
    beside = Path(__file__).parents[2] / "analysis/compiled/__pycache__"
    if any(can_write(place) for place in ([Path(given)] if given else []) + [beside, own / "numba"]):
        return
    try:
        folder = private_folder("phasedic-loops")
    except OSError as error:
        raise ConfigError(
            "no folder can be written for compiled loops ({why}); set NUMBA_CACHE_DIR to one that can", error
        ) from error
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    log.warning(Message("only {folder} can be written for compiled loops; set NUMBA_CACHE_DIR", folder))


def _check_threading_layer(given: str) -> None:
    """Start numba's threads: it raises where it cannot load the layer that the environment names."""
    from analysis import threading_library

    try:
        threading_library()
    except (ValueError, ImportError) as error:
        why = str(error).splitlines()[0].rstrip(".")
        raise ConfigError(
            "{given} is not possible ({why}); give omp or workqueue, or unset it", given, why
        ) from error


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
