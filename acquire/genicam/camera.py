"""GigE Vision and USB3 Vision cameras: ``genicam:SERIAL?format=Mono12p&fps=30&exposure_us=5000``.

The target is identifier, serial number, model or IP address; none: the only camera. Which cameras there are and what
they offer, for ``phasedic devices``, is found without a stream.
"""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from acquire.addresses import Address
from acquire.camera.contract import CameraListing, not_one
from acquire.camera.live import Driver, LiveCamera, Picture
from acquire.clock import DeviceClock
from acquire.errors import DataError
from acquire.events import EventSink
from acquire.frame import ClockKind
from acquire.genicam.device import CameraIdentity, GenicamDevice, Received
from acquire.genicam.formats import decode, preferred, readable
from acquire.genicam.library import Aravis, GenicamError, has_aravis, load_aravis
from acquire.genicam.settings import GenicamSettings
from acquire.genicam.setup import set_up
from acquire.settings import read_settings
from acquire.text import Message

log = logging.getLogger(__name__)

QUARTZ = 3e-4  # what the rate of a camera's clock may be wrong by
GIGE_NUMBERS, ALL_NUMBERS = 65535, 2**64  # GigE counts from 1 to 65535 and begins again

_ABOUT = ("id", "vendor", "model", "serial_nbr", "address", "protocol")


@dataclass(frozen=True, slots=True)
class FoundCamera:
    """A camera that answered.

    Attributes
    ----------
    id : str
        As Aravis opens it, and as an address has it.
    vendor, model, serial : str
    place : str
        Its IP address, or place on the USB bus.
    protocol : str
    """

    id: str
    vendor: str
    model: str
    serial: str
    place: str
    protocol: str

    def __str__(self) -> str:
        return Message(
            "{vendor} {model} ({serial}, {protocol} {place})",
            self.vendor,
            self.model,
            self.serial,
            self.protocol,
            self.place,
        )


def find_cameras(library: Aravis) -> list[FoundCamera]:
    """All cameras that answer within a second."""
    library.call("arv_update_device_list")
    return [
        FoundCamera(*(library.call(f"arv_get_device_{what}", k) or "" for what in _ABOUT))
        for k in range(library.call("arv_get_n_devices"))
    ]


def name_of(library: Aravis, target: str, where: str) -> str:
    """What to open for a target: an IP as it is, else the identifier of the camera that has this name.

    Parameters
    ----------
    target : str
        Identifier, serial number, model or IP address; "": the only camera.
    where : str
        The address, for messages.

    Raises
    ------
    DeviceError
        No camera is so.
    ConfigError
        Several are.
    """
    if _is_ip(target):
        return target
    cameras = find_cameras(library)
    found = [one for one in cameras if target in ("", one.id, one.serial, one.model)]
    exact = [one for one in found if target and target == one.id]
    if len(found) == 1 or exact:
        return (exact or found)[0].id
    raise not_one(where, len(found), [Message("genicam:{id}  {one}", one.id, one) for one in cameras])


