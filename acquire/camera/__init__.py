"""What a camera is and what opens any of them (``contract``), and the loop over live devices (``live``)."""

from acquire.camera.contract import (
    CAMERAS,
    Camera,
    CameraBase,
    CameraListing,
    CroppedCamera,
    list_cameras,
    open_camera,
    with_scheme,
)
from acquire.camera.live import DeviceFault, Driver, LiveCamera, Picture
from acquire.camera.timing import (
    FrameCounter,
    StallWatch,
    exposure_and_gain,
    longest_pause_s,
    mid_exposure,
    missing_at_end,
    missing_between,
)

__all__ = [
    "CAMERAS",
    "Camera",
    "CameraBase",
    "CameraListing",
    "CroppedCamera",
    "DeviceFault",
    "Driver",
    "FrameCounter",
    "LiveCamera",
    "Picture",
    "StallWatch",
    "exposure_and_gain",
    "list_cameras",
    "longest_pause_s",
    "mid_exposure",
    "missing_at_end",
    "missing_between",
    "open_camera",
    "with_scheme",
]
