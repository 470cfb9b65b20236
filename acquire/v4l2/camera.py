"""Cameras of Linux through V4L2: ``/dev/video0?format=Y12&width=&height=&fps=30&exposure_us=8000``.

Our own reader: raw grey levels, the driver's sequence numbers and stamps, losses and damaged
frames reported, settings read back. A fault never ends a test: a stalled, failed or unplugged
camera is closed, looked for by identity and opened again, while every step is an event.

Settings: ``format``, ``width``, ``height``, ``fps``, ``input``, ``plane=raw|r|g|b`` (Bayer),
``white``, ``buffers``, ``stall_s``, ``manual=yes|no``, ``exposure_us``, ``gain``, and every control of the
camera by its name (``brightness=10``).
"""

from __future__ import annotations

import errno
import logging
import threading
from collections.abc import Callable, Iterator
from typing import Any

from numpy.typing import NDArray

from acquire.addresses import Address, Options
from acquire.camera import CameraBase, FrameCounter, StallWatch, longest_pause_s, mid_exposure
from acquire.camera.timing import DEAD, StampOf
from acquire.errors import ConfigError, DataError, DeviceError, PhasedicError
from acquire.events import EventSink, Level, RateLimiter, device_event
from acquire.frame import CameraInfo, Clock, Frame
from acquire.v4l2.api import Kernel
from acquire.v4l2.controls import ControlWishes
from acquire.v4l2.device import NotACamera, Stamp, V4L2Device
from acquire.v4l2.faults import (
    cameras_here,
    fault_in_words,
    find_again,
    identities,
    why_not_open,
)
from acquire.v4l2.formats import PLANES, decode, picture_size
from acquire.v4l2.setup import Setup, V4L2Settings, set_up

log = logging.getLogger(__name__)

SLICE_S = 0.1  # longest wait between two looks at whether to stop
BACKOFF_S = (0.1, 0.2, 0.5, 1.0)
EMPTY_WAKES = 50  # wake-ups without a picture, after which the device counts as dead


def stamp_of(stamp: Stamp) -> StampOf:
    """What of the exposure a stamp marks; "" on another clock."""
    if not stamp.monotonic:
        return ""
    return "start" if stamp.start_of_exposure else "end"


