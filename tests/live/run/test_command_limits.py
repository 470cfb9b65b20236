"""Limits in time and letters of commands and tares."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import Event, EventKind
from live.run.control import QUEUED, TareControl, answer
from tests.live.run.test_control import FakeCell, FakeLive, TareSetup


@pytest.mark.parametrize(("letters", "good"), [(500, True), (501, False)])
def test_a_command_has_up_to_500_letters(letters: int, good: bool) -> None:
    live = FakeLive()
    said = answer("note ".ljust(letters, "x"), live)
    assert (said == "ok") is good and len(live.calls) == good
    assert good or said == "no: a command has up to 500 letters"


@pytest.mark.parametrize(("after_s", "done"), [(0.4, False), (0.5, True), (3.0, True), (3.1, False)])
def test_a_tare_is_confirmed_from_half_a_second_to_three_seconds_later(after_s: float, done: bool) -> None:
    bench = TareSetup()
    assert bench.refused().endswith("repeat the command within 3 s to do it")
    bench.now = 10.0 + after_s
    if done:
        assert bench.controls.tare() == QUEUED
    else:
        bench.refused()
    assert bench.cell.calls == ["tare"] * done


@pytest.mark.parametrize(("force", "at_once"), [(1.0, True), (-1.0, True), (1.01, False), (-1.01, False)])
def test_a_thousandth_of_the_capacity_is_no_load(force: float, at_once: bool) -> None:
    bench = TareSetup(force, capacity_N=1000.0)
    if at_once:
        bench.controls.tare()
    else:
        assert f"{force:g}".replace("-", "−") + " N in mid-test" in bench.refused()
    assert bench.cell.calls == ["tare"] * at_once


def test_an_answer_to_a_tare_waits_two_seconds() -> None:
    nothing: Any = None
    assert TareControl(FakeCell(None), nothing, nothing)._wait_s == 2.0


def test_before_the_first_sample_a_tare_risks_nothing() -> None:
    cell = FakeCell(None)
    test: Any = SimpleNamespace(has_measured=True, latest_load=None, emit=lambda *_: None)
    TareControl(cell, test, lambda: 0.0, wait_s=0).tare()
    assert cell.calls == ["tare"]


def test_an_answer_of_another_cell_is_none_of_this_one() -> None:
    bench = TareSetup(measured=False)
    bench.cell.says = [Event(10.0, EventKind.TARE, "/dev/y", "tared: 8 N", "info", {})]
    assert bench.controls.tare() == QUEUED
    bench.cell.says = [Event(10.0, EventKind.DEVICE, "/dev/x", "it did", "info", {"tared": True})]
    assert bench.controls.tare() == QUEUED


def test_a_forced_tare_is_told_as_one() -> None:
    bench = TareSetup()
    bench.controls.tare("force")
    bench.controls.tare("undo")
    assert [(kind, level, text) for kind, level, text in bench.told] == [
        (EventKind.TARE, "info", "tare, forced"), (EventKind.TARE, "info", "undo the last tare"),
    ]  # fmt: skip
    free = TareSetup(0.0)
    free.controls.tare()
    assert free.told == [(EventKind.TARE, "info", "tare")]
