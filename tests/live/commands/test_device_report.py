"""``phasedic devices --report``: what devices do, measured, and no name of machine or user in it."""

from __future__ import annotations

import getpass
import os
import platform
import pty
import re
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from acquire.serial_line.ports import PortInfo
from live.cli import main
from live.commands import devices
from live.commands.devices import report_lines, without_names, without_serials

CAMERA = "sim:woven?fps=20&width=160&height=128"


def test_a_camera_and_a_load_cell_are_watched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    watched = ["--camera", CAMERA, "--camera", "/dev/video99", "--load", "sim:", "--seconds", "1.5"]
    assert main(["devices", "--report", *watched]) == 0
    text = Path("phasedic-devices.txt").read_text()
    assert text.strip() in capsys.readouterr().out
    found = re.search(r"(\d+) frames, lost (\d+), damaged 0, rate ([\d.]+) 1/s", text)
    assert found is not None and int(found[1]) > 5 and float(found[3]) == pytest.approx(20, rel=0.2)
    noise = re.search(r"mean [\d.]+ GL, noise ([\d.]+) GL, saturated 0.00 %", text)
    assert noise is not None and float(noise[1]) == pytest.approx(20.5, rel=0.15)
    assert "  /dev/video99: there is no such device" in text
    assert re.search(r"samples in [\d.]+ s, [1-9]\d* with a value", text)
    assert re.search(r"line +'\d+,[-\d.]+,N'", text)
    assert main(["devices", "--report", "--camera", CAMERA]) == 2, "nothing is overwritten"


@pytest.fixture
def port() -> Iterator[str]:
    """A pseudo-terminal on which a sketch talks."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    ended = threading.Event()

    def talk() -> None:
        k = 0
        while not ended.wait(0.02):
            k += 1
            os.write(ours, f"one reading: {12 + k % 7}.5 | average: 12.{k % 9}\r\n".encode())

    thread = threading.Thread(target=talk)
    thread.start()
    yield os.ttyname(theirs)
    ended.set()
    thread.join()
    os.close(ours)
    os.close(theirs)


def test_a_port_is_heard_and_understood(port: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "list_cameras", list)
    monkeypatch.setattr(devices, "list_serial_ports", lambda: [PortInfo(port, "a sketch", "", True)])
    lines = list(report_lines([], [], 1.0))
    assert any("understood as" in line and "protocol=lines" in line for line in lines)
    assert any(re.search(r"[1-9]\d* with a value", line) for line in lines)


def test_without_devices_it_says_what_to_give(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "list_cameras", list)
    monkeypatch.setattr(devices, "list_serial_ports", list)
    said = list(report_lines([], [], 1.0))
    assert said[-2:] == [
        "no camera was found; --camera ADDRESS gives one",
        "no serial port was found; --load ADDRESS gives one",
    ]


def test_names_and_serial_numbers_are_taken_out() -> None:
    line = f"{platform.node()} of {getpass.getuser()}, Basler acA1300-60gm (21234567), {Path.home()}/x, 12345.678 ms"
    shown = without_names(without_serials(line))
    assert platform.node() not in shown and "21234567" not in shown and str(Path.home()) not in shown
    assert "Basler acA1300-60gm (...)" in shown and "12345.678 ms" in shown
    assert "8123406" in without_names("line '8123406'"), "what was heard stays"
