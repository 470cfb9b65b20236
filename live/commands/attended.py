"""A live test under the eyes of an operator: signals, keyboard, remote commands, and the page in the browser."""

from __future__ import annotations

import contextlib
import sys
import webbrowser
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from live.commands.signals import signals
from live.config.loading import Config
from live.pipeline.screen import Screen
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
        stack.enter_context(signals(lambda: stop.request(INTERRUPTED), screen.print))
        yield attach


def open_page(controller: PageController, screen: Screen) -> None:
    """Open the page if there is a display, and print its address."""
    if has_display() and webbrowser.open(controller.address):
        screen.print("the page opens in the browser")
    screen.print(f"the page: {controller.address}")
