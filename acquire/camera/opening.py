"""Opening the camera that an address names."""

from __future__ import annotations

from pathlib import Path

from acquire.addresses import Registry, parse_address
from acquire.camera.contract import Camera
from acquire.events import EventSink, ignore_event

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
)


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
