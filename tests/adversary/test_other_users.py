"""Another user of the same machine: what he can command, read, and learn from the list of processes."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from live.config.listen_address import SOCKET
from live.run.control import SOCKET_NAME, ControlPort
from live.ui.terminal.screen import TerminalScreen
from tests.adversary.test_terminal import SIM
from tests.live.run.test_control import FakeLive
from tests.live.run.test_tcp_lines import WORD
from tests.live.ui.waiting import until
from tests.live.ui.web.browser import Program

AS_NOBODY = """import os, socket, sys
os.setgroups([]); os.setgid(65534); os.setuid(65534)
"""
CONNECT = """
one = socket.socket(socket.AF_UNIX) if sys.argv[1].startswith("/") else socket.socket()
one.connect(sys.argv[1] if sys.argv[1].startswith("/") else ("127.0.0.1", int(sys.argv[1])))
one.sendall(b"quit\\n")
print(one.recv(100).decode())"""


@pytest.fixture
def open_to_all() -> Iterator[Path]:
    """A folder that every user can enter and read."""
    folder = Path(tempfile.mkdtemp(dir="/tmp"))
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


def as_nobody(script: str, *words: object) -> str:
    """What a script of ``nobody`` prints, with its error."""
    command = [sys.executable, "-c", AS_NOBODY + script, *map(str, words)]
    done = subprocess.run(command, cwd="/", text=True, capture_output=True, timeout=60)
    return done.stdout + done.stderr


BROWSER = """#!/bin/sh
echo $$ "$1" > opened.txt.new; cat "${1#file://}" > way.html; stat -c %a "${1#file://}" > mode.txt
mv opened.txt.new opened.txt; exec sleep 300 >/dev/null 2>&1
"""


@pytest.mark.slow
def test_the_token_of_the_page_is_on_no_command_line_and_a_browser_in_the_foreground_delays_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = tmp_path / "browser"
    browser.write_text(BROWSER)
    browser.chmod(0o755)
    monkeypatch.setenv("BROWSER", str(browser))
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    words = f"run --page --camera {SIM} --zoi 48 --step 24 --burst 3 --reference-burst 4 --no-view --no-rrd --out out"
    program = Program(tmp_path, *words.split())
    try:
        until((tmp_path / "opened.txt").exists)
        number, opened = (tmp_path / "opened.txt").read_text().split()
        token = program.address.partition("token=")[2]
        assert len(token) > 16 and program.address in (tmp_path / "way.html").read_text()
        assert (tmp_path / "mode.txt").read_text() == "600\n"
        assert opened.startswith("file://") and token not in opened
        assert program.end() == 0 and Path(f"/proc/{number}").exists(), "the test ends before the browser"
        assert not Path(opened.removeprefix("file://")).exists()
    finally:
        program.kill()
        os.kill(int(number), signal.SIGKILL)


as_root = pytest.mark.skipif(
    not hasattr(os, "getuid") or os.getuid() != 0, reason="needs root, to be another"
)


@as_root
def test_another_user_cannot_command(open_to_all: Path) -> None:
    live = FakeLive()
    port = ControlPort(SOCKET, None, TerminalScreen(quiet=True))
    port.open(live, open_to_all)
    try:
        assert "PermissionError" in as_nobody(CONNECT, open_to_all / SOCKET_NAME)
    finally:
        port.close()
    token = open_to_all / "token"
    token.touch(0o600)
    token.write_text(WORD)
    port = ControlPort("0", str(token), TerminalScreen(quiet=True))
    number = port.open(live, open_to_all)
    try:
        assert as_nobody(CONNECT, number).startswith("no: give the token first")
    finally:
        port.close()
    assert live.calls == []
