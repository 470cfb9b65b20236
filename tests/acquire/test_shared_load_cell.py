"""One load cell for two tests: every sample and event for both, one tare, open until the last has closed."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from acquire.closing import Closing
from acquire.errors import DeviceError
from acquire.events import Event, EventKind, EventSink, device_event
from acquire.load_cell import SharedLoadCell
from acquire.load_sample import LoadCellInfo, LoadSample

SAMPLES = [LoadSample(float(k), 10.0 * k, "N") for k in range(5)]


class ListCell(Closing):
    """Gives samples, then ``error``; notes what is done to it."""

    info = LoadCellInfo("list:", "a list", "ascii", "device")

    def __init__(self, sink: EventSink, error: Exception | None = None) -> None:
        self._sink, self._error = sink, error
        self.done: list[str] = []

    def __enter__(self) -> ListCell:
        self.done.append("enter")
        return self

    def __iter__(self) -> Iterator[LoadSample]:
        yield from SAMPLES
        if self._error is not None:
            raise self._error

    def tare(self, *, force: bool = False) -> None:
        self.done.append(f"tare {force}")
        self._sink(Event(1.0, EventKind.TARE, "list:", "tared", "info"))

    def undo_tare(self) -> None:
        self.done.append("undo")

    def stop(self) -> None:
        self.done.append("stop")

    def close(self) -> None:
        self.done.append("close")


def shared(error: Exception | None = None) -> tuple[SharedLoadCell, ListCell, list[list[Event]]]:
    events: list[list[Event]] = [[], []]
    cells: list[ListCell] = []

    def opened(sink: EventSink) -> ListCell:
        cells.append(ListCell(sink, error))
        device_event(sink, "list:", "open", "info")
        return cells[0]

    found = SharedLoadCell(opened, [one.append for one in events])
    return found, cells[0], events


def test_each_gets_all_and_the_last_closes() -> None:
    cell, device, events = shared()
    one, other = cell.readers
    with one:
        assert list(one) == SAMPLES
        assert list(one) == []
    assert device.done == ["enter"]
    with other:
        assert list(other) == SAMPLES
        other.tare(force=True)
        other.undo_tare()
    assert device.done == ["enter", "tare True", "undo", "stop", "close"]
    assert [[event.text for event in of_one] for of_one in events] == [["open", "tared"]] * 2
    other.close()
    assert device.done.count("close") == 1


def test_one_that_was_never_entered_is_closed_too() -> None:
    cell, device, _ = shared()
    for reader in cell.readers:
        reader.close()
    assert device.done == ["stop", "close"]


def test_an_error_reaches_both() -> None:
    cell, _, _ = shared(DeviceError("gone"))
    for reader in cell.readers:
        found = []
        with pytest.raises(DeviceError, match="gone"), reader:
            found += [next(iter(reader)) for _ in range(3)]
            list(reader)
        assert found == SAMPLES[:3]
