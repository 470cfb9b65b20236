"""OpenCV, imported when it is first needed, with limits that must be set before that.

The library reads its limits once, while it is loaded: a plain ``import cv2`` anywhere in the process
that comes first leaves it without them.
"""

from __future__ import annotations

import os
import unicodedata
from functools import cache
from typing import Any

from acquire.text.quantity import GAP, IN_ASCII

# No damaged header may ask for gigabytes: 268 million pixels are more than any camera has.
_LIMITS = {
    "OPENCV_IO_MAX_IMAGE_PIXELS": str(2**28),
    "OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT": "1",  # s; by default a stalled camera blocks for ten
}

LOG_SILENT, LOG_WARNING = 0, 3


@cache
def load_cv2() -> Any:
    """The module ``cv2``, quiet: our own errors report what goes wrong."""
    for key, value in _LIMITS.items():
        os.environ.setdefault(key, value)
    import cv2

    log_settings(cv2).setLogLevel(LOG_SILENT)
    return cv2


def encoded(ending: str, image: Any, quality: int | None = None) -> bytes:
    """The bytes of a file ".jpg", of this quality (0 to 100), or ".png", of this compression (0 to 9)."""
    cv2 = load_cv2()
    flag = cv2.IMWRITE_JPEG_QUALITY if ending == ".jpg" else cv2.IMWRITE_PNG_COMPRESSION
    _, data = cv2.imencode(ending, image, [] if quality is None else [flag, quality])
    return bytes(data)


def drawn_letters(text: str) -> str:
    """The text in letters that ``putText`` has: most of Unicode since OpenCV 5, before it ASCII (um/m, +-)."""
    text = text.replace(GAP, " ")
    if hasattr(load_cv2(), "FontFace"):
        return text
    return unicodedata.normalize("NFKD", text.translate(IN_ASCII)).encode("ascii", "ignore").decode()


def log_settings(cv2: Any) -> Any:
    """What has ``getLogLevel`` and ``setLogLevel``: ``cv2.utils.logging`` since OpenCV 5, ``cv2`` itself before."""
    return getattr(cv2.utils, "logging", cv2)
