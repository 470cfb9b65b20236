"""A load cell that counts from another force: its samples, and the steps of its tares."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from acquire.addresses import parse_address
from acquire.events import Event, EventKind, EventSink
from acquire.load_cell import LoadCell, ZeroedLoadCell, open_load_cell
from acquire.load_cell.contract import NoLoadCell
from acquire.load_sample import LoadSample
from hw_mocks.sim_load_cell import open_sim_load
from hw_mocks.specimen import specimen_from

ADDRESS = "sim:?noise_N=0&lockstep=1&hold=2&seconds=4"


@pytest.fixture
def events() -> list[Event]:
    return []


def opened(zero_N: float, events: list[Event]) -> ZeroedLoadCell:
    def cell(sink: EventSink) -> LoadCell:
        return open_sim_load(parse_address(ADDRESS), sink, specimen_from(parse_address(ADDRESS)))

    return ZeroedLoadCell(cell, zero_N, events.append)


def test_forces_count_from_the_zero(events: list[Event]) -> None:
    with opened(0.0, events) as plain, opened(12.5, events) as zeroed:
        pairs = list(zip(plain, zeroed, strict=True))
    assert len(pairs) > 50 and zeroed.info.settings["zero_N"] == 12.5
    assert all(two.force == pytest.approx(one.force - 12.5) and two.raw == one.raw for one, two in pairs)


def test_a_tare_makes_the_load_zero_and_its_event_has_the_step(events: list[Event]) -> None:
    with opened(12.5, events) as cell:
        samples = iter(cell)
        before = next(samples).force
        cell.tare()
        assert next(samples).force == pytest.approx(0.0, abs=0.2)
        cell.undo_tare()
        assert next(samples).force == pytest.approx(before, abs=0.2) == pytest.approx(-12.5, abs=0.2)
        cell.stop()
    steps = [event.data["step_N"] for event in events if event.kind is EventKind.TARE]
    assert steps == pytest.approx([-12.5, 12.5], abs=0.2), "by how much forces fall"


class Telling(NoLoadCell):
    """A load cell whose tares are told by the test."""

    def __init__(self, sink: EventSink) -> None:
        self.sink = sink

    def told(self, step_N: float | None, **data: bool) -> None:
        self.sink(Event(1.0, EventKind.TARE, "a cell", "", "info", {"step_N": step_N, **data}))

    def __iter__(self) -> Iterator[LoadSample]:
        while True:
            yield LoadSample(1.0, 100.0)


def test_a_tare_that_the_device_undoes_by_itself_brings_the_zero_back(events: list[Event]) -> None:
    made: list[Telling] = []

    def opener(sink: EventSink) -> Telling:
        made.append(Telling(sink))
        return made[0]

    cell = ZeroedLoadCell(opener, 12.5, events.append)
    forces = iter(cell)
    assert next(forces).force == 87.5
    made[0].told(100.0, undo=False)
    assert next(forces).force == 100.0
    made[0].told(-100.0, undo=True)
    assert next(forces).force == 87.5
    made[0].told(None, undo=False)
    made[0].told(-3.0, undo=True)
    made[0].told(-2.0, undo=True)
    assert next(forces).force == 87.5, "there was no other tare"
    assert [event.data["step_N"] for event in events] == [87.5, -87.5, None, 9.5, -2.0]


def test_without_a_load_cell_nothing_comes() -> None:
    with open_load_cell("none:") as cell:
        assert list(cell) == [] and (cell.info.protocol, cell.info.clock) == ("none", "nominal")
        cell.tare()
        cell.undo_tare()
