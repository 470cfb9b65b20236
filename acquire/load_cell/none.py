"""``none:``, the load cell of a test without one."""

from __future__ import annotations

from collections.abc import Iterator

from acquire.addresses import Address, Options
from acquire.closing import Closing
from acquire.errors import ConfigError
from acquire.events import EventSink
from acquire.load_sample import LoadCellInfo, LoadSample


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
        The address says more than ``none:``.
    """
    Options(address).done()
    if address.target:
        raise ConfigError(f"{address.text}: nothing may follow none:, since it opens no device")
    return NoLoadCell()