class V4L2Camera(CameraBase):
    """A V4L2 camera; see ``acquire.camera.Camera``.

    Parameters
    ----------
    address : str
    path : str
        The node, or a link to it.
    settings : V4L2Settings
    on_event : callable taking an Event
    kernel : Kernel
    pause : callable taking seconds, giving whether to stop; None: waits for ``stop()``
        Waits between two attempts to open the camera again.

    Raises
    ------
    DeviceError, ConfigError
        It cannot be opened, or does not honour what was asked.
    """

    def __init__(
        self,
        address: str,
        path: str,
        settings: V4L2Settings,
        on_event: EventSink,
        kernel: Kernel | None = None,
        pause: Callable[[float], bool] | None = None,
    ) -> None:
        super().__init__()
        self._address, self._path, self._settings = address, path, settings
        self._on_event, self._kernel = on_event, kernel or Kernel()
        self._pause = pause or self.stopped.wait
        self._counter = FrameCounter()
        self._t = float("-inf")
        self._running = False
        self._guard = threading.RLock()  # whoever closes must not take the buffers from under a reader
        self._short = RateLimiter()
        self._stall, self._not_before, self._late = StallWatch(self._report), 0.0, False
        self._stale = self._wakes = 0
        self._device, self._setup = self._open_first()
        self._identity = self._device.identity
        there = identities(self._kernel, self._kernel.nodes()).values()
        self._others = frozenset(found for found in there if found != self._identity)
        self.info = self._describe()

    # Opening

    def _open_first(self) -> tuple[V4L2Device, Setup]:
        try:
            return self._open(self._path)
        except NotACamera as error:
            raise DeviceError(f"{self._path}: {error}; {cameras_here(self._kernel)}") from error
        except OSError as error:
            raise DeviceError(why_not_open(self._path, error, self._kernel)) from error

    def _open(self, path: str) -> tuple[V4L2Device, Setup]:
        device = V4L2Device(path, self._kernel)
        try:
            return device, set_up(device, self._settings, self._address)
        except BaseException:
            device.close()
            raise

    def _describe(self) -> CameraInfo:
        setup, mode = self._setup, self._setup.mode
        width, height = picture_size(mode.width, mode.height, setup.format, self._settings.plane)
        return CameraInfo(
            address=self._address,
            name=str(self._identity),
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
            white_level=self._settings.white,
            pause_s=self.stall_s(),
        )

    def _start(self) -> None:
        if self._running or self._closed:
            return
        try:
            self._begin()
        except OSError as error:
            self._device.close()
            raise DeviceError(why_not_open(self._path, error, self._kernel)) from error

    def _begin(self) -> None:
        self._device.start(self._settings.buffers)
        self._running = True
        self._stall.restart(self._kernel.now())

    def _release(self) -> None:
        with self._guard:
            self._running = False
            self._device.close()

    # Frames

    def __iter__(self) -> Iterator[Frame]:
        self._start()
        self._not_before = self._kernel.now() - 2 * self._period()
        while not self.stopped.is_set():
            try:
                with self._guard:
                    frame = self._next()
            except OSError as error:
                if not self.stopped.is_set():
                    self._recover(error)
            else:
                if frame is not None:
                    yield frame

    def _next(self) -> Frame | None:
        if not self._device.wait(SLICE_S):
            self._look_for_stall()
            return None
        try:
            stamp, image = self._device.fetch(self._take)
        except BlockingIOError:
            self._woken_for_nothing()
            return None
        now = self._kernel.now()
        self._wakes = 0
        self._stall.came(now)
        raw_t = stamp.time if stamp.monotonic else now
        if self._is_stale(raw_t):
            return None
        self._look_for_delay(now - raw_t)
        return self._frame(stamp, raw_t, image)

    def _take(self, content: memoryview) -> NDArray[Any] | None:
        mode = self._setup.mode
        try:
            return decode(
                content,
                self._setup.format,
                mode.width,
                mode.height,
                mode.bytes_per_line,
                self._settings.plane,
            )
        except DataError as error:
            log.debug("%s: %s", self._path, error)
            return None

    def _frame(self, stamp: Stamp, raw_t: float, image: NDArray[Any] | None) -> Frame | None:
        if image is None:
            # Nothing to hand out: its number is left open and counted as lost with the next one.
            if count := self._short.due(raw_t):
                self._report(f"{count} frame(s) came without a whole picture and are counted as lost")
            return None
        counted = self._counter.counts_itself
        lost = self._counter.count(stamp.sequence, raw_t, self._setup.mode.fps)
        if remark := self._counter.pace.remark(self._setup.mode.fps):
            self._report(remark)
        if counted and not self._counter.counts_itself:
            self._report("the driver does not number its frames; losses are counted from their stamps alone")
        if stamp.damaged:
            self._report(
                f"frame {self._counter.index} is damaged: recorded, not measured", frame=self._counter.index
            )
        clock: Clock = "device" if stamp.monotonic else "host"
        self._t = max(self._t, mid_exposure(raw_t, self._setup.exposure_s, stamp_of(stamp)))
        bits = self._setup.format.bits
        return Frame(
            image, self._counter.index, self._t, clock, lost, bits, raw_t, stamp.damaged, self._settings.white
        )

    def _is_stale(self, raw_t: float) -> bool:
        """Frames from before the first one was asked for lay in the buffers; they are left out."""
        if raw_t < self._not_before:
            self._stale += 1
            return True
        if self._stale:
            self._report(f"{self._stale} frames older than the start were left out", "info")
        self._stale, self._not_before = 0, float("-inf")
        return False

    def _look_for_delay(self, age: float) -> None:
        late = age > max(1.0, 2 * self._period())
        if late and not self._late:
            self._report(f"frames are {age:.1f} s old when they are fetched: this machine does not keep up")
        self._late = late

    # Faults

    def _period(self) -> float:
        return 1 / self._setup.mode.fps if self._setup.mode.fps else 0.1

    def stall_s(self) -> float:
        """Time without a picture that counts as a stall."""
        if self._settings.stall_s is not None:
            return self._settings.stall_s
        return longest_pause_s(self._setup.mode.fps, self._setup.exposure_s)

    def _look_for_stall(self) -> None:
        waited = self._stall.waited(self._kernel.now(), self.stall_s())
        if waited > DEAD * self.stall_s():
            raise OSError(errno.ETIMEDOUT, f"no picture for {waited:.1f} s")

    def _woken_for_nothing(self) -> None:
        self._wakes += 1
        if self._wakes > EMPTY_WAKES:
            self._wakes = 0
            raise OSError(errno.EIO, "wakes without giving a picture")

    def _recover(self, error: OSError) -> None:
        """Close, look for the camera by its identity, open it again; until it works or is stopped."""
        self._release()  # at once: an open handle makes a replugged camera come back under another name
        if not self._stall.stalled:
            self._report(f"{fault_in_words(error)}; looking for it again", "error")
        reported = ""
        attempt = 0
        while not self._pause(BACKOFF_S[min(attempt, len(BACKOFF_S) - 1)]):
            attempt += 1
            try:
                with self._guard:
                    self._reopen()
            except (OSError, PhasedicError, NotACamera) as failure:
                self._device.close()
                if (text := str(failure)) != reported:
                    reported = text
                    log.info("%s: not back yet: %s", self._address, text)
            else:
                return

    def _reopen(self) -> None:
        if self._closed:
            return
        path = find_again(self._kernel, self._path, self._identity, self._others)
        if path is None:
            raise OSError(errno.ENODEV, "the camera is not there")
        device, setup = self._open(path)
        self._device = device
        if (setup.mode, setup.format) != (self._setup.mode, self._setup.format):
            raise ConfigError(f"came back with {setup.mode} instead of {self._setup.mode}")
        self._setup = setup
        self._begin()
        self._counter.restart()
        if not self._stall.stalled:
            moved = f" as {path}" if path != self._path else ""
            self._report(f"opened again{moved}; the frames in between are counted as lost", "info", path=path)
        self._path = path

    def _report(self, text: str, level: Level = "warning", **data: Any) -> None:
        last = f" (last good frame {self._counter.index})" if level == "error" else ""
        device_event(self._on_event, self._address, f"{self._path}: {text}{last}", level, **data)


