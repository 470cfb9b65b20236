"""Opening the load cell that an address names."""

from __future__ import annotations

from acquire.addresses import Registry
from acquire.events import EventSink, ignore_event
from acquire.load_cell.contract import LoadCell

LOAD_CELLS: Registry[LoadCell] = Registry(
    "load cell",
    "phasedic.load_cells",
    {
        "": "acquire.serial_line.cell:open_serial",
        "none": "acquire.load_cell.none:open_none",
        "session": "acquire.session.devices:open_session_load",
    },
    fallback="acquire.serial_line.cell:open_serial",
)


def open_load_cell(address: str, on_event: EventSink = ignore_event) -> LoadCell:
    """Open the load cell at ``address``.

    Parameters
    ----------
    address : str
        ``/dev/ttyUSB0?protocol=ascii&baud=115200&unit=N&sign=-1``, any pyserial URL with the
        same keys, ``session:run.h5``, ``none:``, or a scheme registered by others.
    on_event : callable taking an Event
        Told of every fault and recovery; may be called from any thread.

    Raises
    ------
    ConfigError, DeviceError, DataError
        As for ``acquire.camera.open_camera``.
    """
    return LOAD_CELLS.open(address, on_event)
