"""GigE Vision and USB3 Vision cameras: ``genicam:SERIAL?format=Mono12p&fps=30&exposure_us=5000``.

The target is identifier, serial number, model or IP address; none: the only camera. A fault never ends a test: a
camera that stalls or goes away is closed, looked for and opened again by a thread of its own, while every step is an
event, and what was lost is counted.

Settings: ``format``, ``fps``, ``exposure_us``, ``gain``, ``x``, ``y``, ``width``, ``height``,
``trigger=no|Software|Line0``, ``bits``, ``white``, ``packet_size``, ``buffers``, ``stall_s``, ``stamp=start|end``, and
any feature of the camera by its name (``BlackLevel=64``).
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Iterator
from typing import Any

from numpy.typing import NDArray

from acquire.addresses import Address
from acquire.camera import CameraBase, FrameCounter, StallWatch, longest_pause_s, mid_exposure
from acquire.camera.timing import DEAD
from acquire.device_clock import DeviceClock
from acquire.errors import DataError, DeviceError, PhasedicError
from acquire.events import EventSink, Level, RateLimiter, device_event
from acquire.frame import CameraInfo, Clock, Frame
from acquire.genicam.device import GenicamDevice, Received
from acquire.genicam.finding import name_of
from acquire.genicam.formats import decode
from acquire.genicam.library import Aravis, GenicamError, load_aravis
from acquire.genicam.settings import GenicamSettings, genicam_settings
from acquire.genicam.setup import GenicamSetup, set_up
from acquire.genicam.trigger import SoftwareTrigger
from acquire.opening_thread import open_again

log = logging.getLogger(__name__)

SLICE_S = 0.1  # longest wait between two looks at whether to stop
CLOSE_S = 0.8  # of a camera that may have died a moment ago; a thread goes on with it
QUARTZ = 3e-4  # what the rate of a camera's clock may be wrong by
GIGE_NUMBERS, ALL_NUMBERS = 65535, 2**64  # GigE counts from 1 to 65535 and begins again


class GenicamCamera(CameraBase):
    """A GigE Vision or USB3 Vision camera; see ``acquire.camera.Camera``.

    Parameters
    ----------
    address : str
    target : str
        Identifier, serial number, model or IP address; "": the only one.
    settings : GenicamSettings
    on_event : callable taking an Event
    library : Aravis, optional

    Raises
    ------
    DeviceError, ConfigError
        It cannot be opened, or does not honour what was asked.
    """

    def __init__(
        self,
        address: str,
        target: str,
        settings: GenicamSettings,
        on_event: EventSink,
        library: Aravis | None = None,
    ) -> None:
        super().__init__()
        self._address, self._settings, self._on_event = address, settings, on_event
        self._library = library or load_aravis()
        self._name = name_of(self._library, target, address)
        self._clock = DeviceClock(QUARTZ)
        self._stall = StallWatch(self._report)
        self._t = -math.inf
        self._damaged, self._unstamped, self._refused = RateLimiter(), False, ""
        self._trigger: SoftwareTrigger | None = None
        self._guard = threading.RLock()  # whoever closes must not take the device from under a reader
        self._device: GenicamDevice | None = None
        self._device, self._setup = self._open_first()
        self._identity = self._device.identity
        self._counter = FrameCounter(GIGE_NUMBERS if self._device.is_gige else ALL_NUMBERS)
        self.info = self._describe(self._device)

    # Opening

    def _open_first(self) -> tuple[GenicamDevice, GenicamSetup]:
        try:
            return self._open(self._settings)
        except GenicamError as error:
            raise DeviceError(
                f"{self._address}: {self._name} does not open: {error}. Close other programs that use it, check "
                "cable and power, then try again (docs/machine-vision.md)"
            ) from error

    def _open(self, settings: GenicamSettings) -> tuple[GenicamDevice, GenicamSetup]:
        device = GenicamDevice(self._library, self._name)
        try:
            return device, set_up(device, settings, self._address)
        except BaseException:
            device.close()
            raise

    def _describe(self, device: GenicamDevice) -> CameraInfo:
        setup = self._setup
        return CameraInfo(
            address=self._address,
            name=f"{device.identity}, {'GigE' if device.is_gige else 'USB3'} Vision",
            width=setup.width,
            height=setup.height,
            bits=setup.bits,
            live=True,
            clock="device",
            fps=setup.fps,
            exposure_s=setup.exposure_s,
            pixel_format=setup.format.name,
            controls=setup.controls,
            warnings=setup.warnings,
            settings=setup.settings,
            formats=setup.formats,
            white_level=setup.white,
            pause_s=self._pause_s(),
        )

    def _pause_s(self) -> float:
        """Time without a picture that is no fault; a camera that waits for a trigger may rest for hours."""
        if self._settings.stall_s is not None:
            return self._settings.stall_s
        if self._settings.waits_for_trigger:
            return math.inf
        return longest_pause_s(self._setup.fps, self._setup.exposure_s)

    def _start(self) -> None:
        if self._device is None or self._device.streaming:
            return
        try:
            self._begin(self._device)
        except GenicamError as error:
            raise DeviceError(f"{self._address}: {self._name} does not stream: {error}") from error

    def _begin(self, device: GenicamDevice) -> None:
        device.start(self._settings.buffers)
        self._stall.restart(time.monotonic())
        if self._settings.fires_triggers and self._setup.fps:
            self._trigger = SoftwareTrigger(device, 1 / self._setup.fps, self._report)

    def _release(self) -> None:
        with self._guard:
            device, self._device = self._device, None
        if self._trigger is not None:
            self._trigger.stop()
        if device is not None:  # requests to a dead camera block for seconds
            closing = threading.Thread(target=device.close, name="genicam-closing", daemon=True)
            closing.start()
            closing.join(0.0 if device.lost.is_set() or self._stall.stalled else CLOSE_S)

    # Frames

    def __iter__(self) -> Iterator[Frame]:
        self._start()
        if self._device is not None:
            self._device.discard_waiting()  # they are older than the test
        while not self.stopped.is_set():
            try:
                frame = self._next()
            except GenicamError as error:
                if not self.stopped.is_set():
                    self._recover(str(error))
            else:
                if frame is not None:
                    yield frame

    def _next(self) -> Frame | None:
        with self._guard:
            if self._device is None:
                return None
            received = self._device.fetch(SLICE_S, self._take)
            lost = self._device.lost.is_set()
        now = time.monotonic()
        if lost:
            raise GenicamError("the camera no longer answers (cable, power, network?)")
        if received is None:
            if self._stall.waited(now, self._pause_s()) > DEAD * self._pause_s():
                raise GenicamError("the camera has stalled")
            return None
        self._stall.came(now)
        return self._frame(received, now - received.age_s)

    def _take(self, content: memoryview, padding: int) -> NDArray[Any] | None:
        try:
            return decode(content, self._setup.format, self._setup.width, self._setup.height, padding)
        except DataError as error:
            log.debug("%s: %s", self._address, error)
            return None

    def _frame(self, received: Received, arrived: float) -> Frame | None:
        trouble = received.trouble
        if not trouble and received.size != (self._setup.width, self._setup.height):
            raise GenicamError(f"its pictures are {received.size[0]}x{received.size[1]} now")
        if trouble or received.taken is None:
            # Nothing to hand out: its number is left open and counted as lost with the next one.
            if count := self._damaged.due(arrived):
                why = trouble or "bytes are missing"
                self._report(f"{count} frame(s) came without a whole picture ({why}) and are counted as lost")
            return None
        clock, raw_t = self._stamp(received, arrived)
        lost = self._counter.count(received.number, raw_t, self._setup.fps)
        self._t = max(self._t, mid_exposure(raw_t, self._setup.exposure_s, self._settings.stamp))
        return Frame(
            received.taken, self._counter.index, self._t, clock, lost, self._setup.bits, raw_t,
            white_level=self._setup.white,
        )  # fmt: skip

    def _stamp(self, received: Received, arrived: float) -> tuple[Clock, float]:
        """The camera's stamp on our clock; of a camera that has none the arrival."""
        if received.stamp_ns == 0:
            if not self._unstamped:
                self._report("the camera does not stamp its frames: times are those of their arrival")
            self._unstamped = True
            return "host", arrived
        stamp = self._clock.stamp(received.stamp_ns * 1e-6, arrived)
        if stamp.jumped:
            self._report("the camera's clock jumped (a restart?); its stamps are tied anew")
        return "device", stamp.t

    # Faults

    def _recover(self, why: str) -> None:
        """Close, look for the camera, open it again; until it works or is stopped."""
        if not self._stall.stalled:
            self._report(f"{why}; looking for it again", "error")
        old, self._device = self._device, None
        if self._trigger is not None:
            self._trigger.stop()

        def attempt() -> tuple[GenicamDevice, GenicamSetup]:
            if old is not None:
                old.close()
            return self._opened_alike()

        opened = open_again(
            attempt,
            lambda found: found[0].close(),
            self.stopped,
            (GenicamError, PhasedicError),
            self._not_back,
        )
        if opened is not None:
            self._resume(*opened)

    def _opened_alike(self) -> tuple[GenicamDevice, GenicamSetup]:
        device, setup = self._open(self._setup.kept(self._settings))
        if device.identity != self._identity or setup.picture != self._setup.picture:
            device.close()
            raise DeviceError(f"{device.identity} with {setup.picture} came back, not {self._identity}")
        return device, setup

    def _not_back(self, error: Exception) -> None:
        """A camera that answers and cannot be used is reported, once; one that is away has been already."""
        log.debug("%s: not back yet: %s", self._address, error)
        if isinstance(error, PhasedicError) and str(error) != self._refused:
            self._refused = str(error)
            self._report(f"it is back, but cannot be used: {error}", "error")

    def _resume(self, device: GenicamDevice, setup: GenicamSetup) -> None:
        with self._guard:
            if self._closed:
                device.close()
                return
            self._device, self._setup = device, setup
            self._counter.restart()
            self._clock = DeviceClock(QUARTZ)
            self._begin(device)
        if not self._stall.stalled:
            self._report("opened again; the frames in between are counted as lost", "info")

    def _report(self, text: str, level: Level = "warning", **data: Any) -> None:
        last = f" (last good frame {self._counter.index})" if level == "error" else ""
        device_event(self._on_event, self._address, f"{self._name}: {text}{last}", level, **data)


def open_genicam(address: Address, on_event: EventSink) -> GenicamCamera:
    """Open ``genicam:...``; the module's text names the settings.

    Raises
    ------
    ConfigError, DeviceError
        See ``acquire.camera.open_camera``.
    """
    return GenicamCamera(address.text, address.target, genicam_settings(address), on_event)
