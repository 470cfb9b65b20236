"""All that comes through OpenCV: cameras of other systems, video files, images.

``gray`` makes grey levels of colours, ``webcam``, ``video`` and ``images`` (with ``tiff_pages`` and
``image_stamps``) are cameras.
"""

from acquire.opencv.gray import to_gray
from acquire.opencv.images import picture_names, picture_times, read_image
from acquire.opencv.webcam import capture

__all__ = ["capture", "picture_names", "picture_times", "read_image", "to_gray"]
