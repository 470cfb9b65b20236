"""A terminal that is not there, does not read, or is written to by a hostile file."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.session import Session
from live.cli import main
from live.commands.process import NonBlockingStream
from live.ui.terminal.screen import TerminalScreen

SIM = "sim:uniform?lockstep=yes&seconds=1&fps=15&width=160&height=128&bits=12"
RUN = ["run", "--camera", SIM, "--zoi", "48", "--step", "24", "--burst", "3", "--reference-burst", "4"]
RUN += ["--no-view", "--no-rrd", "--out"]


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["1>&-", "2>&-", "0<&- 1>&- 2>&-", "1>/dev/full 2>/dev/full"])
def test_a_test_goes_on_without_its_streams(tmp_path: Path, closed: str) -> None:
    command = " ".join(
        f"'{word}'" for word in [sys.executable, "-m", "live.cli", *RUN, str(tmp_path / "out")]
    )
    done = subprocess.run(f"{command} {closed}", shell=True, timeout=300)
    assert done.returncode == 0
    with Session.open(tmp_path / "out" / "session.h5") as session:
        assert len(session) == 16
    assert len((tmp_path / "out" / "strain.csv").read_text().splitlines()) == 1 + 4


@pytest.mark.slow
def test_a_reader_that_does_not_read_holds_nothing_up(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.set_blocking(write, False)
    with pytest.raises(BlockingIOError):
        while True:
            os.write(write, bytes(4096))
    os.set_blocking(write, True)
    command = [sys.executable, "-m", "live.cli", *RUN, str(tmp_path / "out")]
    try:
        done = subprocess.run(command, stdout=write, stderr=write, timeout=300)
    finally:
        os.close(read)
        os.close(write)
    assert done.returncode == 0
    with Session.open(tmp_path / "out" / "session.h5") as session:
        assert len(session) == 16


class Stuck(io.StringIO):
    """Takes nothing until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.go = threading.Event()

    def write(self, text: str) -> int:
        self.go.wait()
        return super().write(text)


def test_what_finds_no_room_is_counted() -> None:
    stream = Stuck()
    patient = NonBlockingStream(stream, queue_size=3)
    for k in range(10):
        patient.write(f"{k}\n")
    assert not patient.drain(0.01)
    stream.go.set()
    assert patient.drain()
    patient.write("end\n")
    assert patient.drain()
    lines = stream.getvalue().splitlines()
    assert lines[-1] == "end"
    left_out = int(lines[-2].split()[0].strip("("))
    assert left_out + len(lines) - 2 == 10


def test_a_stream_that_fails_is_let_go() -> None:
    class Gone(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(5, "Input/output error")

    gone = NonBlockingStream(Gone())
    gone.write("nobody reads this")
    assert gone.drain()


def test_a_narrow_encoding_does_not_silence_the_screen() -> None:
    raw = io.BytesIO()
    screen = TerminalScreen(io.TextIOWrapper(raw, encoding="ascii"))
    screen.print("5 µm/m")
    screen.print("next")
    assert raw.getvalue() == b"5 um/m\nnext\n"


HOSTILE = "\x1b]0;owned\x07\x1b[2J\x9b31m\r"


def test_escapes_in_names_reach_no_terminal(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / f"shots{HOSTILE}"
    folder.mkdir()
    for i in range(2):
        picture = np.full((96, 128), 128, np.uint8)
        (folder / f"{i}.png").write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    assert main(["replay", f"files:{folder}", "--zoi", "32", "--out", str(tmp_path / "a")]) == 4
    assert main(["map", str(folder / "strain.h5"), str(tmp_path / "b.png")]) == 4
    assert main(["recover", str(folder / "0.png")]) == 4
    told = "".join(capfd.readouterr())
    assert "\\x1b]0;owned\\x07" in told
    assert not {"\x1b", "\x07", "\x9b", "\r"} & set(told)
