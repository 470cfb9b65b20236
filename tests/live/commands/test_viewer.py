"""The viewer that a page opens looks where the view really is."""

from __future__ import annotations

import socket
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from acquire.clock import ClockPair
from live.commands import run
from live.commands.consumers import standard_consumers
from live.outputs import About, Outputs
from live.setup import load_config
from live.tell import Books, TerminalScreen
from live.view import viewer
from tests.live.made_up import CAMERA, START, make_grid


def test_the_port_that_is_told_is_the_one_that_is_served(tmp_path: Path) -> None:
    books = Books.new(0.5)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        wanted = taken.getsockname()[1]
        config = load_config(None, {"view.port": wanted, "view.rrd": False, "view.spawn": False})
        about = About(config, tmp_path, CAMERA, make_grid(), ClockPair(START, datetime.now(UTC)))
        consumers = standard_consumers(TerminalScreen())(about, books)
        outputs = Outputs(consumers, books.loads, books.journal, books.history)
        try:
            end = time.monotonic() + 60
            while books.vitals.view_port is None and time.monotonic() < end:
                time.sleep(0.05)
            port = books.vitals.view_port
            assert port is not None and port != wanted
            socket.create_connection(("127.0.0.1", port), 5).close()
        finally:
            outputs.end()


def test_what_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[list[str]] = []

    def started(command: list[str], **_: Any) -> object:
        opened.append(command)
        return object()

    monkeypatch.setattr(viewer.subprocess, "Popen", started)
    monkeypatch.setattr(viewer, "viewer_binary", lambda: Path("/bin/rerun"))
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert run._open_viewer(9881).startswith("no: no window") and opened == []
    monkeypatch.setenv("DISPLAY", ":7")
    assert run._open_viewer(9881) == "ok"
    assert opened[0][1:3] == ["--connect", "rerun+http://127.0.0.1:9881/proxy"]
