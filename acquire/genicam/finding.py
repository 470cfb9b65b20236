"""Which GenICam cameras are there, and which of them an address means.

Which GenICam cameras there are and what they offer: for ``phasedic devices``. Looks and never streams.
"""

from __future__ import annotations

import contextlib
import ipaddress
from collections.abc import Iterator
from dataclasses import dataclass

from acquire.camera import CameraListing
from acquire.errors import ConfigError, DeviceError
from acquire.genicam.device import GenicamDevice
from acquire.genicam.formats import preferred, readable
from acquire.genicam.library import Aravis, GenicamError, has_aravis, load_aravis
from acquire.text import Message


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


_ABOUT = ("id", "vendor", "model", "serial_nbr", "address", "protocol")


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
    here = "; ".join(Message("genicam:{id}  {one}", one.id, one) for one in cameras) or Message("none")
    if found:
        raise ConfigError(
            "{where}: {count} cameras are meant; give one of them. Cameras here: {here}",
            where,
            len(found),
            here,
        )
    raise DeviceError(
        "{where}: no such GigE or USB3 camera answers. Cameras here: {here}. Check cable, power and address "
        "(docs/machine-vision.md)",
        where,
        here,
    )


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
