"""Which GenICam cameras there are and what they offer: for ``phasedic devices``. Looks and never streams."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from acquire.camera import CameraListing
from acquire.genicam.device import GenicamDevice
from acquire.genicam.finding import FoundCamera, find_cameras
from acquire.genicam.formats import preferred, readable
from acquire.genicam.library import Aravis, GenicamError, has_aravis, load_aravis
from acquire.text import Message


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
