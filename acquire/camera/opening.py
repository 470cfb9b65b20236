"""Opening the camera that an address names, and listing the cameras that are there."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from acquire.addresses import Registry, parse_address
from acquire.camera.contract import Camera
from acquire.events import EventSink, ignore_event

log = logging.getLogger(__name__)

CAMERAS: Registry[Camera] = Registry(
    "camera",
    "phasedic.cameras",
    {
        "": "acquire.v4l2.camera:open_v4l2",
        "opencv": "acquire.opencv.webcam:open_opencv",
        "video": "acquire.opencv.video:open_video",
        "files": "acquire.opencv.images:open_files",
        "session": "acquire.session.devices:open_session_camera",
    },
    lists_group="phasedic.camera_lists",
    lists={"": "acquire.v4l2.listing:list_cameras"},
)


@dataclass(frozen=True, slots=True)
class CameraListing:
    """A camera that is there.

    Attributes
    ----------
    address : str
        What to give to ``--camera``.
    name : str
    trouble : str
        Why it cannot be used, and what to do; "" when all is well.
    stable_address : str
        The same camera under a name that plugging does not change; "" where there is none.
    details : tuple of str
        Lines for a person: formats, sizes, rates, controls.
    """

    address: str
    name: str
    trouble: str = ""
    stable_address: str = ""
    details: tuple[str, ...] = ()

    def text(self) -> str:
        """Several lines for a person."""
        stays = f"stays the same when replugged: {self.stable_address}" if self.stable_address else ""
        lines = (line for line in (self.trouble, stays, *self.details) if line)
        return "\n      ".join((f"  {self.address}  {self.name}".rstrip(), *lines))


def list_cameras() -> list[CameraListing]:
    """The cameras of every source that can list its own; those that cannot be used say why."""
    found: list[CameraListing] = []
    for scheme, listed in CAMERAS.listers():
        try:
            found += listed()
        except Exception as error:  # the library of one maker must not hide the cameras of all others
            log.debug("the cameras of %s: cannot be listed", scheme, exc_info=True)
            found.append(CameraListing(f"{scheme}:", "", f"its cameras cannot be listed: {error}"))
    return found


_VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm")


def with_scheme(text: str) -> str:
    """The address with its scheme, where it is but the name of a folder, a glob or a file: ``files:shots``."""
    address = parse_address(text)
    path, suffix = Path(address.target).expanduser(), Path(address.target).suffix.lower()
    if address.scheme and address.scheme in (*CAMERAS.schemes(), "sim"):
        return text
    if suffix in (".h5", ".hdf5"):
        return f"session:{text}"
    if path.is_dir() or "*" in address.target:
        return f"files:{text}"
    if not path.is_file():
        return text
    return f"video:{text}" if suffix in _VIDEOS else f"files:{text}"


def open_camera(address: str, on_event: EventSink = ignore_event) -> Camera:
    """Open the camera at ``address`` (see ``acquire.addresses`` for the schemes).

    Parameters
    ----------
    address : str
        ``/dev/video0?format=Y12&fps=30``, ``opencv:0``, ``video:test.mp4``,
        ``files:shots/*.tif?fps=5``, ``session:run.h5``, or a scheme registered by others. The name of
        a folder, a glob or a file needs none (``with_scheme``).
    on_event : callable taking an Event
        Told of every fault and recovery; may be called from any thread.

    Raises
    ------
    ConfigError
        Unknown scheme, unknown key or impossible value; names the key and what is allowed.
    DeviceError, DataError
        The device or file cannot be used; says why and what to do.
    """
    return CAMERAS.open(with_scheme(address), on_event)
