"""A tare of the simulated load cell on nominal time: by how much the forces fall, and as which event."""

from __future__ import annotations

import pytest

from acquire.addresses import parse_address
from acquire.events import Event, EventKind
from acquire.load_cell.load_log import LoadLog
from hw_mocks.sim_load_cell import open_sim_load
from hw_mocks.specimen import specimen_from


def test_forces_fall_by_what_the_event_states_and_rise_when_it_is_undone() -> None:
    events: list[Event] = []
    address = parse_address("sim:?lockstep=yes&seconds=4&hold=2&noise_N=0&rate=50")
    cell = open_sim_load(address, events.append, specimen_from(address))
    stream, specimen = iter(cell), specimen_from(address)
    before = [next(stream) for _ in range(150)][-1]
    true = float(specimen.force(149 / 50))
    assert before.force == pytest.approx(true, abs=0.1) and true > 10
    cell.tare()
    tared = next(stream)
    assert tared.force == pytest.approx(float(specimen.force(150 / 50)) - before.force, abs=0.1)
    assert events[-1].kind is EventKind.TARE
    assert events[-1].data == {"offset_N": before.force, "step_N": before.force}
    cell.undo_tare()
    assert next(stream).force == pytest.approx(float(specimen.force(151 / 50)), abs=0.1)
    assert events[-1].data["step_N"] == pytest.approx(-before.force)
    log = LoadLog()
    for event in events:
        log.take_event(event)
    assert log.zero_at(events[0].t) == pytest.approx(before.force)
    assert log.zero_at(events[-1].t) == pytest.approx(0)
    cell.close()


def steps(events: list[Event]) -> list[float]:
    """By how much each tare made the forces fall, N."""
    return [event.data["step_N"] for event in events if event.kind is EventKind.TARE]


def test_each_tare_is_undone_by_itself() -> None:
    events: list[Event] = []
    address = parse_address("sim:?lockstep=yes&seconds=4&hold=0&noise_N=0&rate=50")
    cell = open_sim_load(address, events.append, specimen_from(address))
    stream = iter(cell)
    for _ in range(2):
        for _ in range(20):
            next(stream)
        cell.tare()
    first, second = steps(events)
    assert first > 0 and second > 0
    for _ in range(3):
        cell.undo_tare()
    assert steps(events)[2:] == pytest.approx([-second, -first])
    cell.close()
