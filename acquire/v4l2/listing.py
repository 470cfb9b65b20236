"""Which cameras there are, what they offer, and the address to use: for ``phasedic devices``.

Looks and never streams. V4L2 on Linux; elsewhere OpenCV is asked for its first few cameras.
"""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator
from pathlib import Path

from acquire.camera import CameraListing
from acquire.text import Message
from acquire.v4l2.api import Kernel
from acquire.v4l2.controls import Control, list_controls, still_automatic
from acquire.v4l2.device import NotACamera, V4L2Device
from acquire.v4l2.faults import why_not_open
from acquire.v4l2.formats import FORMATS, preferred

BY_ID = Path("/dev/v4l/by-id")
OPENCV_NUMBERS = range(4)


def _control_words(control: Control) -> str:
    held = ", held" if control.inactive else ""
    return Message(
        "{name}={value} ({minimum}..{maximum}{held})",
        control.name,
        control.value,
        control.minimum,
        control.maximum,
        held,
    )


def list_cameras(kernel: Kernel | None = None) -> list[CameraListing]:
    """All cameras there are, those without permission included."""
    kernel = kernel or Kernel()
    found = [listing for node in kernel.nodes() if (listing := _look_at(node, kernel)) is not None]
    if found or platform.system() == "Linux":
        return found
    return _opencv_cameras()


def _look_at(node: str, kernel: Kernel) -> CameraListing | None:
    try:
        with contextlib.closing(V4L2Device(node, kernel)) as device:
            best = preferred([offer.fourcc for offer in device.formats()])
            return CameraListing(
                address=node if best is None else f"{node}?format={best}",
                name=str(device.identity),
                stable_address=_stable(node),
                details=tuple(_details(device)),
            )
    except NotACamera:
        return None
    except OSError as error:
        return CameraListing(node, "", trouble=why_not_open(node, error, kernel))


def _details(device: V4L2Device) -> Iterator[str]:
    inputs = device.inputs()
    if len(inputs) > 1:
        yield "inputs: " + ", ".join(Message("input={k} ({name})", k, name) for k, name in enumerate(inputs))
    for offer in device.formats():
        yield Message(
            "format={fourcc} {remark}", f"{offer.fourcc:5}", _remark(offer.fourcc) or offer.description
        )
        yield from (f"    {mode}" for mode in _modes(device, offer.fourcc))
    controls = [control for control in list_controls(device).values() if control.writable]
    if controls:
        yield "controls: " + ", ".join(_control_words(control) for control in controls)
    automatic = still_automatic({control.id: control for control in controls})
    if automatic:
        yield Message("automatic now, put on manual when opened: {listed}", ", ".join(automatic))


def _modes(device: V4L2Device, fourcc: str) -> tuple[str, ...]:
    modes = []
    for size in device.sizes(fourcc):
        rates = device.rates(fourcc, size.width[1], size.height[1])
        modes.append(
            f"{size}"
            + (Message(" at {listed} 1/s", ", ".join(f"{rate:g}" for rate in rates)) if rates else "")
        )
    return tuple(modes)


_REMARKS = {
    "grey": "",
    "luma": Message("luma of colour, 220 levels; use a grey format if there is one"),
    "bayer": Message("raw mosaic of colours; plane=g takes the green pixels"),
    "jpeg": Message("compressed, only on request: its artefacts do not average out"),
}


def _remark(fourcc: str) -> str:
    if fourcc not in FORMATS:
        return Message("not readable here")
    pixel_format = FORMATS[fourcc]
    return _REMARKS[pixel_format.kind] or Message("raw grey levels, {bits} bits", pixel_format.bits)


def _stable(node: str) -> str:
    if not BY_ID.is_dir():
        return ""
    links = [link for link in sorted(BY_ID.iterdir()) if link.resolve() == Path(node).resolve()]
    return str(links[0]) if links else ""


def _opencv_cameras() -> list[CameraListing]:
    from acquire.opencv.webcam import capture

    found = []
    for number in OPENCV_NUMBERS:
        opened = capture(number)
        if opened.isOpened():
            found.append(CameraListing(f"opencv:{number}", Message("camera known to OpenCV")))
        opened.release()
    return found
