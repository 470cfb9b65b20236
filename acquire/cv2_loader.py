"""OpenCV, imported when it is first needed, with limits that must be set before that.

The library reads its limits once, while it is loaded: a plain ``import cv2`` anywhere in the process
that comes first leaves it without them.
"""

from __future__ import annotations

import os
from functools import cache
from typing import Any

# No damaged header may ask for gigabytes: 268 million pixels are more than any camera has.
_LIMITS = {
    "OPENCV_IO_MAX_IMAGE_PIXELS": str(2**28),
    "OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT": "1",  # s; by default a stalled camera blocks for ten
}


@cache
def load_cv2() -> Any:
    """The module ``cv2``, quiet: our own errors report what goes wrong."""
    for key, value in _LIMITS.items():
        os.environ.setdefault(key, value)
    import cv2

    log_settings(cv2).setLogLevel(LOG_SILENT)
    return cv2


LOG_SILENT, LOG_WARNING = 0, 3


def log_settings(cv2: Any) -> Any:
    """What has ``getLogLevel`` and ``setLogLevel``: ``cv2.utils.logging`` since OpenCV 5, ``cv2`` itself before."""
    return getattr(cv2.utils, "logging", cv2)
