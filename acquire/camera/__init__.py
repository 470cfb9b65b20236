"""What a camera is (``contract``), and what opens any of them by its address (``opening``)."""

from acquire.camera.contract import Camera, CameraBase
from acquire.camera.opening import (
    CAMERAS,
    CameraListing,
    CroppedCamera,
    FailureGuard,
    RepeatGuard,
    list_cameras,
    missing_between,
    open_camera,
    with_scheme,
)

__all__ = [
    "CAMERAS",
    "Camera",
    "CameraBase",
    "CameraListing",
    "CroppedCamera",
    "FailureGuard",
    "RepeatGuard",
    "list_cameras",
    "missing_between",
    "open_camera",
    "with_scheme",
]
