"""The terminal screen and the status line, and the texts of events, counts and quantities."""

from __future__ import annotations

import dataclasses
import io
import math
from typing import Any

import pytest

from acquire.events import Event, EventKind
from acquire.text import Message
from acquire.text.quantity import Amount
from live.pipeline.event_log import sentence
from live.pipeline.measurement import TimeStep
from live.pipeline.run_state import FrameCounts
from live.pipeline.snapshot import Snapshot
from live.results.figures import value_text
from live.ui.terminal.screen import TerminalScreen, status_line
from tests.live.made_up import figures, in_ascii
from tests.live.screens import Terminal


class ClosedTerminal(Terminal):
    def write(self, text: str) -> int:
        raise OSError(5, "Input/output error")


def test_the_status_line_is_renewed_in_place_and_not_too_often() -> None:
    now = [0.0]
    stream = Terminal()
    screen = TerminalScreen(stream, now=lambda: now[0])
    screen.status("one long line")
    screen.status("too early")
    now[0] = 1.0
    screen.status("two")
    screen.print("stays")
    assert stream.getvalue() == "one long line\rtwo          \r   \rstays\n"


def test_a_log_gets_a_line_every_five_seconds() -> None:
    now, stream = [0.0], io.StringIO()
    screen = TerminalScreen(stream, now=lambda: now[0])
    for now[0] in (100.0, 101.0, 104.9, 105.0, 109.0):
        screen.status(f"at {now[0]:g}")
    assert stream.getvalue() == "at 100\nat 105\n"


def test_the_progress_of_a_replay_is_one_line() -> None:
    stream = io.StringIO()
    now = iter(range(0, 100, 10))
    screen = TerminalScreen(stream, now=lambda: next(now))
    screen.progress(time_step(), 5, 20, 2.5)
    screen.progress(time_step(), 5, None, 0.0)
    screen.progress(time_step(), 21, 20, 2.5)
    screen.progress(time_step(), 1, 100_000, 1.0)
    values = "7.0 N  eyy -2000.0 +- 0.6 um/m  exx 100 +- 10 um/m  exy 0 um/m  8/10 ZOIs"
    assert in_ascii(stream.getvalue()).splitlines() == [
        f"5 of 20 bursts  {values}  20 ZOI/s  0:08 left",
        f"5 bursts  {values}",
        f"21 bursts  {values}  84 ZOI/s",
        f"1 of 100000 bursts  {values}  10 ZOI/s  27:46:39 left",
    ]


def time_step() -> TimeStep:
    numbers = {f.name: 0.0 for f in dataclasses.fields(TimeStep) if f.default is dataclasses.MISSING}
    strains = {"exx": 1e-4, "eyy": -2e-3, "exy": -1e-7, "sigma_exx": 1.24e-5, "sigma_eyy": 6.4e-7}
    values: Any = numbers | strains | {"force": 7.0, "n_valid": 8, "n_zoi": 10}
    return TimeStep(**values)


def snapshot(**more: Any) -> Snapshot:
    frame_counts = FrameCounts()
    frame_counts.add(grabbed=200, measured=120, skipped=8)
    found = figures(force=1234.5, stress=1234.5 / 40e-6, disk=7200.0, fps=29.9, burst=1.0)
    values: Any = {"latency_p95_s": 0.0421, "figures": found} | more
    return Snapshot(0.0, "REC", 75.0, frames=frame_counts.as_dict(), time_step=time_step(), **values)


def test_a_wide_status_line_has_everything() -> None:
    assert in_ascii(status_line(snapshot(peak_N=1500.0), 200)) == (
        "REC  1:15  1234.5 N  30.9 MPa  peak 1500.0 N  eyy -2000.0 +- 0.6 um/m  exx 100 +- 10 um/m  exy 0 um/m"
        "  8/10 ZOIs  frames/s 30  measured 120  SKIPPED 8  lost 0  delay 42 ms  disk 120 min"
    )


@pytest.mark.parametrize("width", [0, 3, 20, 40, 80, 100, 120])
def test_the_status_line_fits_any_width_and_force_and_alarm_go_last(width: int) -> None:
    line = status_line(snapshot(alarms=("axial: axial is 0.021",)), width)
    assert len(line) <= width
    assert width < 40 or line.startswith("ALARM axial: axial is 0.021")
    assert width < 40 or "1234.5 N" in in_ascii(line)
    assert "eyy -2000" in in_ascii(line) or width < 80


def test_the_status_line_is_in_the_language_of_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LC_ALL", "LC_MESSAGES"):
        monkeypatch.delenv(name, raising=False)
    for given, wanted in (
        ("de_DE.UTF-8", "höchste 1 500,0 N  eyy −2 000,0 ± 0,6 µm/m"),
        ("fr_FR.UTF-8", "maximum 1 500,0 N  eyy −2 000,0 ± 0,6 µm/m"),
        ("C", "peak 1 500.0 N  eyy −2 000.0 ± 0.6 µm/m"),
    ):
        monkeypatch.setenv("LANG", given)
        assert wanted in status_line(snapshot(peak_N=1500.0), 200)
    monkeypatch.setenv("LC_ALL", "de_DE.UTF-8")
    stream = io.StringIO()
    TerminalScreen(stream).print(Message("measuring is paused"))
    assert stream.getvalue() == "die Messung ist angehalten\n"


def test_an_ascii_terminal_gets_other_letters() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    TerminalScreen(stream).print(f"{Amount('strain', -2e-3, 0.6e-6)} of Prüfung")
    assert stream.buffer.getvalue() == b"-2000.0 +- 0.6 um/m of Pr\\xfcfung\n"


def test_what_is_typed_is_not_overwritten() -> None:
    now = [0.0]
    stream = Terminal()
    screen = TerminalScreen(stream, now=lambda: now[0])
    screen.status("status")
    screen.prompt(": note sl_")
    now[0] = 9.0
    screen.status("hidden")
    screen.print("stays")
    screen.prompt(None)
    screen.status("again")
    blank = " " * 10
    assert stream.getvalue().split("\r") == [
        "status", ": note sl_", blank, "stays\n: note sl_", blank, "again", "",
    ]  # fmt: skip


def test_an_address_is_named_once_and_without_its_settings() -> None:
    long = "sim:woven?bits=12&fps=60&note=a:b"
    for text in ("the stream stalls: 1.5 s", f"{long}: the stream stalls: 1.5 s"):
        event = Event(1.0, EventKind.DEVICE, long, text)
        assert sentence(event) == "sim:woven: the stream stalls: 1.5 s"
    assert sentence(Event(1.0, EventKind.NOTE, "operator", "is x?a=b right")) == "operator: is x?a=b right"


def test_a_lost_terminal_does_not_matter() -> None:
    screen = TerminalScreen(ClosedTerminal())
    screen.print("nobody reads this")
    screen.print("nor this")


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (70.123456, 0.0234, "70.123 ± 0.023 GPa"),
        (70.1, math.nan, "70.1 GPa"),
        (math.nan, 1.0, "not known"),
        (123456.0, 1200.0, "123\u202f500 ± 1\u202f200 GPa"),
    ],
)
def test_quantities_have_digits_by_their_sigma(value: float, sigma: float, text: str) -> None:
    assert value_text(value, sigma, "GPa") == text
