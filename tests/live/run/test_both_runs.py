"""Two cameras under one control, without cameras: recording, commands, stop, exit code, time zero."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import ConfigError
from acquire.events import EventKind
from live.run.control import ControlRefused
from live.run.live_run import TIME_IS_OVER
from live.run.outcome import StopSignal
from live.run.two_cameras import BothRuns, OutcomeOfSides, _from_one_zero, linked


class OneRun:
    """Notes its commands; ``refuses`` them."""

    def __init__(self, *, recording: bool = True, refuses: bool = False) -> None:
        self.calls: list[EventKind] = []
        self.recording, self.refuses, self.paused, self.live = recording, refuses, False, True
        self.grabber = SimpleNamespace(running=True)
        self.run_state = object()

    def command(self, kind: EventKind, note: str = "") -> str:
        if self.refuses:
            raise ControlRefused("not now")
        self.calls.append(kind)
        return "done"


def both(front: OneRun, back: OneRun) -> BothRuns:
    runs: Any = {"front": front, "back": back}
    return BothRuns(runs, Path(), StopSignal())


@pytest.mark.parametrize(
    ("codes", "code"),
    [
        ((0, 0), 0), ((3, 3), 3), ((0, 3), 5), ((5, 3), 5), ((0, 130), 130), ((1, 3), 1), ((130, 1), 1),
        ((1, 130), 1),
    ],
)  # fmt: skip
def test_the_exit_code_is_that_of_both_or_the_graver_one(codes: tuple[int, int], code: int) -> None:
    sides: Any = {side: SimpleNamespace(exit_code=one) for side, one in zip("fb", codes, strict=True)}
    assert OutcomeOfSides(Path(), sides).exit_code == code


def test_it_records_while_every_side_that_goes_on_does() -> None:
    front, back = OneRun(), OneRun(recording=False)
    control = both(front, back)
    assert not control.recording
    back.grabber.running = False
    assert control.recording
    front.grabber.running, back.recording, front.recording = False, True, False
    assert not control.recording, "when both have ended it is both again"
    assert control.run_state is front.run_state and list(control.states) == ["front", "back"]


def test_a_command_is_for_both_and_a_tare_for_one() -> None:
    front, back = OneRun(), OneRun()
    control = both(front, back)
    assert control.command(EventKind.NOTE) == "done" and control.command(EventKind.TARE) == "done"
    assert (front.calls, back.calls) == ([EventKind.NOTE, EventKind.TARE], [EventKind.NOTE])
    front.refuses = True
    assert control.command(EventKind.PAUSE) == "done", "one of them carries it out"
    back.refuses = True
    with pytest.raises(ControlRefused, match="not now"):
        control.command(EventKind.PAUSE)


def test_a_side_follows_the_stop_of_both_and_stops_both_but_for_its_own_time() -> None:
    signal = StopSignal()
    one, other = linked(signal), linked(signal)
    one.request(TIME_IS_OVER)
    assert not signal.requested and not other.requested
    other.request("an alarm")
    assert (signal.reason, one.reason) == ("an alarm", TIME_IS_OVER)


@dataclass(frozen=True)
class Prepared:
    """As much of a prepared run as the time zero needs."""

    start: float
    rig: Any

    @classmethod
    def of(cls, start: float, clock: str) -> Prepared:
        return cls(start, SimpleNamespace(camera=SimpleNamespace(info=SimpleNamespace(clock=clock))))


def test_both_count_from_the_zero_of_the_first() -> None:
    sides: Any = {"front": Prepared.of(10.0, "device"), "back": Prepared.of(10.5, "host")}
    assert {name: run.start for name, run in _from_one_zero(sides).items()} == {"front": 10.0, "back": 10.0}
    sides["back"] = replace(sides["back"], rig=Prepared.of(0.0, "nominal").rig)
    with pytest.raises(ConfigError, match="one has nominal times and the other a clock"):
        _from_one_zero(sides)


def test_both_sides_are_paused_and_stopped_as_one() -> None:
    front, back = OneRun(), OneRun()
    control = both(front, back)
    back.paused, back.live = True, False
    assert (control.paused, control.live) == (False, True)
    front.grabber.running = False
    assert (control.paused, control.live) == (True, False)
    control.stop("enough")
    assert control._stop.reason == "enough"
