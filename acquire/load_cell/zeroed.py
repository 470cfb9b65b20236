"""A load cell whose forces count from another force: the zero that was taken before the test."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Self

from acquire.events import Event, EventKind, EventSink
from acquire.load_cell.contract import LoadCell
from acquire.load_sample import LoadCellInfo, LoadSample


class ZeroedLoadCell:
    """See ``acquire.load_cell.LoadCell``. A tare makes the present load zero whatever was subtracted before.

    Parameters
    ----------
    opener : callable
        Takes an event sink and opens the load cell.
    zero_N : float, N
        Subtracted from every force.
    on_event : callable taking an Event
    """

    def __init__(self, opener: Callable[[EventSink], LoadCell], zero_N: float, on_event: EventSink) -> None:
        self._zero_N, self._before, self._on_event = zero_N, list[float](), on_event
        self._undoing = False
        self._cell = opener(self._event)
        settings = {**self._cell.info.settings, "zero_N": zero_N}
        self.info: LoadCellInfo = dataclasses.replace(self._cell.info, settings=settings)

    def __enter__(self) -> Self:
        self._cell.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cell.__exit__(kind, error, trace)

    def __iter__(self) -> Iterator[LoadSample]:
        for sample in self._cell:
            yield dataclasses.replace(sample, force=sample.force - self._zero_N)

    def tare(self, *, force: bool = False) -> None:
        """Make the present load zero."""
        self._undoing = False
        self._cell.tare(force=force)

    def undo_tare(self) -> None:
        """Restore the zero before the last tare."""
        self._undoing = True
        self._cell.undo_tare()

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._cell.stop()

    def close(self) -> None:
        """Release the device."""
        self._cell.close()

    def _event(self, event: Event) -> None:
        """Pass an event on; that of a tare with the step of the forces as they are given here."""
        if event.kind is EventKind.TARE and "step_N" in event.data:
            event = self._tared(event)
        self._on_event(event)

    def _tared(self, event: Event) -> Event:
        old = self._zero_N
        if event.data.get("undo", self._undoing):
            self._zero_N = self._before.pop() if self._before else old
        else:
            self._before.append(old)
            self._zero_N = 0.0
        step = event.data["step_N"]
        shown = None if step is None else step + self._zero_N - old
        return dataclasses.replace(event, data={**event.data, "step_N": shown})
