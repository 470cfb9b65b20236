"""The way to the port: lost, tried again ever more seldom, found again, and closed."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from itertools import pairwise

import pytest

from acquire.errors import DeviceError
from acquire.serial_line import link as link_module
from acquire.serial_line.link import Link, LinkContext, close_port
from acquire.serial_line.ports import LineSettings
from tests.acquire.serial_line.fake_port import FakePort, FakeTime
from tests.live.ui.waiting import until

LINE = LineSettings("/dev/fake", 2400, 7, "E", 2, 0.05)


class Tries:
    """A link whose port opens for as many reads of a tenth of a second as ``lives`` says; -1: it does not open."""

    def __init__(self, *lives: int) -> None:
        self.time, self.told, self._lives = FakeTime(), list[str](), list(lives)
        self.levels: list[str] = []
        self.at: list[float] = []
        self.lines: list[LineSettings] = []
        context = LinkContext(self._open, self.time, threading.Event(), self.time.sleep)
        self.link = Link(LINE, context, self._tell, lambda: "no sample")

    def _tell(self, level: str, text: str) -> None:
        self.levels.append(level)
        self.told.append(text)

    def _open(self, line: LineSettings) -> FakePort:
        self.at.append(self.time.now)
        self.lines.append(line)
        lives = self._lives.pop(0) if self._lives else 10_000
        if lives < 0:
            raise DeviceError("gone")
        return FakePort(self.time, [*[b"1"] * lives, OSError(5, "out")], pace=0.1)

    def until(self, t: float) -> None:
        while self.time.now < t:
            if self.link.connected or self.link.again():
                self.link.receive(100)

    def steps(self, count: int) -> list[float]:
        """Seconds between so many openings."""
        while len(self.at) <= count:
            self.until(self.time.now + 0.01)
        return [later - earlier for earlier, later in pairwise(self.at)]


@pytest.mark.parametrize(
    ("lives", "steps"),
    [
        pytest.param([0] * 8, [0.5, 1, 2, 4, 8, 8, 8], id="after twice as long each time where lost at once"),
        pytest.param([60, 60, 60], [6.5] * 3, id="after half a second where it lasted"),
        pytest.param([0, -1, -1, -1, 9], [0.5] * 4, id="twice a second where it does not open"),
    ],
)
def test_when_it_is_tried_again(lives: list[int], steps: list[float]) -> None:
    assert Tries(*lives).steps(len(steps)) == pytest.approx(steps, abs=0.02)


LOST, BACK, AGAIN = "lost", "connected again", "lost again at once"


@pytest.mark.parametrize(
    ("lives", "told", "opened"),
    [
        pytest.param([0] * 1000, [LOST, AGAIN], range(15), id="a peer that hangs up"),
        pytest.param([1] * 1000, [LOST, BACK, AGAIN], range(15), id="one that says a line and hangs up"),
        pytest.param([0] * 5, [LOST, AGAIN, BACK], [6], id="one that stays at last"),
        pytest.param([100] * 3, [LOST, BACK] * 3, [4], id="rare losses"),
    ],
)
def test_what_is_told_of_losses_in_a_minute(lives: list[int], told: list[str], opened: Sequence[int]) -> None:
    tries = Tries(*lives)
    tries.until(160.0)
    assert [text.partition(" (")[0] for text in tries.told] == told
    assert len(tries.at) in opened


def test_the_words_of_a_loss_and_of_its_end() -> None:
    tries = Tries(60)
    tries.steps(1)
    assert tries.told == ["lost (out); no sample; trying to reach it again", "connected again"]
    assert tries.levels == ["error", "info"]


def test_looking_for_a_lost_port_takes_a_tenth_of_a_second() -> None:
    tries = Tries(0)
    tries.link.receive(1)
    before = tries.time.now
    assert not tries.link.again()
    assert tries.time.now - before == pytest.approx(0.1)


def test_a_port_that_came_back_under_another_name_is_opened_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_module, "identity_of", lambda url: "0403:6001:A1")
    monkeypatch.setattr(
        link_module, "find_again", lambda url, identity: "/dev/fake7" if identity == "0403:6001:A1" else url
    )
    tries = Tries(0)
    tries.steps(1)
    tries.link.receive(1)
    assert tries.lines == [LINE, LineSettings("/dev/fake7", 2400, 7, "E", 2, 0.05)]
    assert (tries.levels[-1], tries.told[-1]) == ("info", "connected again as /dev/fake7")


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
