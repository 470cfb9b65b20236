"""The main loop of the process: reads messages and draws them.

It ends with the test, also with one that is killed, and where its memory has grown too large.
"""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

from acquire.system import inherited_socket, kill_this_process, lowest_priority, memory_MiB, wait_until_closed
from acquire.text import Message
from live.ui.rerun import messages
from live.ui.rerun.drawing.scene import ViewScene
from live.ui.rerun.drawing.sinks import FINISHED_MIB, RerunSink, serve, write
from live.ui.rerun.wire import Kind, MessagePipe, Parcel

log = logging.getLogger(__name__)

MAX_MIB = 640
"""Of the whole process; beyond it the process closes its file and ends, and the test restarts it."""

GRACE_S = 5.0
"""To draw what waits and to close the file after the test has ended."""

_POLL_S = 2.0


SHOW: dict[Kind, Callable[[ViewScene, Parcel], object]] = {
    Kind.MEANS: lambda scene, message: scene.means(messages.rows_of(message)),
    Kind.FIELD: lambda scene, message: scene.field(*messages.field_of(message)),
    Kind.PICTURE: lambda scene, message: scene.picture(messages.picture_of(message)),
    Kind.LOADS: lambda scene, message: scene.loads(messages.rows_of(message)),
    Kind.POINTS: lambda scene, message: scene.points(messages.rows_of(message)),
    Kind.GAUGE: lambda scene, message: scene.gauge(message.meta["name"], messages.rows_of(message)),
    Kind.EVENTS: lambda scene, message: scene.events(messages.events_of(message)),
    Kind.STATUS: lambda scene, message: scene.status(message.meta["markdown"]),
    Kind.WHOLE: lambda scene, message: scene.whole(message.arrays),
    Kind.FIGURES: lambda scene, message: scene.figures(messages.figures_of(message)),
}


class ReplyChannel:
    """Sends messages to the test, from several threads."""

    def __init__(self, pipe: MessagePipe) -> None:
        self._pipe, self._lock = pipe, threading.Lock()

    def send(self, kind: Kind, **meta: Any) -> None:
        """Send a message; ignored where the test has ended."""
        meta = {key: one.to_json() if isinstance(one, Message) else one for key, one in meta.items()}
        with self._lock, contextlib.suppress(OSError):
            self._pipe.send(Parcel(kind, meta))

    def notify(self, text: str) -> None:
        """Send a message for a person."""
        self.send(Kind.TROUBLE, text=text, lasting=False)


def main() -> int:
    """Draw until the test ends; the exit code."""
    parent = inherited_socket()
    pipe = MessagePipe(parent)
    channel = ReplyChannel(pipe)
    end_with(parent)
    try:
        setup, target = messages.setup_of(pipe.next())
        sinks = _open(setup, target, channel)
        if not sinks:
            return 3
        # Only now: with a low priority a busy machine takes long to load rerun.
        lowest_priority()
        _draw(pipe, ViewScene(sinks, setup), channel, MAX_MIB + FINISHED_MIB * setup.finished)
    except EOFError:
        return 1
    except Exception as error:
        log.exception("the view's process stopped")
        channel.notify(Message("the view's process stopped by a defect: {error}", repr(error)))
        return 1
    return 0


def _open(setup: messages.ViewSetup, target: messages.ViewTarget, channel: ReplyChannel) -> list[RerunSink]:
    sinks, port, rrd, troubles = [], None, None, []
    try:
        if target.port is not None:
            sink, port = serve(setup, target, channel.notify)
            sinks.append(sink)
    except Exception as error:
        troubles.append(Message("the view's server did not start: {error}", error))
    try:
        if target.rrd is not None:
            sinks.append(write(setup, target))
            rrd = target.rrd
    except FileExistsError:
        troubles.append(
            Message("the view's file did not start: {path} exists already and is not overwritten", target.rrd)
        )
    except Exception as error:
        troubles.append(Message("the view's file did not start: {error}", error))
    if not sinks and not troubles:
        troubles.append(Message("the view has nowhere to draw to"))
    for trouble in troubles:
        text = Message("{what}; all else goes on", trouble)
        channel.send(Kind.TROUBLE, text=text, lasting=not sinks)
    if sinks:
        channel.send(Kind.SERVING, port=port, rrd=rrd)
    return sinks


def _draw(pipe: MessagePipe, scene: ViewScene, channel: ReplyChannel, max_MiB: float) -> None:
    scene.begin()
    checked_t = time.monotonic()
    try:
        while (message := pipe.next()).kind is not Kind.END:
            SHOW[message.kind](scene, message)
            if time.monotonic() - checked_t > _POLL_S:
                checked_t = time.monotonic()
                if (grown := memory_MiB()) > max_MiB:
                    channel.send(Kind.FULL, memory_MiB=round(grown))
                    return
        if trouble := scene.end():
            channel.notify(Message("the view's file lacks its end, is the disk full? ({trouble})", trouble))
        channel.send(Kind.ENDED)
    finally:
        scene.end()


def end_with(parent: socket.socket) -> None:
    """End this process ``GRACE_S`` after the other end of ``parent`` is closed, even where it hangs."""
    threading.Thread(target=_end_with, args=(parent,), name="guard", daemon=True).start()


def _end_with(parent: socket.socket) -> None:
    wait_until_closed(parent)
    threading.Event().wait(GRACE_S)
    kill_this_process()
