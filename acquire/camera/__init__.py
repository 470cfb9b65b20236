"""What a camera is, and what opens any of them by its address.

``contract`` says what every camera promises, ``base`` is what ours share, ``guards`` judge repeated and
missing frames, ``cropped`` is a part of the picture, ``opening`` finds the camera that an address names.
"""

from acquire.camera.base import CameraBase
from acquire.camera.contract import Camera
from acquire.camera.cropped import CroppedCamera
from acquire.camera.guards import FailureGuard, RepeatGuard, missing_between
from acquire.camera.opening import CAMERAS, CameraListing, list_cameras, open_camera, with_scheme

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
