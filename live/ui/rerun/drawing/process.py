"""Reads what the test says, and draws it.

What ends the process that draws when nobody else does: a parent that has gone, a memory that has grown.
"""

from __future__ import annotations

import contextlib
import logging
import os
import resource
import select
import signal
import socket
import sys
import threading
import time
from pathlib import Path
from typing import Any

from live.ui.rerun.drawing.scene import ViewScene
from live.ui.rerun.drawing.sinks import FINISHED_MIB, RerunSink, serve, write
from live.ui.rerun.messages import (
    ViewSetup,
    ViewTarget,
    events_of,
    field_of,
    figures_of,
    picture_of,
    rows_of,
    setup_of,
)
from live.ui.rerun.wire import Kind, Message, Reader, encoded

GRACE_S = 5.0
"""For drawing what waits and closing the file once the parent has gone."""


def end_with(parent: socket.socket) -> None:
    """End this process ``GRACE_S`` after ``parent`` is closed at the other end, wherever it hangs then."""
    threading.Thread(target=_end_with, args=(parent.fileno(),), name="guard", daemon=True).start()


def _end_with(number: int) -> None:
    poll = select.poll()
    poll.register(number, 0)  # a closed end is told unasked
    poll.poll()
    threading.Event().wait(GRACE_S)
    os.kill(os.getpid(), signal.SIGKILL)  # it may hang anywhere


def memory_MiB() -> float:
    """Resident memory of this process (its largest so far where the system does not tell)."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20
    except (OSError, ValueError, IndexError):
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return most / 2**20 if sys.platform == "darwin" else most / 2**10


log = logging.getLogger(__name__)

MAX_MIB = 640
"""Of the whole process; beyond, it closes its file and ends, and the test starts it anew."""

_POLL_S, _NICE = 2.0, 19


class ReplyLine:
    """The way back to the test, for several threads."""

    def __init__(self, there: socket.socket) -> None:
        self._there, self._lock = there, threading.Lock()

    def say(self, kind: Kind, **meta: Any) -> None:
        """Tell the test; nothing where it has gone."""
        with self._lock, contextlib.suppress(OSError):
            for piece in encoded(Message(kind, meta)):
                self._there.sendall(piece)

    def notify(self, text: str) -> None:
        """Something for a person."""
        self.say(Kind.TROUBLE, text=text, lasting=False)


def main() -> int:
    """Draw until the test ends or goes; what the process ends with."""
    there = socket.socket(fileno=os.dup(0))
    there.setblocking(True)
    line, reader = ReplyLine(there), Reader(there)
    end_with(there)
    try:
        setup, target = setup_of(reader.next())
        sinks = _open(setup, target, line)
        if not sinks:
            return 3
        # Only now: a machine without a free core would be long in loading rerun.
        os.nice(_NICE - os.nice(0))
        _draw(reader, ViewScene(sinks, setup), line, MAX_MIB + FINISHED_MIB * setup.finished)
    except EOFError:
        return 1
    except Exception as error:
        log.exception("the view's process stopped")
        line.notify(f"the view's process stopped by a defect: {error!r}")
        return 1
    return 0


def _open(setup: ViewSetup, target: ViewTarget, line: ReplyLine) -> list[RerunSink]:
    sinks, port, rrd, troubles = [], None, None, []
    try:
        if target.port is not None:
            sink, port = serve(setup, target, line.notify)
            sinks.append(sink)
    except Exception as error:
        troubles.append(f"the view's server did not start: {error}")
    try:
        if target.rrd is not None:
            sinks.append(write(setup, target))
            rrd = target.rrd
    except FileExistsError:
        troubles.append(f"the view's file did not start: {target.rrd} exists already and is not overwritten")
    except Exception as error:
        troubles.append(f"the view's file did not start: {error}")
    if not sinks and not troubles:
        troubles.append("the view has nowhere to draw to")
    for text in troubles:
        line.say(Kind.TROUBLE, text=f"{text}; all else goes on", lasting=not sinks)
    if sinks:
        line.say(Kind.SERVING, port=port, rrd=rrd)
    return sinks


def _draw(reader: Reader, scene: ViewScene, line: ReplyLine, max_MiB: float) -> None:
    scene.begin()
    checked_t = time.monotonic()
    try:
        while (message := reader.next()).kind is not Kind.END:
            _show(scene, message)
            if time.monotonic() - checked_t > _POLL_S:
                checked_t = time.monotonic()
                if (grown := memory_MiB()) > max_MiB:
                    line.say(Kind.FULL, memory_MiB=round(grown))
                    return
        scene.end()
        line.say(Kind.ENDED)
    finally:
        scene.end()


def _show(scene: ViewScene, message: Message) -> None:
    kind = message.kind
    if kind is Kind.MEANS:
        scene.means(rows_of(message))
    elif kind is Kind.FIELD:
        scene.field(*field_of(message))
    elif kind is Kind.PICTURE:
        scene.picture(picture_of(message))
    elif kind is Kind.LOADS:
        scene.loads(rows_of(message))
    elif kind is Kind.POINTS:
        scene.points(rows_of(message))
    elif kind is Kind.GAUGE:
        scene.gauge(str(message.meta.get("name")), rows_of(message))
    elif kind is Kind.EVENTS:
        for event in events_of(message):
            scene.event(event)
    elif kind is Kind.STATUS:
        scene.status(str(message.meta.get("markdown", "")))
    elif kind is Kind.FIGURES:
        scene.figures(figures_of(message))