def open_v4l2(address: Address, on_event: EventSink) -> V4L2Camera:
    """Open ``/dev/video0?...``; the module's text names the settings.

    Raises
    ------
    ConfigError, DeviceError
        See ``acquire.camera.open_camera``.
    """
    return V4L2Camera(address.text, address.target, v4l2_settings(address), on_event)


def v4l2_settings(address: Address) -> V4L2Settings:
    """The settings of the address.

    Raises
    ------
    ConfigError
        An impossible value. Unknown keys are taken for controls, and refused with their
        list once the camera is open.
    """
    options = Options(address)
    plane = options.choice("plane", PLANES, "raw")
    fourcc = options.text("format")
    return V4L2Settings(
        format=fourcc.strip().upper() if fourcc else None,
        width=options.integer("width", minimum=1, maximum=65536),
        height=options.integer("height", minimum=1, maximum=65536),
        fps=options.number("fps", minimum=1e-3, maximum=1e5),
        input=options.integer("input", minimum=0),
        plane=next(name for name in PLANES if name == plane),
        white=options.integer("white", minimum=1, maximum=65535),
        buffers=options.integer("buffers", 8, minimum=2, maximum=32),
        stall_s=options.number("stall_s", minimum=0.1),
        controls=ControlWishes(
            manual=options.flag("manual", True),
            exposure_us=options.number("exposure_us", minimum=1),
            gain=options.integer("gain"),
            named={key: _whole(address, key, value) for key, value in options.rest().items()},
        ),
    )


def _whole(address: Address, key: str, value: str) -> int:
    try:
        return int(value, 0)
    except ValueError as error:
        raise ConfigError(
            f"{address.text}: {key}={value} is not possible; controls take whole numbers"
        ) from error
