"""The contract of a load cell, the opening of an address, and ``none:`` for a test without one.

A load cell is a context manager and an iterable of load samples; ``tests/contracts`` holds all of them to this text.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from acquire.addresses import Address, Options, Registry
from acquire.closing import Closing
from acquire.errors import ConfigError
from acquire.events import EventSink, ignore_event
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.text import Message


@runtime_checkable
class LoadCell(Protocol):
    """What every load cell does.

    - Opening (``open_load_cell``) claims the port and raises ``ConfigError`` or
      ``DeviceError`` where that fails; ``info`` is complete from then on.
    - ``with`` starts the stream and closes everything at its end; one never entered is closed
      with ``close()``. Both may be called again without effect.
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

    info = LoadCellInfo(address="none:", name="no load cell", protocol="none", clock="nominal")

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
