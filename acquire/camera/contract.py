"""The contract of a camera, and the base class of our own cameras.

A camera is a context manager and an iterable of frames. V4L2 devices, OpenCV cameras,
video and image files, recorded sessions and the simulator differ in nothing else;
``tests/contracts`` holds all of them to this text. No device is touched here.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from acquire.closing import Closing
from acquire.frame import CameraInfo, Frame


@runtime_checkable
class Camera(Protocol):
    """What every camera does.

    - Opening (``open_camera``) claims the device, sets it up, reads back what is in force and
      raises ``ConfigError``, ``DeviceError`` or ``DataError`` where that fails. ``info`` is
      complete from then on.
    - ``with`` starts the stream and closes everything at its end; a camera never entered is
      closed with ``close()``. Both are idempotent.
    - Iterating gives ``Frame`` objects with strictly increasing ``index`` and non-decreasing
      ``t``, each with its own read-only memory. It ends when the source is exhausted or after
      ``stop()``. A fault that the device can recover from is an event and a wait, never an
      exception; ``DeviceError`` or ``DataError`` is raised only when nothing more can come.
    - ``stop()`` may be called from any thread, before or during the iteration, which then
      ends within half a second, also where the device is dead: who may block waits in a thread of its own.
    """

    @property
    def info(self) -> CameraInfo: ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def __iter__(self) -> Iterator[Frame]: ...

    def stop(self) -> None: ...

    def close(self) -> None: ...


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
        """Release the device; idempotent."""
        self.stopped.set()
        if not self._closed:
            self._closed = True
            self._release()

    def _start(self) -> None:
        """Begin to stream."""

    def _release(self) -> None:
        """Give the device back."""
