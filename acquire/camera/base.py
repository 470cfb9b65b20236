"""What all our cameras share: entering, stopping and closing. No device is touched here."""

from __future__ import annotations

import threading
from typing import Self

from acquire.closing import Closing
from acquire.frame import CameraInfo


class CameraBase(Closing):
    """Base of cameras; a subclass gives ``info``, ``__iter__`` and, where needed, ``_start`` and ``_release``.

    Attributes
    ----------
    stopped : threading.Event
        Set by ``stop()`` and ``close()``; the iteration looks at it before every frame.
    """

    info: CameraInfo

    def __init__(self) -> None:
        self.stopped = threading.Event()
        self._closed = False

    def __enter__(self) -> Self:
        self._start()
        return self

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self.stopped.set()

    def close(self) -> None:
        """Release the device; may be called again without effect."""
        self.stopped.set()
        if not self._closed:
            self._closed = True
            self._release()

    def _start(self) -> None:
        """Begin to stream."""

    def _release(self) -> None:
        """Give the device back."""
