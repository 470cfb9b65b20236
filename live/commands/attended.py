"""A live test under the eyes of an operator: signals, keyboard, remote commands, and the page in the browser."""

from __future__ import annotations

import contextlib
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.text import Message
from live.commands.signals import signals
from live.config.loading import Config
from live.pipeline.consumer import Screen
from live.run.control import ControlPort
from live.run.keyboard import listen
from live.run.live_run import LiveRun
from live.run.outcome import INTERRUPTED, StopSignal
from live.ui.rerun.view import has_display

if TYPE_CHECKING:
    from live.ui.web.page_controller import PageController


@contextlib.contextmanager
def attended(config: Config, screen: Screen, stop: StopSignal) -> Iterator[Callable[[LiveRun], None]]:
    """Signals end a test by ``stop``; what is yielded attaches keyboard and remote commands to one that has begun."""
    ports = config.operate
    with contextlib.ExitStack() as stack:
        port = ControlPort(ports.orders, ports.token_file, screen) if ports.orders else None

        def attach(live: LiveRun) -> None:
            keyboard = listen(live, sys.stdin, screen)
            if keyboard is not None:
                stack.callback(keyboard.close)
            if port is not None:
                port.open(live, live.folder)

        if port is not None:
            stack.callback(port.close)
        stack.enter_context(signals(lambda: stop.request(INTERRUPTED), screen))
        yield attach


@contextlib.contextmanager
def page_opened(controller: PageController, screen: Screen) -> Iterator[None]:
    """Print the address of the page and open it if there is a display, by a file of this user alone that leads there.

    The address has the token, and every user can read the command line of a browser, which may stay in the foreground.
    """
    with tempfile.TemporaryDirectory(prefix="phasedic-", ignore_cleanup_errors=True) as folder:
        if has_display():
            way = Path(folder, "page.html")
            way.touch(0o600)
            way.write_text(
                f'<meta http-equiv="refresh" content="0; url={controller.address}">', encoding="ascii"
            )
            threading.Thread(target=_open, args=(way.as_uri(), screen), name="browser", daemon=True).start()
        screen.print(Message("the page: {address}", controller.address))
        yield


def _open(address: str, screen: Screen) -> None:
    with contextlib.suppress(webbrowser.Error):
        if webbrowser.open(address):
            return
    screen.print(Message("no browser opens here; open the address of the page in yours"))
