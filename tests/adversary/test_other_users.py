"""Another user of the same machine: what he can command, read, and learn from the list of processes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from live.config.listen_address import SOCKET
from live.run.control import SOCKET_NAME, ControlPort
from live.ui.terminal.screen import TerminalScreen
from tests.live.run.test_control import FakeLive
from tests.live.run.test_tcp_lines import WORD

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
