"""Cameras of Linux through V4L2: ``/dev/video0?format=Y12&width=&height=&fps=30&exposure_us=8000``.

Our own reader: raw grey levels, the driver's sequence numbers and stamps. A camera is set up as its address asks:
everything is read back, a difference is refused. One that was away is known again by its identity, also under another
name.
"""

from __future__ import annotations

import errno
import logging
from typing import Any

from numpy.typing import NDArray

from acquire.addresses import Address
from acquire.bounds import not_kept, not_possible
from acquire.camera.live import DeviceFault, Driver, LiveCamera, Picture
from acquire.camera.timing import StampOf, drifting, longest_pause_s
from acquire.errors import ConfigError, DataError, DeviceError
from acquire.events import EventSink
from acquire.frame import CameraInfo
from acquire.settings import read_settings
from acquire.text import Message
from acquire.v4l2 import api
from acquire.v4l2.api import Kernel
from acquire.v4l2.controls import (
    Control,
    V4L2Settings,
    apply_controls,
    changeable,
    exposure_s,
    still_automatic,
)
from acquire.v4l2.device import Identity, Mode, NotACamera, Stamp, V4L2Device
from acquire.v4l2.formats import FORMATS, decode, picture_size, preferred, warning_of
from acquire.v4l2.listing import cameras_here, fault_in_words, find_again, identities, why_not_open

log = logging.getLogger(__name__)

EMPTY_WAKES = 50  # wake-ups without a picture, after which the device counts as dead


def set_up(device: V4L2Device, settings: V4L2Settings, where: str) -> CameraInfo:
    """Set the camera up; what is in force then.

    Parameters
    ----------
    device : V4L2Device
    settings : V4L2Settings
    where : str
        The address.

    Raises
    ------
    ConfigError
        The camera does not honour what was asked; says what it offers.
    DeviceError
        It offers nothing that can be measured with.
    OSError
        From the kernel.
    """
    if settings.input is not None:
        _choose_input(device, settings.input, where)
    fourcc = _choose_format(device, settings.format, where)
    _set_format(device, fourcc, settings, where)
    controls = apply_controls(device, settings, where)
    if settings.fps is not None:
        _set_fps(device, fourcc, settings.fps, where)
    return _in_force(device, settings, controls, where)


def _choose_input(device: V4L2Device, index: int, where: str) -> None:
    names = device.inputs()
    if not 0 <= index < len(names):
        offered = ", ".join(Message("{k} ({name})", k, name) for k, name in enumerate(names)) or "none"
        raise ConfigError(
            "{where}: input={index} is not there; the camera has: {offered}", where, index, offered
        )
    device.select_input(index)


def _choose_format(device: V4L2Device, asked: str | None, where: str) -> str:
    offered = [offer.fourcc for offer in device.formats()]
    usable = [code for code in offered if code in FORMATS]
    if asked is None:
        best = preferred(offered)
        if best is None:
            hint = Message("; format=MJPG takes the compressed pictures, with a warning") * bool(usable)
            raise DeviceError(
                "{where}: offers {list}, none of them raw grey levels we can read{hint}",
                where,
                _list(offered),
                hint,
            )
        return best
    if asked not in usable:
        raise not_possible(where, "format", asked, _list(usable))
    return asked


def _list(words: list[str]) -> str:
    return ", ".join(words) or "nothing"


def _set_format(device: V4L2Device, fourcc: str, settings: V4L2Settings, where: str) -> None:
    now = device.mode()
    width, height = settings.width or now.width, settings.height or now.height
    device.set_format(fourcc, width, height)
    got = device.mode()
    if got.field in api.FIELDS_APART:
        raise ConfigError(
            "{where}: gives interlaced fields one by one ({FIELDS_APART}), not pictures; choose a progressive "
            "input (input=) or mode of the source",
            where,
            api.FIELDS_APART[got.field],
        )
    if got.fourcc != fourcc:
        raise not_kept(where, "format", fourcc, got.fourcc)
    asked = (settings.width or got.width, settings.height or got.height)
    if (got.width, got.height) != asked:
        sizes = _list([str(size) for size in device.sizes(fourcc)])
        raise ConfigError(
            "{where}: asked for {asked}x{asked2}, the driver gives {width}x{height}; {fourcc} is offered in "
            "{sizes}",
            where,
            asked[0],
            asked[1],
            got.width,
            got.height,
            fourcc,
            sizes,
        )


def _set_fps(device: V4L2Device, fourcc: str, fps: float, where: str) -> None:
    device.set_fps(fps)
    mode = device.mode()
    if mode.fps is None or abs(mode.fps - fps) > 0.01 * fps:
        rates = _list([f"{rate:g}" for rate in device.rates(fourcc, mode.width, mode.height)])
        given = Message("no frame rate at all") if mode.fps is None else f"{mode.fps:g}"
        raise ConfigError(
            "{where}: asked for fps={fps:g}, the driver gives {given}; {fourcc} {width}x{height} is offered at "
            "{rates} 1/s",
            where,
            fps,
            given,
            fourcc,
            mode.width,
            mode.height,
            rates,
        )


def _in_force(
    device: V4L2Device, settings: V4L2Settings, controls: dict[int, Control], address: str
) -> CameraInfo:
    mode = device.mode()
    pixel_format = FORMATS[mode.fourcc]
    warnings = [
        warning_of(pixel_format, full_range=mode.full_range, plane=settings.plane),
        drifting(still_automatic(controls)),
    ]
    if mode.field in api.FIELDS_WOVEN:
        warnings.append(
            Message(
                "interlaced: odd and even rows are of two moments, and what moves is torn between them; choose a "
                "progressive input (input=) or mode of the source"
            )
        )
    width, height = picture_size(mode.width, mode.height, pixel_format, settings.plane)
    exposed_s = exposure_s(controls)
    return CameraInfo(
        address=address,
        name=str(device.identity),
        width=width,
        height=height,
        bits=pixel_format.bits,
        live=True,
        clock="device",
        fps=mode.fps,
        exposure_s=exposed_s,
        pixel_format=mode.fourcc,
        controls={control.name: control.shown() for control in controls.values()},
        warnings=tuple(text for text in warnings if text),
        settings=changeable(controls, mode.fps),
        formats=tuple(offer.fourcc for offer in device.formats() if offer.fourcc in FORMATS),
        rates=tuple(device.rates(mode.fourcc, mode.width, mode.height)),
        white_level=settings.white,
        pause_s=settings.stall_s or longest_pause_s(mode.fps, exposed_s),
    )


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
            self.info = set_up(self._device, settings, address)
            self.alike: Mode = self._device.mode()  # who it is decides where it is looked for
        except BaseException:
            self._device.close()
            raise

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
        mode = self.alike
        try:
            size = mode.width, mode.height, mode.bytes_per_line
            return decode(content, FORMATS[mode.fourcc], *size, self._settings.plane)
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
