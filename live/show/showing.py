"""The view of a finished run: opened, told everything, and kept until a person has seen enough."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

from acquire.errors import DataError, PhasedicError
from acquire.events import Level
from live.finished import RunFolder
from live.measure import Screen
from live.show.story import Asked, chosen, setup_of, story
from live.view import View, spawn_viewer
from live.view.exchange.wire import Kind, Message

_LOOK_S, _CLOSE_S = 0.1, 600.0


def show(
    run: RunFolder,
    asked: Asked,
    screen: Screen,
    enough: threading.Event,
    *,
    port: int,
    rrd: Path | None = None,
) -> None:
    """Show ``run`` until ``enough`` is set; with ``rrd`` into that file alone, until all is written.

    Raises
    ------
    ConfigError, DataError
        Nothing can be shown, a file cannot be read, or the view's process fails.
    """
    rows = chosen(run, asked)
    _tell_of_choice(len(rows), run, screen)
    told = _Told(run, rows, screen)
    view = View(
        setup_of(run),
        port=None if rrd else port,
        rrd=rrd,
        tell=lambda text, level: None if enough.is_set() else _say(screen, text, level),
        serving=lambda view: _announce(view, screen),
        story=told.messages,
    )
    try:
        while not view.failed and not told.trouble and not (told.all if rrd else enough).wait(_LOOK_S):
            if enough.is_set():
                break
    finally:
        view.close(_CLOSE_S if rrd and not enough.is_set() else 0.0)
    if told.trouble or view.failed:
        raise DataError(told.trouble or view.failed)


class _Told:
    """The story as it is taken, from the beginning each time a process is started.

    Attributes
    ----------
    all : Event
        Once everything was taken.
    trouble : str
        Why the story ended early.
    """

    def __init__(self, run: RunFolder, rows: tuple[int, ...], screen: Screen) -> None:
        self._run, self._rows, self._screen = run, rows, screen
        self.all, self.trouble = threading.Event(), ""

    def messages(self) -> Iterator[Message]:
        try:
            done = 0
            for message in story(self._run, self._rows):
                yield message
                done += message.kind is Kind.FIELD
                self._screen.status(f"instant {done} of {len(self._rows)}")
        except PhasedicError as error:
            self.trouble = str(error)
        self.all.set()


def _tell_of_choice(shown: int, run: RunFolder, screen: Screen) -> None:
    if shown < run.strain.n:
        screen.say(f"{shown} of {run.strain.n} instants are shown; --from, --to and --every choose others")
    if run.pictures is None:
        screen.say("note: the pictures that were measured are not here any more; maps alone")


def _say(screen: Screen, text: str, level: Level) -> None:
    screen.say(text if level == "info" else f"{level}: {text}")


def _announce(view: View, screen: Screen) -> None:
    """Open the viewer where there is a display; else say how to look."""
    if view.port is None:
        return
    if spawn_viewer(view.port, screen.say) is not None:
        screen.say("the viewer opens in a window of its own; Ctrl-C here ends it")
        return
    screen.say("no viewer is opened here (no display); this shows it, Ctrl-C ends it:")
    for line in view.address.splitlines():
        screen.say(f"  {line}")
