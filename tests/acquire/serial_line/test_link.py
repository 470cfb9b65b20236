"""The way to the port: lost, found again, and peers that do not stay."""

from __future__ import annotations

import threading
import time

import pytest

from acquire.errors import DeviceError
from acquire.opening import Opening
from acquire.serial_line import link as link_module
from acquire.serial_line.link import Link, LinkContext, close_port
from acquire.serial_line.ports import LineSettings
from tests.acquire.serial_line.fake_port import FakePort, FakeTime
from tests.live.ui.waiting import until

LINE = LineSettings("socket://fake:1")


class FlakyLink:
    """A link to ports that each live for ``lives`` reads of a tenth of a second, the last one for ever."""

    def __init__(self, *lives: int) -> None:
        self.time, self.told, self._lives = FakeTime(), list[str](), list(lives)
        self.opened: list[float] = []
        context = LinkContext(self._open, self.time, threading.Event(), self.time.sleep)
        self.link = Link(LINE, context, lambda level, text: self.told.append(text), lambda: "no sample")

    def _open(self, line: LineSettings) -> FakePort:
        self.opened.append(self.time.now)
        reads: list[bytes | Exception] = [b"1"] * (self._lives.pop(0) if self._lives else 10_000)
        return FakePort(self.time, [*reads, ConnectionError("closed")], pace=0.1)

    def until(self, t: float) -> None:
        while self.time.now < t:
            if self.link.connected or self.link.again():
                self.link.receive(100)


def test_a_peer_that_hangs_up_is_tried_ever_more_seldom_and_told_of_once() -> None:
    flaky = FlakyLink(*[0] * 1000)
    flaky.until(160.0)
    assert len(flaky.opened) < 15
    assert flaky.opened[-1] - flaky.opened[-2] == pytest.approx(8.0, abs=0.3)
    assert [text.partition(" (")[0] for text in flaky.told] == ["lost", "lost again at once"]


def test_one_that_says_a_line_and_hangs_up_is_no_better() -> None:
    flaky = FlakyLink(*[1] * 1000)
    flaky.until(160.0)
    assert len(flaky.opened) < 15 and len(flaky.told) == 3  # lost, connected again, lost again at once


def test_when_it_stays_at_last_that_is_told_once() -> None:
    flaky = FlakyLink(*[0] * 5)
    flaky.until(160.0)
    assert [text.partition(" (")[0] for text in flaky.told] == [
        "lost",
        "lost again at once",
        "connected again",
    ]


def test_a_rare_loss_is_told_each_time_and_mended_soon() -> None:
    flaky = FlakyLink(100, 100, 100)
    flaky.until(140.0)
    assert [text.partition(" (")[0] for text in flaky.told] == ["lost", "connected again"] * 3
    assert len(flaky.opened) == 4


class SlowPort(FakePort):
    """One that closes only when it is let."""

    def __init__(self) -> None:
        super().__init__(FakeTime(), [])
        self.let = threading.Event()

    def close(self) -> None:
        self.let.wait(60)
        super().close()


def test_closing_waits_for_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_module, "CLOSE_S", 0.05)
    port = SlowPort()
    close_port(port)
    assert port.closed == 0
    port.let.set()
    until(lambda: port.closed == 1)


def test_a_port_that_opens_when_nobody_waits_any_more_is_closed() -> None:
    go, port = threading.Event(), FakePort(FakeTime(), [])

    def open_late() -> FakePort:
        go.wait(60)
        return port

    opening = Opening(open_late, close_port)
    assert not opening.done(0.01)
    opening.abandon()
    go.set()
    assert opening.done(60)
    until(lambda: port.closed == 1)


def test_a_port_that_never_opens_fails_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_module, "OPEN_S", 0.05)
    let = threading.Event()

    def never(line: LineSettings) -> FakePort:
        let.wait(60)
        return FakePort(FakeTime(), [])

    context = LinkContext(never, time.monotonic, threading.Event(), time.sleep)
    with pytest.raises(DeviceError, match="does not open within"):
        Link(LINE, context, lambda level, text: None)
    let.set()
