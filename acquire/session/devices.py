"""A recorded session as a camera and as a load cell: ``session:run.h5``.

Frames and samples come with their recorded indices and times, as fast as they are fetched.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from acquire.addresses import Address
from acquire.errors import ConfigError, DataError
from acquire.events import EventSink, device_event
from acquire.frame import CameraInfo, Frame
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.opening import Closing
from acquire.session.reader import Session
from acquire.settings import read_settings
from acquire.text import Message


@dataclasses.dataclass(frozen=True, slots=True)
class SessionSettings:
    """``session:`` has no settings: a recording is not changed."""


class _SessionDevice(Closing):
    """What the two have in common: an open session, a stop, a close."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._stopped = False

    def stop(self) -> None:
        """End the iteration before its next item; from any thread."""
        self._stopped = True

    def close(self) -> None:
        """Close the file; idempotent."""
        self._stopped = True
        self._session.close()


class SessionCamera(_SessionDevice):
    """The frames of a session. See ``acquire.camera.Camera``."""

    def __init__(self, address: str, session: Session) -> None:
        super().__init__(session)
        self.info: CameraInfo = dataclasses.replace(session.camera, address=address, live=False)

    def __iter__(self) -> Iterator[Frame]:
        for number in range(len(self._session)):
            if self._stopped:
                return
            yield self._session.frame(number)


class SessionLoadCell(_SessionDevice):
    """The load samples of a session. See ``acquire.load_cell.LoadCell``."""

    def __init__(self, address: str, session: Session, info: LoadCellInfo, on_event: EventSink) -> None:
        super().__init__(session)
        self._on_event = on_event
        self.info: LoadCellInfo = dataclasses.replace(info, address=address)

    def __iter__(self) -> Iterator[LoadSample]:
        for sample in self._session.each_load_sample():
            if self._stopped:
                return
            yield sample

    def undo_tare(self) -> None:
        """As ``tare``."""
        self.tare()

    def tare(self, *, force: bool = False) -> None:
        """Refused in an event: what is recorded is not changed."""
        text = Message("a recorded load cannot be tared; the tares of the recording are in it")
        device_event(self._on_event, self.info.address, text, tared=False)


def open_session_camera(address: Address, on_event: EventSink) -> SessionCamera:
    """Open ``session:run.h5`` as a camera.

    Raises
    ------
    ConfigError, DataError
    """
    session = _open(address, on_event)
    return SessionCamera(address.text, session)


def open_session_load(address: Address, on_event: EventSink) -> SessionLoadCell:
    """Open ``session:run.h5`` as a load cell.

    Raises
    ------
    ConfigError
    DataError
        Also where the session was recorded without a load cell.
    """
    session = _open(address, on_event)
    if session.load_cell is None:
        session.close()
        raise DataError("{text}: recorded without a load cell; use --load none:", address.text)
    return SessionLoadCell(address.text, session, session.load_cell, on_event)


def _open(address: Address, on_event: EventSink) -> Session:
    read_settings(SessionSettings, address)
    if not address.target:
        raise ConfigError("{text}: name the file, for example session:run.h5", address.text)
    session = Session.open(address.target)
    if session.recovered:
        device_event(on_event, address.text, session.recovered)
    return session
