"""One load cell for several tests at the same time: read once, and each test gets every sample and event."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Self

from acquire.closing import Closing
from acquire.events import Event, EventSink
from acquire.load_cell.contract import LoadCell
from acquire.load_sample import LoadCellInfo, LoadSample


class SharedLoadCell:
    """Opens a load cell and reads it in a thread from the first reader that is entered to the last one that stops.

    Parameters
    ----------
    opener : callable
        Takes an event sink and opens the load cell.
    sinks : sequence of callables taking an Event
        One of each reader.

    Attributes
    ----------
    readers : tuple of LoadReader
    """

    def __init__(self, opener: Callable[[EventSink], LoadCell], sinks: Sequence[EventSink]) -> None:
        self._sinks, self._lock = tuple(sinks), threading.Lock()
        self.cell = opener(self._event)
        self.readers = tuple(LoadReader(self) for _ in sinks)
        self._reading, self._open = set(self.readers), set(self.readers)
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to read, where it has not begun."""
        with self._lock:
            if self._thread is None:
                self.cell.__enter__()
                self._thread = threading.Thread(target=self._work, name="shared load", daemon=True)
                self._thread.start()

    def stop(self, reader: LoadReader) -> None:
        """``reader`` needs no more samples."""
        with self._lock:
            last = self._reading == {reader}
            self._reading.discard(reader)
            if last:
                self.cell.stop()

    def close(self, reader: LoadReader) -> None:
        """``reader`` needs the load cell no more; the last one closes it."""
        self.stop(reader)
        with self._lock:
            last = self._open == {reader}
            self._open.discard(reader)
        if last:
            if self._thread is not None:
                self._thread.join()
            self.cell.close()

    def _event(self, event: Event) -> None:
        for sink in self._sinks:
            sink(event)

    def _work(self) -> None:
        end: Exception | None = None
        try:
            for sample in self.cell:
                self._give(sample)
        except Exception as error:  # each reader raises it
            end = error
        self._give(end)

    def _give(self, item: LoadSample | Exception | None) -> None:
        with self._lock:
            reading = tuple(self._reading)
        for reader in reading:
            reader.give(item)


class LoadReader(Closing):
    """The shared load cell as one test has it; fulfils ``LoadCell``. A tare is one for all."""

    def __init__(self, shared: SharedLoadCell) -> None:
        self._shared = shared
        self._items: queue.SimpleQueue[LoadSample | Exception | None] = queue.SimpleQueue()

    @property
    def info(self) -> LoadCellInfo:
        """Of the load cell."""
        return self._shared.cell.info

    def __enter__(self) -> Self:
        self._shared.start()
        return self

    def __iter__(self) -> Iterator[LoadSample]:
        while (item := self._items.get()) is not None:
            if isinstance(item, Exception):
                raise item
            yield item
        self._items.put(None)  # for whoever asks again

    def give(self, item: LoadSample | Exception | None) -> None:
        """Queue a sample, the error that ended the load cell, or None at its end."""
        self._items.put(item)

    def tare(self, *, force: bool = False) -> None:
        """Make the present load zero, for all."""
        self._shared.cell.tare(force=force)

    def undo_tare(self) -> None:
        """Restore the zero before the last tare, for all."""
        self._shared.cell.undo_tare()

    def stop(self) -> None:
        """End the iteration behind the samples that have come; from any thread."""
        self._shared.stop(self)
        self.give(None)

    def close(self) -> None:
        """Stop; again without effect."""
        self.stop()
        self._shared.close(self)
