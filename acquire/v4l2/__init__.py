"""Cameras of Linux, from the ioctl to the frame.

``api`` has the structures and calls, ``device`` the buffers of one node, ``formats`` makes grey levels of
bytes, ``controls`` sets and reads back, ``setup`` negotiates, ``faults`` says what a failure means,
``counter`` tells loss from sequence numbers, ``camera`` joins them, ``listing`` tells what is plugged in.
"""

from acquire.v4l2.camera import V4L2Camera, open_v4l2
from acquire.v4l2.listing import list_cameras

__all__ = ["V4L2Camera", "list_cameras", "open_v4l2"]
