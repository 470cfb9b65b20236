"""The viewer that a page opens looks where the view really is."""

from __future__ import annotations

import socket
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from acquire.clock import ClockPair
from live.commands import run
from live.commands.consumers import standard_consumers
from live.outputs import About, Outputs
from live.setup import load_config
from live.tell import Books, TerminalScreen
from live.view import viewer
from tests.live.batch.running import until
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


def _program(folder: Path, words: str) -> Path:
    """In the place of the viewer."""
    program = folder / "rerun"
    program.write_text(f"#!/bin/sh\n{words}\n")
    program.chmod(0o755)
    return program


def test_what_is_opened(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    program = _program(tmp_path, f'echo "$@" > {tmp_path}/opened')
    monkeypatch.setattr(viewer, "viewer_binary", lambda: program)
    monkeypatch.setattr(run, "VIEWER_OPENS_S", 0.0)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert run._open_viewer(9881).startswith("no: no window") and not (tmp_path / "opened").exists()
    monkeypatch.setenv("DISPLAY", ":7")
    assert run._open_viewer(9881) == "ok"
    until(lambda: (tmp_path / "opened").exists() and (tmp_path / "opened").read_text())
    assert (tmp_path / "opened").read_text().startswith("--connect rerun+http://127.0.0.1:9881/proxy ")


def test_a_viewer_without_its_libraries_names_their_packages(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    words = "Error: winit: os error at /usr/local/mod.rs:788: Failed to load one of xlib's shared libraries"
    program = _program(tmp_path, f'echo "\033[2mINFO\033[0m" >&2; echo "{words}" >&2; exit 1')
    monkeypatch.setattr(viewer, "viewer_binary", lambda: program)
    monkeypatch.setattr(run, "VIEWER_OPENS_S", 60.0)
    monkeypatch.setenv("DISPLAY", ":7")
    answer = run._open_viewer(9881)
    assert answer == (
        "no: the viewer did not open (winit: Failed to load one of xlib's shared libraries); "
        f"on a Debian without desktop it needs: {viewer.NEEDS}"
    )


@pytest.mark.parametrize("end", ["exit 0", "kill -TERM $$"])
def test_a_viewer_that_is_closed_is_no_trouble(
    end: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program, told = _program(tmp_path, end), []
    monkeypatch.setattr(viewer, "viewer_binary", lambda: program)
    monkeypatch.setenv("DISPLAY", ":7")
    process = viewer.spawn_viewer(9881, told.append)
    assert process is not None
    until(lambda: not any(thread.name == "viewer" for thread in threading.enumerate()))
    assert process.returncode in (0, -15) and told == []


def test_words_without_a_reason_name_the_packages_too() -> None:
    assert "no reason given" in viewer.no_window("") and viewer.NEEDS in viewer.no_window("panicked at x")
