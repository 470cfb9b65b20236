"""The contract of a load cell, the opening of an address, ``none:`` for a test without one, and forces from a zero.

A load cell is a context manager and an iterable of load samples; ``tests/contracts`` holds all of them to this text.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from acquire.addresses import Address, Options, Registry
from acquire.errors import ConfigError
from acquire.events import Event, EventKind, EventSink, ignore_event
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.opening import Closing
from acquire.text import Message, word

LOAD_CELLS: Registry[LoadCell] = Registry(
    Message("load cell"),
    "phasedic.load_cells",
    {
        "": "acquire.serial_line.cell:open_serial",
        "none": "acquire.load_cell.contract:open_none",
        "session": "acquire.session.devices:open_session_load",
    },
    fallback="acquire.serial_line.cell:open_serial",
    settings_group="phasedic.load_cell_settings",
    settings={"": "acquire.serial_line.settings:SerialOptions"},
)


@runtime_checkable
class LoadCell(Protocol):
    """What every load cell does.

    - Opening (``open_load_cell``) claims the port and raises ``ConfigError`` or
      ``DeviceError`` where that fails; ``info`` is complete from then on.
    - ``with`` starts the stream and closes everything at its end; one never entered is closed
      with ``close()``. Both are idempotent.
    - Iterating gives ``LoadSample`` objects with non-decreasing ``t`` until ``stop()``, or until
      a finite source is exhausted. A lost or silent port is an event and a reconnection, never
      an exception: a test goes on without its load.
    - ``stop()`` may be called from any thread; the iteration then ends within half a second.
    - ``tare()`` makes the present load zero, in the device where its protocol can, else here; may be
      called from any thread while iterating. Unless forced it is refused, in a DEVICE event with
      ``tared=False``, where the load is not known to be still. Its event (TARE) has the amount by which
      forces fall from then on (``step_N``).
    - ``undo_tare()`` restores the zero before that; its event has the same.
    """

    @property
    def info(self) -> LoadCellInfo: ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def __iter__(self) -> Iterator[LoadSample]: ...

    def tare(self, *, force: bool = False) -> None: ...

    def undo_tare(self) -> None: ...

    def stop(self) -> None: ...

    def close(self) -> None: ...


def open_load_cell(address: str, on_event: EventSink = ignore_event) -> LoadCell:
    """Open the load cell at ``address``.

    Parameters
    ----------
    address : str
        ``/dev/ttyUSB0?protocol=ascii&baud=115200&unit=N&sign=-1``, any pyserial URL with the
        same keys, ``session:run.h5``, ``none:``, or a scheme registered by others.
    on_event : callable taking an Event
        Gets every fault and recovery; may be called from any thread.

    Raises
    ------
    ConfigError, DeviceError, DataError
        As for ``acquire.camera.open_camera``.
    """
    return LOAD_CELLS.open(address, on_event)


class NoLoadCell(Closing):
    """Gives no samples and ends at once."""

    info = LoadCellInfo(address="none:", name=word("no load cell"), protocol="none", clock="nominal")

    def __iter__(self) -> Iterator[LoadSample]:
        return iter(())

    def tare(self, *, force: bool = False) -> None:
        """Nothing to tare."""

    def undo_tare(self) -> None:
        """Nothing to undo."""

    def stop(self) -> None:
        """Nothing to stop."""

    def close(self) -> None:
        """Nothing to close."""


def open_none(address: Address, on_event: EventSink) -> NoLoadCell:
    """Open ``none:``.

    Raises
    ------
    ConfigError
        The address has more than ``none:``.
    """
    Options(address).done()
    if address.target:
        raise ConfigError("{text}: nothing may follow none:, since it opens no device", address.text)
    return NoLoadCell()


class ZeroedLoadCell(Closing):
    """A load cell whose forces count from another force: the zero that was taken before the test.

    A tare makes the present load zero whatever was subtracted before.

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
            old = self._zero_N
            if event.data.get("undo", self._undoing):
                self._zero_N = self._before.pop() if self._before else old
            else:
                self._before.append(old)
                self._zero_N = 0.0
            step = event.data["step_N"]
            shown = None if step is None else step + self._zero_N - old
            event = dataclasses.replace(event, data={**event.data, "step_N": shown})
        self._on_event(event)
