"""The contract of a camera, and the one function that opens any of them.

A camera is a context manager and an iterable of frames. V4L2 devices, OpenCV cameras,
video and image files, recorded sessions and the simulator differ in nothing else;
``tests/contracts`` holds all of them to this text.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from acquire.addresses import CAMERAS
from acquire.events import EventSink, ignore_event
from acquire.frame import CameraInfo, Frame


@runtime_checkable
class Camera(Protocol):
    """What every camera does.

    - Opening (``open_camera``) claims the device, sets it up, reads back what is in force and
      raises ``ConfigError``, ``DeviceError`` or ``DataError`` where that fails. ``info`` is
      complete from then on.
    - ``with`` starts the stream and closes everything at its end; a camera never entered is
      closed with ``close()``. Both may be called again without effect.
    - Iterating gives ``Frame`` objects with strictly increasing ``index`` and non-decreasing
      ``t``, each with its own read-only memory. It ends when the source is exhausted or after
      ``stop()``. A fault that the device can recover from is an event and a wait, never an
      exception; ``DeviceError`` or ``DataError`` is raised only when nothing more can come.
    - ``stop()`` may be called from any thread, before or during the iteration, which then
      ends within half a second.
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


def open_camera(address: str, on_event: EventSink = ignore_event) -> Camera:
    """Open the camera at ``address`` (see ``acquire.addresses`` for the schemes).

    Parameters
    ----------
    address : str
        ``/dev/video0?format=Y12&fps=30``, ``opencv:0``, ``video:test.mp4``,
        ``files:shots/*.tif?fps=5``, ``session:run.h5``, or a scheme registered by others.
    on_event : callable taking an Event
        Told of every fault and recovery; may be called from any thread.

    Raises
    ------
    ConfigError
        Unknown scheme, unknown key or impossible value; names the key and what is allowed.
    DeviceError, DataError
        The device or file cannot be used; says why and what to do.
    """
    return CAMERAS.open(address, on_event)
