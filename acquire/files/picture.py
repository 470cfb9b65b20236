"""Picture files as arrays and back; nothing but regular files, and no name that is handed to a decoder.

OpenCV crashes on a name that is not UTF-8, so it sees bytes and no names.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.errors import DataError
from acquire.files.decoder import Source, decode
from acquire.files.regular import MOST_BYTES, check_regular, read_bytes

log = logging.getLogger(__name__)
LOSSY = (".jpg", ".jpeg")


def read_picture(path: Path) -> NDArray[Any]:
    """The picture in a file as it is, (H, W) or (H, W, C) of any type of sample.

    Raises
    ------
    DataError
        Missing, no regular file, no picture, or a damaged one.
    """
    return read_picture_page(path, picture_source(path))


def picture_source(path: Path) -> Source:
    """What to decode the pages of ``path`` from: its bytes; its name where it is too large for OpenCV's memory.

    Raises
    ------
    DataError
        Missing, no regular file, unreadable, or too large and its name is not UTF-8.
    """
    if check_regular(path) <= MOST_BYTES:
        return read_bytes(path)
    if not is_utf8(path):
        raise DataError(
            f"{path}: a file of more than 2 GB is read by its name, which must be UTF-8; rename it"
        )
    return str(path)


def is_utf8(path: Path) -> bool:
    """Whether a name may be given to OpenCV, which dies of others."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return False
    return True


def read_picture_page(path: Path, source: Source, page: int = 0) -> NDArray[Any]:
    """A page of the picture file ``path``, out of its ``picture_source``; raises as ``read_picture``."""
    decoded = decode(source, page) if _complete(path, source) else None
    if decoded is None or decoded.picture is None:
        log.debug("%s: %s", path, decoded.damage if decoded else "ends too early")
        raise DataError(f"{path}: not an image, or cut off; copy it again or take it out of the list")
    if decoded.damage:
        raise DataError(
            f"{path}: a damaged image ({decoded.damage}); copy it again or take it out of the list"
        )
    return decoded.picture


def _complete(path: Path, source: Source) -> bool:
    """A JPEG that was cut off is decoded without complaint: its end is looked at."""
    if isinstance(source, str) or path.suffix.lower() not in LOSSY:
        return True
    return source.rstrip(b"\0").endswith(b"\xff\xd9")


def write_picture(path: Path, picture: NDArray[Any]) -> None:
    """Write a new file in the format that its name ends in.

    Raises
    ------
    DataError
        It exists, cannot be written, or no format has that ending.
    """
    cv2 = load_cv2()
    try:
        well, content = cv2.imencode(path.suffix.lower(), picture)
    except cv2.error:
        well = False
    if not well:
        raise DataError(f"{path}: no format of pictures has such an ending or samples; choose .png or .tif")
    try:
        with path.open("xb") as file:
            file.write(content.tobytes())
    except OSError as error:
        raise DataError(
            f"{path}: cannot be written: {error.strerror}; look at the folder and the disk"
        ) from error
