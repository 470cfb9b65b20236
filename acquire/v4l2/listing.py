"""Which cameras there are, what they offer, and the address to use: for ``phasedic devices``.

Looks and never streams. V4L2 on Linux; elsewhere OpenCV is asked for its first few cameras.
"""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from acquire.v4l2.api import Kernel
from acquire.v4l2.controls import Control, list_controls, still_automatic
from acquire.v4l2.device import NotACamera, V4L2Device
from acquire.v4l2.faults import why_not_open
from acquire.v4l2.formats import FORMATS, preferred

BY_ID = Path("/dev/v4l/by-id")
OPENCV_NUMBERS = range(4)


@dataclass(frozen=True, slots=True)
class FormatListing:
    """A pixel format and its sizes with their frame rates.

    Attributes
    ----------
    fourcc, description : str
    remark : str
        "" for raw grey levels; else what to know.
    modes : tuple of str
        ``"640x480 at 60, 30 1/s"``.
    """

    fourcc: str
    description: str
    remark: str
    modes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CameraListing:
    """A camera.

    Attributes
    ----------
    address : str
        What to give to ``--camera``.
    name : str
    formats : tuple of FormatListing
    controls : tuple of Control
    trouble : str
        Why nothing more is known; "" when all is well.
    stable_address : str
        The same camera under a name that plugging does not change; "" where there is none.
    inputs : tuple of str
    """

    address: str
    name: str
    formats: tuple[FormatListing, ...] = ()
    controls: tuple[Control, ...] = ()
    trouble: str = ""
    stable_address: str = ""
    inputs: tuple[str, ...] = field(default=())

    def text(self) -> str:
        """Several lines for a person."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield f"  {self.address}  {self.name}".rstrip()
        if self.trouble:
            yield f"      {self.trouble}"
        if self.stable_address:
            yield f"      stays the same when replugged: {self.stable_address}"
        if len(self.inputs) > 1:
            yield "      inputs: " + ", ".join(f"input={k} ({name})" for k, name in enumerate(self.inputs))
        for listing in self.formats:
            yield f"      format={listing.fourcc:5} {listing.remark or listing.description}"
            yield from (f"          {mode}" for mode in listing.modes)
        if self.controls:
            yield "      controls: " + ", ".join(_control_words(control) for control in self.controls)
        automatic = still_automatic({control.id: control for control in self.controls})
        if automatic:
            yield f"      automatic now, put on manual when opened: {', '.join(automatic)}"


def _control_words(control: Control) -> str:
    held = ", held" if control.inactive else ""
    return f"{control.name}={control.value} ({control.minimum}..{control.maximum}{held})"


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
            return _listing(node, device)
    except NotACamera:
        return None
    except OSError as error:
        return CameraListing(node, "", trouble=why_not_open(node, error, kernel))


def _listing(node: str, device: V4L2Device) -> CameraListing:
    offers = device.formats()
    best = preferred([offer.fourcc for offer in offers])
    return CameraListing(
        address=node if best is None else f"{node}?format={best}",
        name=str(device.identity),
        formats=tuple(
            FormatListing(
                offer.fourcc, offer.description, _remark(offer.fourcc), _modes(device, offer.fourcc)
            )
            for offer in offers
        ),
        controls=tuple(control for control in list_controls(device).values() if control.writable),
        stable_address=_stable(node),
        inputs=tuple(device.inputs()),
    )


def _modes(device: V4L2Device, fourcc: str) -> tuple[str, ...]:
    modes = []
    for size in device.sizes(fourcc):
        rates = device.rates(fourcc, size.width[1], size.height[1])
        modes.append(f"{size}" + (f" at {', '.join(f'{rate:g}' for rate in rates)} 1/s" if rates else ""))
    return tuple(modes)


_REMARKS = {
    "grey": "",
    "luma": "luma of colour, 220 levels; use a grey format if there is one",
    "bayer": "raw mosaic of colours; plane=g takes the green pixels",
    "jpeg": "compressed, only on request: its artefacts do not average out",
}


def _remark(fourcc: str) -> str:
    if fourcc not in FORMATS:
        return "not readable here"
    pixel_format = FORMATS[fourcc]
    return _REMARKS[pixel_format.kind] or f"raw grey levels, {pixel_format.bits} bits"


def _stable(node: str) -> str:
    if not BY_ID.is_dir():
        return ""
    links = [link for link in sorted(BY_ID.iterdir()) if link.resolve() == Path(node).resolve()]
    return str(links[0]) if links else ""


def _opencv_cameras() -> list[CameraListing]:
    from acquire.opencv import capture

    found = []
    for number in OPENCV_NUMBERS:
        opened = capture(number)
        if opened.isOpened():
            found.append(CameraListing(f"opencv:{number}", "camera known to OpenCV"))
        opened.release()
    return found