def _is_ip(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


def list_cameras() -> list[CameraListing]:
    """All that answer, those that another program holds included; none where the library is not installed."""
    if not has_aravis():
        return []
    library = load_aravis()
    return [_look_at(library, found) for found in find_cameras(library)]


def _look_at(library: Aravis, found: FoundCamera) -> CameraListing:
    try:
        with contextlib.closing(GenicamDevice(library, found.id)) as device:
            best = preferred(device.choices("PixelFormat"))
            return CameraListing(
                address=f"genicam:{found.id}" + (f"?format={best}" if best else ""),
                name=str(found),
                trouble="" if best else Message("it has no monochrome format"),
                details=tuple(_details(device)),
            )
    except GenicamError as error:
        return CameraListing(f"genicam:{found.id}", str(found), Message("it does not open: {error}", error))


def _details(device: GenicamDevice) -> Iterator[str]:
    yield f"format={', '.join(readable(device.choices('PixelFormat')))}"
    size, most = ([of(name) for name in ("Width", "Height")] for of in (device.integer, device.highest))
    yield Message("{size}x{size2} of {most}x{most2}", size[0], size[1], most[0], most[1])
    for what, key in (("frame_rate", "fps"), ("exposure_time", "exposure_us"), ("gain", "gain")):
        if device.ask(f"arv_camera_is_{what}_available"):
            low, high = device.bounds_of(what)
            yield Message(
                "{key}={ask:g} ({low:g}..{high:g})", key, device.ask(f"arv_camera_get_{what}"), low, high
            )
    if device.has("TriggerSource"):
        yield Message("trigger=no, {listed}", ", ".join(device.choices("TriggerSource")))


class GenicamDriver:
    """An open GigE Vision or USB3 Vision camera; see ``acquire.camera.live.Driver``.

    Parameters
    ----------
    address, name : str
        Its address, and its name or IP address as the library takes it.
    settings : GenicamSettings
    library : Aravis

    Raises
    ------
    GenicamError, DeviceError, ConfigError
        It cannot be opened, or does not honour what was asked.
    """

    def __init__(self, address: str, name: str, settings: GenicamSettings, library: Aravis) -> None:
        self.name, self._address, self._settings = name, address, settings
        self._device = GenicamDevice(library, name)
        try:
            self.setup = set_up(self._device, settings, address)
        except BaseException:
            self._device.close()
            raise
        self.cycle = GIGE_NUMBERS if self._device.is_gige else ALL_NUMBERS
        self.info = self.setup.info
        self._clock, self._unstamped = DeviceClock(QUARTZ), False
        self._trigger: SoftwareTrigger | None = None

    @property
    def alike(self) -> tuple[CameraIdentity, tuple[str, int, int]]:
        """Who it is, and what its pictures are."""
        return self._device.identity, (self.info.pixel_format, self.info.width, self.info.height)

    def start(self) -> None:
        """Stream, and trigger where this program does."""
        if self._device.streaming:
            return
        self._device.start(self._settings.buffers)
        if self._settings.fires_triggers and self.info.fps:
            self._trigger = SoftwareTrigger(self._device, 1 / self.info.fps)

    def fetch(self, timeout_s: float) -> Picture | None:
        """See ``Driver``."""
        received = self._device.fetch(timeout_s, self._take)
        if self._device.lost.is_set():
            raise GenicamError("the camera no longer answers (cable, power, network?)")
        if self._trigger is not None and self._trigger.refused:
            raise GenicamError("triggers are refused: {refused}", self._trigger.refused)
        return None if received is None else self._picture(received, time.monotonic() - received.age_s)

    def _take(self, content: memoryview, padding: int) -> NDArray[Any] | None:
        try:
            return decode(content, self.setup.format, self.info.width, self.info.height, padding)
        except DataError as error:
            log.debug("%s: %s", self._address, error)
            return None

    def _picture(self, received: Received, arrived: float) -> Picture:
        if not received.trouble and received.size != (self.info.width, self.info.height):
            raise GenicamError("its pictures are {size}x{size2} now", received.size[0], received.size[1])
        trouble = received.trouble or (Message("bytes are missing") if received.taken is None else "")
        if trouble:
            return Picture(None, arrived, received.number, trouble)
        clock, t, remark = self._stamp(received, arrived)
        return Picture(received.taken, t, received.number, "", clock, self._settings.stamp, arrived, remark)

    def _stamp(self, received: Received, arrived: float) -> tuple[ClockKind, float, str]:
        """The camera's stamp on our clock, of a camera that has none the arrival; and what is to be said of it."""
        if received.stamp_ns == 0:
            remark = Message("the camera does not stamp its frames: times are those of their arrival")
            told, self._unstamped = self._unstamped, True
            return "host", arrived, "" if told else remark
        stamp = self._clock.stamp(received.stamp_ns * 1e-6, arrived)
        jumped = Message("the camera's clock jumped (a restart?); its stamps are tied anew")
        return "device", stamp.t, jumped if stamp.jumped else ""

    def close(self) -> None:
        """Give it back."""
        if self._trigger is not None:
            self._trigger.stop()
        self._device.close()


class SoftwareTrigger:
    """Triggers one picture each period, until ``stop``; by a thread: a request to a camera that is gone blocks.

    Parameters
    ----------
    device : GenicamDevice
        Streaming.
    period_s : float, s

    Attributes
    ----------
    refused : str
        Why the camera takes no more triggers; "" while all is well.
    """

    def __init__(self, device: GenicamDevice, period_s: float) -> None:
        self._device, self._period_s, self.refused = device, period_s, ""
        self._stopped = threading.Event()
        threading.Thread(target=self._work, name="genicam-trigger", daemon=True).start()

    def _work(self) -> None:
        due = time.monotonic()
        while not self._stopped.wait(max(0.0, due - time.monotonic())):
            try:
                self._device.ask("arv_camera_software_trigger")
            except GenicamError as error:
                if not self._stopped.is_set():
                    self.refused = error.text
                return
            due = max(due + self._period_s, time.monotonic())

    def stop(self) -> None:
        """No more triggers."""
        self._stopped.set()


def open_genicam(address: Address, on_event: EventSink, library: Aravis | None = None) -> LiveCamera:
    """Open ``genicam:...``; ``GenicamSettings`` are its settings.

    Raises
    ------
    ConfigError, DeviceError
        See ``acquire.camera.open_camera``.
    """
    settings, library = read_settings(GenicamSettings, address), library or load_aravis()
    name = name_of(library, address.target, address.text)

    def opened(before: Driver | None) -> GenicamDriver:
        asked = before.setup.kept(settings) if isinstance(before, GenicamDriver) else settings
        return GenicamDriver(address.text, name, asked, library)

    return LiveCamera(address.text, opened, on_event)
