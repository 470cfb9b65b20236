"""Several cameras under one control, without cameras: recording, commands, stop, exit code, time zero."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import ConfigError
from acquire.events import EventKind
from acquire.load_cell.contract import NoLoadCell
from live.pipeline.run_state import RunState
from live.run.control import ControlRefused
from live.run.live_run import LiveRun, _from_one_zero
from live.run.outcome import OutcomeOfTest, StopSignal
from live.stream.stream import Stream


class OneRun:
    """Notes its commands; ``refuses`` them."""

    def __init__(self, *, recording: bool = True, refuses: bool = False) -> None:
        self.calls: list[EventKind] = []
        self.recording, self.refuses, self.paused, self.live = recording, refuses, False, True
        self.running, self.has_measured, self.run_state = True, False, RunState.new(0.5)

    def command(self, kind: EventKind, note: str = "") -> str:
        if self.refuses:
            raise ControlRefused("not now")
        self.calls.append(kind)
        return "done"


class Cell(NoLoadCell):
    """Notes that it is tared, and answers at once."""

    def __init__(self) -> None:
        self.info = replace(NoLoadCell().info, address="cell:", protocol="ascii")
        self.tares, self.answers = 0, list[OneRun]()

    def tare(self, *, force: bool = False) -> None:
        self.tares += 1
        for run in self.answers:
            run.run_state.event_log.emit(EventKind.TARE, "cell:", "tared")


def all_of(*runs: OneRun, names: tuple[str, ...] = ("front", "back", "third")) -> LiveRun:
    cameras: Any = dict(zip(names, runs, strict=False))
    cell = Cell()
    cell.answers = list(runs)
    return LiveRun(cameras, cell, Path(), Stream(), StopSignal())


@pytest.mark.parametrize(
    ("codes", "code"),
    [
        ((0, 0), 0), ((3, 3), 3), ((0, 3), 5), ((5, 3), 5), ((0, 130), 130), ((1, 3), 1), ((130, 1), 1),
        ((1, 130), 1),
    ],
)  # fmt: skip
def test_the_exit_code_is_that_of_both_or_the_graver_one(codes: tuple[int, int], code: int) -> None:
    sides: Any = {side: SimpleNamespace(exit_code=one) for side, one in zip("fb", codes, strict=True)}
    assert OutcomeOfTest(Path(), sides).exit_code == code


def test_it_records_while_every_side_that_goes_on_does() -> None:
    front, back = OneRun(), OneRun(recording=False)
    control = all_of(front, back)
    assert not control.recording
    back.running = False
    assert control.recording
    front.running, back.recording, front.recording = False, True, False
    assert not control.recording, "when both have ended it is both again"
    assert control.run_state is front.run_state and list(control.states) == ["front", "back"]


def test_a_command_is_for_both_and_a_tare_for_one() -> None:
    front, back = OneRun(), OneRun()
    control = all_of(front, back)
    assert control.command(EventKind.NOTE) == "done" and control.command(EventKind.TARE) == "tared"
    assert (front.calls, back.calls) == ([EventKind.NOTE], [EventKind.NOTE])
    assert control._load.tares == 1  # type: ignore[attr-defined]
    for run in (front, back):
        told = [event.text for event in run.run_state.event_log.events()]
        assert told == ["tare", "tared"], "the recording of each camera has the tare"
    front.refuses = True
    assert control.command(EventKind.PAUSE) == "done", "one of them carries it out"
    back.refuses = True
    with pytest.raises(ControlRefused, match="not now"):
        control.command(EventKind.PAUSE)


@dataclass(frozen=True)
class Prepared:
    """As much of a prepared run as the time zero needs."""

    start: float
    rig: Any

    @classmethod
    def of(cls, start: float, clock: str) -> Prepared:
        return cls(start, SimpleNamespace(camera=SimpleNamespace(info=SimpleNamespace(clock=clock))))


def test_all_count_from_the_zero_of_the_first() -> None:
    sides: Any = {"front": Prepared.of(10.0, "device"), "back": Prepared.of(10.5, "host")}
    assert {name: run.start for name, run in _from_one_zero(sides).items()} == {"front": 10.0, "back": 10.0}
    sides["back"] = replace(sides["back"], rig=Prepared.of(0.0, "nominal").rig)
    with pytest.raises(ConfigError, match="one camera has nominal times and another a clock"):
        _from_one_zero(sides)


def test_both_sides_are_paused_and_stopped_as_one() -> None:
    front, back = OneRun(), OneRun()
    control = all_of(front, back)
    back.paused, back.live = True, False
    assert (control.paused, control.live) == (False, True)
    front.running = False
    assert (control.paused, control.live) == (True, False)
    control.stop("enough")
    assert control._stop.reason == "enough"
