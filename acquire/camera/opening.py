"""Opening the camera that an address names."""

from __future__ import annotations

from acquire.addresses import Registry
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


def open_camera(address: str, on_event: EventSink = ignore_event) -> Camera:
    """Open the camera at ``address`` (see ``acquire.addresses`` for the schemes).

    Parameters
    ----------
    address : str
        ``/dev/video0?format=Y12&fps=30``, ``opencv:0``, ``video:test.mp4``,
        ``files:shots/*.tif?fps=5``, ``session:run.h5``, or a scheme registered by others.
    on_event : callable taking an Event
        Told of every fault and recovery; may be called from any thread.

    Raises
    ------
    ConfigError
        Unknown scheme, unknown key or impossible value; names the key and what is allowed.
    DeviceError, DataError
        The device or file cannot be used; says why and what to do.
    """
    return CAMERAS.open(address, on_event)
