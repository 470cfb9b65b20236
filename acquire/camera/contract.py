"""The contract of a camera, the base class of our own, the opening of an address, and the list of the cameras.

A camera is a context manager and an iterable of frames. V4L2 devices, OpenCV cameras, video and image files, recorded
sessions and the simulator differ in nothing else; ``tests/contracts`` holds all of them to this text.
``CroppedCamera`` is a part of a camera's picture as a camera of its own: nothing else is measured or stored, and all
coordinates downstream (ROI, mask, results) count from the corner of that part.
"""

from __future__ import annotations

import dataclasses
import logging
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from acquire.addresses import RECORDING, Address, Registry, expanded, parse_address
from acquire.errors import ConfigError, DeviceError, PhasedicError
from acquire.events import EventSink, ignore_event
from acquire.frame import CameraInfo, Frame, frozen
from acquire.opening import Closing
from acquire.record_mode import Crop, RecordMode
from acquire.text import Message, joined

log = logging.getLogger(__name__)

HAS_V4L2 = sys.platform == "linux"
CAMERAS: Registry[Camera] = Registry(
    "camera",
    "phasedic.cameras",
    {
        "": "acquire.v4l2.camera:open_v4l2" if HAS_V4L2 else "acquire.camera.contract:without_v4l2",
        "genicam": "acquire.genicam.camera:open_genicam",
        "pylon": "acquire.pylon:open_pylon",
        "opencv": "acquire.opencv.webcam:open_opencv",
        "video": "acquire.opencv.video:open_video",
        "files": "acquire.opencv.images:open_files",
        "session": "acquire.session.devices:open_session_camera",
    },
    lists_group="phasedic.camera_lists",
    elsewhere=["sim"],
    lists=({"": "acquire.v4l2.listing:list_cameras"} if HAS_V4L2 else {})
    | {"genicam": "acquire.genicam.camera:list_cameras", "pylon": "acquire.pylon:list_cameras"},
    settings_group="phasedic.camera_settings",
    settings={
        "": "acquire.v4l2.controls:V4L2Settings",
        "genicam": "acquire.genicam.settings:GenicamSettings",
        "pylon": "acquire.pylon:PylonSettings",
        "opencv": "acquire.opencv.webcam:OpenCVSettings",
        "video": "acquire.opencv.video:VideoSettings",
        "files": "acquire.opencv.images:FileSettings",
        "session": "acquire.session.devices:SessionSettings",
    },
)

_VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm")


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


def without_v4l2(address: Address, on_event: EventSink) -> Camera:
    """Refuse a camera by its device where there is no V4L2."""
    raise ConfigError(
        "{text}: cameras by their device need Linux (V4L2); choose opencv:0, genicam: or files:", address.text
    )


@dataclass(frozen=True, slots=True)
class CameraListing:
    """A camera that is there.

    Attributes
    ----------
    address : str
        What to give to ``--camera``.
    name : str
    trouble : str
        Why it cannot be used, and what to do; "" when all is well.
    stable_address : str
        The same camera under a name that plugging does not change; "" where there is none.
    details : tuple of str
        Lines for a person: formats, sizes, rates, controls.
    """

    address: str
    name: str
    trouble: str = ""
    stable_address: str = ""
    details: tuple[str, ...] = ()

    def text(self) -> str:
        """Several lines for a person."""
        stays = (
            Message("stays the same when replugged: {stable_address}", self.stable_address)
            if self.stable_address
            else ""
        )
        lines = (line for line in (self.trouble, stays, *self.details) if line)
        head = Message("  {address}  {name}", self.address, self.name) if self.name else f"  {self.address}"
        return joined("\n      ", (head, *lines))


def list_cameras() -> list[CameraListing]:
    """The cameras of every source that can list its own; with the trouble of those that cannot be used."""
    found: list[CameraListing] = []
    for scheme, listed in CAMERAS.listers():
        try:
            found += listed()
        except Exception as error:  # the library of one maker must not hide the cameras of all others
            log.debug("the cameras of %s: cannot be listed", scheme, exc_info=True)
            found.append(
                CameraListing(f"{scheme}:", "", Message("its cameras cannot be listed: {error}", error))
            )
    return found


def not_one(where: str, meant: int, here: Sequence[str]) -> PhasedicError:
    """The error of an address that means several of the cameras ``here``, or none of them."""
    listed = "; ".join(here) or Message("none")
    if meant:
        return ConfigError(
            "{where}: {count} cameras are meant; give one of them. Cameras here: {here}", where, meant, listed
        )
    return DeviceError(
        "{where}: no such camera answers. Cameras here: {here}. Check cable, power and address "
        "(docs/machine-vision.md)",
        *(where, listed),
    )


def with_scheme(text: str) -> str:
    """The address with its scheme, where it is but the name of a folder, a glob or a file: ``files:shots``.

    A folder that holds a ``session.h5`` is the folder of a run: its session is meant.
    """
    address = parse_address(text)
    path, suffix = expanded(address.target), Path(address.target).suffix.lower()
    if address.scheme and address.scheme in (*CAMERAS.schemes(), "sim"):
        return text
    if suffix in (".h5", ".hdf5"):
        return f"session:{text}"
    if (path / RECORDING).is_file():
        return f"session:{Path(address.target) / RECORDING}{text[len(address.target) :]}"
    if path.is_dir() or "*" in address.target:
        return f"files:{text}"
    if not path.is_file():
        return text
    return f"video:{text}" if suffix in _VIDEOS else f"files:{text}"


def open_camera(address: str, on_event: EventSink = ignore_event) -> Camera:
    """Open the camera at ``address`` (see ``acquire.addresses`` for the schemes).

    Parameters
    ----------
    address : str
        ``/dev/video0?format=Y12&fps=30``, ``opencv:0``, ``video:test.mp4``,
        ``files:shots/*.tif?fps=5``, ``session:run.h5``, or a scheme registered by others. The name of
        a folder, a glob or a file needs none (``with_scheme``).
    on_event : callable taking an Event
        Gets every fault and recovery; may be called from any thread.

    Raises
    ------
    ConfigError
        Unknown scheme, unknown key or impossible value; names the key and what is allowed.
    DeviceError, DataError
        The device or file cannot be used; says why and what to do.
    """
    return CAMERAS.open(with_scheme(address), on_event)


class CroppedCamera(CameraBase):
    """See ``acquire.camera.Camera``.

    Parameters
    ----------
    camera : Camera
    crop : (x, y, width, height), px

    Raises
    ------
    ConfigError
        The part leaves the picture.
    """

    def __init__(self, camera: Camera, crop: Crop) -> None:
        super().__init__()
        self._camera, self._cut = camera, RecordMode(crop=crop)
        self._cut.check(camera.info.width, camera.info.height)
        controls = {**camera.info.controls, "crop": list(crop)}
        self.info = dataclasses.replace(camera.info, width=crop[2], height=crop[3], controls=controls)

    def __iter__(self) -> Iterator[Frame]:
        for frame in self._camera:
            yield dataclasses.replace(frame, image=frozen(self._cut.cut(frame.image).copy()))

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._camera.stop()

    def _start(self) -> None:
        self._camera.__enter__()

    def _release(self) -> None:
        self._camera.close()
