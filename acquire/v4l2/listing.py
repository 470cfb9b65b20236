"""V4L2 cameras from outside: which there are, what they offer, why one fails, where an unplugged one came back.

The list is that of ``phasedic devices``, with the address to use. Looks and never streams. V4L2 on Linux; elsewhere
OpenCV is asked for its first few cameras.
"""

from __future__ import annotations

import contextlib
import errno
import os
import platform
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from acquire.camera import CameraListing
from acquire.text import Message, joined
from acquire.v4l2.api import Kernel
from acquire.v4l2.controls import Control, list_controls, still_automatic
from acquire.v4l2.device import Identity, NotACamera, V4L2Device
from acquire.v4l2.formats import FORMATS, preferred

BY_ID = Path("/dev/v4l/by-id")
OPENCV_NUMBERS = range(4)

_FAULTS = {
    errno.ENODEV: Message("the camera was unplugged or its driver is gone"),
    errno.ENXIO: Message("the camera was unplugged or its driver is gone"),
    errno.EIO: Message("the driver reports a fatal error of the stream"),
    errno.EPROTO: Message("the driver reports a fatal error of the stream (USB protocol)"),
    errno.ENOSPC: Message("not enough USB bandwidth"),
    errno.ETIMEDOUT: Message("the camera has stalled"),
}

_REMARKS = {
    "grey": "",
    "luma": Message("luma of colour, 220 levels; use a grey format if there is one"),
    "bayer": Message("raw mosaic of colours; plane=g takes the green pixels"),
    "jpeg": Message("compressed, only on request: its artefacts do not average out"),
}


def identities(kernel: Kernel, nodes: Iterable[str]) -> dict[str, Identity]:
    """Who each of these nodes is; those that are no cameras or do not open are left out."""
    seen: dict[str, Identity] = {}
    for node in nodes:
        with contextlib.suppress(OSError, NotACamera), contextlib.closing(V4L2Device(node, kernel)) as device:
            seen[node] = device.identity
    return seen


def find_again(
    kernel: Kernel, path: str, identity: Identity, others: Collection[Identity] = ()
) -> str | None:
    """The node that a camera has now; None while it is away.

    Parameters
    ----------
    kernel : Kernel
    path : str
        Where it was.
    identity : Identity
    others : collection of Identity
        Cameras that were there beside it: never taken for it, though they may have its name.

    Returns
    -------
    str or None
        The node of the same identity; else the only one of its name, on another port.
    """
    seen = identities(kernel, dict.fromkeys([path, *kernel.nodes()]))
    exact = [node for node, found in seen.items() if found == identity]
    if exact:
        return exact[0]
    alike = [
        node
        for node, found in seen.items()
        if found not in others and replace(found, bus=identity.bus) == identity
    ]
    return alike[0] if len(alike) == 1 else None


def fault_in_words(error: OSError) -> str:
    """What a failed request means, for a person."""
    words = _FAULTS.get(error.errno or 0, "a request to the camera failed")
    return Message("{words} ({strerror})", words, error)


def why_not_open(path: str, error: OSError, kernel: Kernel) -> str:
    """Why a camera cannot be opened, and what to do."""
    if error.errno == errno.ENOENT:
        return Message("{path}: there is no such device; {cameras_here}", path, cameras_here(kernel))
    if error.errno in (errno.EACCES, errno.EPERM):
        return Message(
            "{path}: no permission; add yourself to the group that owns it (sudo usermod -aG video $USER, then "
            "log in again; docs/cameras.md)",
            path,
        )
    if error.errno == errno.EBUSY:
        return Message(
            "{path}: another program holds the camera{holders}; close it and try again", path, _holders(path)
        )
    if error.errno == errno.ENOSPC:
        return Message(
            "{path}: not enough USB bandwidth; ask for a smaller picture or rate, or use another USB controller",
            path,
        )
    return Message(
        "{path}: {fault_in_words}; unplug it, plug it in again and try once more", path, fault_in_words(error)
    )


def _holders(path: str) -> str:
    """The programs that have the node open, as far as we may see."""
    real = os.path.realpath(path)
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if any(os.path.realpath(fd) == real for fd in (process / "fd").iterdir()):
                found.append(
                    Message("{program}, PID {name}", (process / "comm").read_text().strip(), process.name)
                )
    others = [words for words in found if not words.endswith(f" {os.getpid()}")]
    return f" ({'; '.join(others)})" if others else ""


def cameras_here(kernel: Kernel) -> str:
    """All cameras there are, for messages."""
    found = [
        Message("{node} ({card})", node, identity.card)
        for node, identity in identities(kernel, kernel.nodes()).items()
    ]
    return (
        Message("cameras here: ")
        + (joined(", ", found) if found else Message("none"))
        + Message("; see phasedic devices")
    )


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
