"""The effect of Ctrl-C, SIGTERM and the loss of the terminal on a command."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TYPE_CHECKING

from acquire.system import HANGUP, signal_handler
from acquire.text import Message

if TYPE_CHECKING:
    from live.pipeline.consumer import Screen


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
