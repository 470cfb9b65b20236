"""Cameras of Linux through V4L2: ``/dev/video0?format=Y12&width=&height=&fps=30&exposure_us=8000``.

Our own reader: raw grey levels, the driver's sequence numbers and stamps, settings read back. A camera that was away
is known again by its identity, also under another name.
"""

from __future__ import annotations

import errno
import logging
from typing import Any

from numpy.typing import NDArray

from acquire.addresses import Address
from acquire.camera.live import DeviceFault, Driver, LiveCamera, Picture
from acquire.camera.timing import StampOf, longest_pause_s
from acquire.errors import DataError, DeviceError
from acquire.events import EventSink
from acquire.frame import CameraInfo
from acquire.settings import read_settings
from acquire.text import Message
from acquire.v4l2.api import Kernel
from acquire.v4l2.device import Identity, Mode, NotACamera, Stamp, V4L2Device
from acquire.v4l2.faults import cameras_here, fault_in_words, find_again, identities, why_not_open
from acquire.v4l2.formats import decode, picture_size
from acquire.v4l2.settings import V4L2Settings
from acquire.v4l2.setup import set_up

log = logging.getLogger(__name__)

EMPTY_WAKES = 50  # wake-ups without a picture, after which the device counts as dead


def stamp_of(stamp: Stamp) -> StampOf:
    """What of the exposure a stamp marks; "" on another clock."""
    if not stamp.monotonic:
        return ""
    return "start" if stamp.start_of_exposure else "end"


class V4L2Driver:
    """An open V4L2 camera; see ``acquire.camera.live.Driver``.

    Parameters
    ----------
    address, path : str
        The node, or a link to it.
    settings : V4L2Settings
    kernel : Kernel

    Raises
    ------
    OSError, NotACamera, ConfigError, DeviceError
        It cannot be opened, or does not honour what was asked.
    """

    cycle = 2**32

    def __init__(self, address: str, path: str, settings: V4L2Settings, kernel: Kernel) -> None:
        self.name, self._settings, self._kernel = path, settings, kernel
        self._device, self._running, self._wakes = V4L2Device(path, kernel), False, 0
        self.identity = self._device.identity
        try:
            self._setup = set_up(self._device, settings, address)
        except BaseException:
            self._device.close()
            raise
        self.info = self._describe(address)

    @property
    def alike(self) -> Mode:
        """What its pictures are; who it is decides where it is looked for."""
        return self._setup.mode

    def _describe(self, address: str) -> CameraInfo:
        setup, mode, settings = self._setup, self._setup.mode, self._settings
        width, height = picture_size(mode.width, mode.height, setup.format, settings.plane)
        return CameraInfo(
            address=address,
            name=str(self.identity),
            width=width,
            height=height,
            bits=setup.format.bits,
            live=True,
            clock="device",
            fps=mode.fps,
            exposure_s=setup.exposure_s,
            pixel_format=mode.fourcc,
            controls=setup.controls,
            warnings=setup.warnings,
            settings=setup.settings,
            formats=setup.formats,
            rates=setup.rates,
            white_level=settings.white,
            pause_s=settings.stall_s or longest_pause_s(mode.fps, setup.exposure_s),
        )

    def start(self) -> None:
        """Stream; raises DeviceError."""
        if self._running:
            return
        try:
            self._device.start(self._settings.buffers)
        except OSError as error:
            self._device.close()
            raise DeviceError(why_not_open(self.name, error, self._kernel)) from error
        self._running = True

    def fetch(self, timeout_s: float) -> Picture | None:
        """See ``Driver``."""
        try:
            return self._fetched() if self._device.wait(timeout_s) else None
        except OSError as error:
            raise DeviceFault(fault_in_words(error)) from error

    def _fetched(self) -> Picture | None:
        try:
            with self._device.fetch() as (stamp, content):
                image = self._take(content)
        except BlockingIOError:
            self._wakes += 1
            if self._wakes > EMPTY_WAKES:
                raise OSError(errno.EIO, "wakes without giving a picture") from None
            return None
        self._wakes = 0
        trouble = Message("the driver marks it") * stamp.damaged
        if not stamp.monotonic:
            return Picture(image, self._kernel.now(), stamp.sequence, trouble, "host")
        return Picture(image, stamp.time, stamp.sequence, trouble, "device", stamp_of(stamp))

    def _take(self, content: memoryview) -> NDArray[Any] | None:
        mode, kind = self._setup.mode, self._setup.format
        try:
            size = mode.width, mode.height, mode.bytes_per_line
            return decode(content, kind, *size, self._settings.plane)
        except DataError as error:
            log.debug("%s: %s", self.name, error)
            return None

    def close(self) -> None:
        """Give it back."""
        self._running = False
        self._device.close()


class V4L2Opener:
    """Opens a V4L2 camera, and finds it again under another name or at another port.

    Parameters
    ----------
    address : Address
    kernel : Kernel
    """

    def __init__(self, address: Address, kernel: Kernel) -> None:
        self._address, self._kernel = address, kernel
        self._settings = read_settings(V4L2Settings, address)
        self._others: frozenset[Identity] = frozenset()

    def __call__(self, before: Driver | None) -> V4L2Driver:
        """Open it; raises DeviceError, ConfigError, or DeviceFault where a camera of before is not there."""
        if isinstance(before, V4L2Driver):
            return self._again(before)
        try:
            driver = self._open(self._address.target)
        except NotACamera as error:
            raise DeviceError(
                "{target}: {error}; {cameras_here}", self._address.target, error, cameras_here(self._kernel)
            ) from error
        except OSError as error:
            raise DeviceError(why_not_open(self._address.target, error, self._kernel)) from error
        there = identities(self._kernel, self._kernel.nodes()).values()
        self._others = frozenset(found for found in there if found != driver.identity)
        return driver

    def _again(self, before: V4L2Driver) -> V4L2Driver:
        path = find_again(self._kernel, before.name, before.identity, self._others)
        if path is None:
            raise DeviceFault("the camera is not there")
        try:
            return self._open(path)
        except (OSError, NotACamera) as error:
            raise DeviceFault(str(error)) from error

    def _open(self, path: str) -> V4L2Driver:
        return V4L2Driver(self._address.text, path, self._settings, self._kernel)


def open_v4l2(address: Address, on_event: EventSink, kernel: Kernel | None = None) -> LiveCamera:
    """Open ``/dev/video0?...``; ``V4L2Settings`` are its settings.

    Raises
    ------
    ConfigError, DeviceError
        See ``acquire.camera.open_camera``.
    """
    kernel = kernel or Kernel()
    return LiveCamera(address.text, V4L2Opener(address, kernel), on_event, kernel.now)
