"""Which GenICam cameras are there, and which of them an address means."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from acquire.errors import ConfigError, DeviceError
from acquire.genicam.library import Aravis
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
