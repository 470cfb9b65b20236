"""Files that come from anywhere: only regular ones are opened, pictures are decoded from memory.

``regular`` reads bytes, ``picture`` makes arrays of them and of arrays files, ``decoder`` is OpenCV with its
complaints heard.
"""

from acquire.files.decoder import Source
from acquire.files.picture import (
    LOSSY,
    is_utf8,
    picture_source,
    read_picture,
    read_picture_page,
    write_picture,
)
from acquire.files.regular import check_regular, read_bytes

__all__ = [
    "LOSSY",
    "Source",
    "check_regular",
    "is_utf8",
    "picture_source",
    "read_bytes",
    "read_picture",
    "read_picture_page",
    "write_picture",
]
