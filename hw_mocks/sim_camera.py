"""The simulated camera: ``sim:hole?fps=60&bits=12``.

It looks at a ``VirtualSpecimen`` through an analytic renderer and a noisy sensor, and behaves like
a driver: frames come at their own pace from a thread of its own into a finite ring of buffers;
when nobody takes them they are dropped and the sequence numbers show it; so do frames that the
renderer cannot finish in time. With ``fps=auto`` such a frame is taken later instead, and all that follow
with it. ``lockstep=yes`` waits for its reader, on nominal time.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from acquire.addresses import Address, Options
from acquire.clock import Clock
from acquire.errors import DeviceError
from acquire.events import EventSink, device_event
from acquire.frame import CameraInfo, CameraSetting, ClockKind, Frame
from acquire.opening import Closing
from acquire.settings import number, take_settings
from acquire.text import Message
from hw_mocks import sim_settings
from hw_mocks.optics import Optics, take_optics
from hw_mocks.scene import Exposer, Scene, Sensor, rendered_fps, take_sensor, upper_half
from hw_mocks.specimen import VirtualSpecimen, take_specimen

log = logging.getLogger(__name__)
POLL_S = 0.1
FORMATS = {8: "GREY", 10: "Y10", 12: "Y12", 16: "Y16"}
AUTO_FPS = (30.0, 25.0, 20.0, 15.0, 10.0, 5.0)
"""What fps=auto chooses from."""


@dataclass(frozen=True, slots=True, eq=False)
class SimCameraSettings:
    """The picture and the pace of the camera.

    Attributes
    ----------
    sensor : Sensor
    fps : float, 1/s
    exposure_s : float, s
    radius_px : float, px
        Of the speckles.
    contrast : float
        Standard deviation of the pattern, part of full scale.
    seed : int
    buffers : int
        Of the ring.
    offset_s : float, s
        Nominal time of the start (lock step).
    faults : FaultPlan
    optics : Optics
    unhurried : bool
        A frame whose time has passed is taken now, and all that follow later by as much; else it is lost.
    """

    sensor: Sensor
    fps: float = 60.0
    exposure_s: float = 0.002
    radius_px: float = 2.0
    contrast: float = 0.18
    seed: int = 0
    buffers: int = 4
    offset_s: float = 0.0
    faults: sim_settings.FaultPlan = field(default_factory=sim_settings.FaultPlan)
    optics: Optics = field(default_factory=Optics)
    unhurried: bool = False

    def scene(self, specimen: VirtualSpecimen) -> Scene:
        """What the camera sees of ``specimen``."""
        return Scene(specimen, self.radius_px, self.contrast, self.seed, self.optics)


class Ring:
    """A few buffers between the sensor and whoever reads; full, it takes nothing."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._frames: deque[Frame] = deque()
        self._change = threading.Condition()
        self._closed = False

    def put(self, frame: Frame) -> bool:
        """Store a frame; False: no buffer is free."""
        with self._change:
            if len(self._frames) >= self._size:
                return False
            self._frames.append(frame)
            self._change.notify()
            return True

    def close(self) -> None:
        """No more frames will come."""
        with self._change:
            self._closed = True
            self._change.notify_all()

    def get(self, timeout: float) -> tuple[Frame | None, bool]:
        """The oldest frame or None, and whether more may come."""
        with self._change:
            if not self._frames and not self._closed:
                self._change.wait(timeout)
            frame = self._frames.popleft() if self._frames else None
            return frame, frame is not None or not self._closed


class SimCamera(Closing):
    """See the module; fulfils ``acquire.camera.Camera``.

    Parameters
    ----------
    specimen : VirtualSpecimen
        ``specimen.nominal`` chooses lock step.
    settings : SimCameraSettings
    address : str
        For messages.
    on_event : callable
    clock : callable giving monotonic seconds
    sleep : callable taking seconds, optional
        By default a wait that ``stop`` interrupts.

    Attributes
    ----------
    scene : Scene
        What it sees, for the truth.
    dropped : int
        Frames lost so far because no buffer was free or the renderer was late.
    """

    def __init__(
        self,
        specimen: VirtualSpecimen,
        settings: SimCameraSettings,
        address: str,
        on_event: EventSink,
        *,
        clock: Clock = time.monotonic,
        sleep: Callable[[float], object] | None = None,
    ) -> None:
        self.specimen, self._settings, self._on_event = specimen, settings, on_event
        self._clock, self._stopped = clock, threading.Event()
        self._sleep = sleep or self._stopped.wait
        self.scene = settings.scene(specimen)
        self._exposer = Exposer(settings.sensor, (specimen.height, specimen.width), settings.seed + 1)
        self._plan = self._planned()
        self._ring = Ring(settings.buffers)
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        self._last_index, self._trouble = -1, ""
        self._entered_s = self._delay_s = 0.0
        self.dropped = 0
        self.info = self._describe(address)
        specimen.clock.claimed = True
        # Compiles what is not compiled yet, before time counts; the noise to come stays as it is.
        Exposer(settings.sensor, (specimen.height, specimen.width), 0).expose(self.scene.render(0.0))

    def _describe(self, address: str) -> CameraInfo:
        settings, sensor, specimen = self._settings, self._settings.sensor, self.specimen
        clock: ClockKind = "nominal" if specimen.nominal else "device"
        controls: dict[str, Any] = {
            "bits": sensor.bits,
            "full_well_e": sensor.full_well_e if np.isfinite(sensor.full_well_e) else None,
            "read_noise_e": sensor.read_e,
            "noise_mid_grey_GL": sensor.noise(),
            "fixed_pattern": sensor.fixed_pattern,
            "brightness": sensor.brightness,
            "speckle_radius_px": settings.radius_px,
            "contrast": settings.contrast,
            "seed": settings.seed,
            "buffers": settings.buffers,
        }
        return CameraInfo(
            address=address,
            name=Message("simulated camera, {specimen} specimen", specimen.kind),
            width=specimen.width,
            height=specimen.height,
            bits=sensor.bits,
            live=not specimen.nominal,
            clock=clock,
            fps=settings.fps,
            exposure_s=settings.exposure_s,
            pixel_format=FORMATS[sensor.bits],
            controls=controls,
            warnings=(Message("simulated: no camera and no specimen"),),
            settings=self._changeable(),
        )

    def _changeable(self) -> tuple[CameraSetting, ...]:
        now, most = self._settings.exposure_s * 1e6, 1e6 / self._settings.fps
        brightness = CameraSetting("brightness", self._settings.sensor.brightness, 0.1, 4.0)
        if now <= 0:
            return (brightness,)
        return CameraSetting("exposure_us", now, min(50.0, now), most, log=True), brightness

    def __enter__(self) -> Self:
        if self._thread is None and not self._stopped.is_set():
            now = self._settings.offset_s if self.specimen.nominal else self._clock()
            self._entered_s = now - self.specimen.clock.begin(now)  # 0, unless another camera began the test
            if not self.specimen.nominal:
                self._thread = threading.Thread(target=self._work, name="sim-camera", daemon=True)
                self._thread.start()
        return self

    def __iter__(self) -> Iterator[Frame]:
        source = self._in_lock_step() if self.specimen.nominal else self._from_ring()
        for frame in source:
            if self._stopped.is_set():
                return
            yield frame

    def stop(self) -> None:
        """End the iteration; may be called from any thread."""
        self._stopped.set()
        self._ring.close()

    def close(self) -> None:
        """Stop, and wait for the thread."""
        self.stop()
        if self._thread is not None:
            self._thread.join()
        self.specimen.close()

    def _start(self) -> float:
        return self.specimen.clock.start or 0.0

    def _from_ring(self) -> Iterator[Frame]:
        more = self._thread is not None
        while more and not self._stopped.is_set():
            frame, more = self._ring.get(POLL_S)
            if frame is not None:
                yield self._numbered(frame)
        if self._error is not None:
            raise self._error

    def _in_lock_step(self) -> Iterator[Frame]:
        for planned in self._plan:
            if self._delivers(planned):
                yield self._numbered(self._shoot(planned))
        if self._error is not None:
            raise self._error

    def _numbered(self, frame: Frame) -> Frame:
        """The frame, knowing what was lost before it."""
        lost, self._last_index = frame.index - self._last_index - 1, frame.index
        return replace(frame, lost_before=lost) if lost else frame

    def _work(self) -> None:
        """The thread: each frame at its time into the ring."""
        try:
            for planned in self._plan:
                if self._stopped.is_set():
                    break
                if planned.t < self._entered_s:
                    self._last_index = planned.index
                else:
                    self._serve(planned)
        except Exception as error:
            log.exception("the simulated camera failed")
            self._error = error
        finally:
            self._ring.close()

    def _planned(self) -> Iterator[sim_settings.Planned]:
        """The frames until the test ends, which its operator may decide; no time of an unhurried camera has passed."""
        for planned in sim_settings.plan_frames(math.inf, self._settings.fps, self._settings.faults):
            if self._settings.unhurried:
                due = self._start() + planned.t + self._delay_s + self._settings.exposure_s / 2
                self._delay_s += max(0.0, self._clock() - due)
            t = planned.t + self._delay_s
            if t > self.specimen.duration_s + 1e-9:
                return
            yield replace(planned, t=t)

    def _serve(self, planned: sim_settings.Planned) -> None:
        """One frame period; the picture is made before its time and stored when it is due.

        A lag shorter than the ring costs nothing, as with a camera that fills its buffers by itself.
        """
        due = self._start() + planned.t + self._settings.exposure_s / 2
        late = self._clock() - due > (self._settings.buffers - 1) / self._settings.fps
        frame = None if late or planned.fate not in ("good", "damaged") else self._shoot(planned)
        if (left := due - self._clock()) > 0:
            self._sleep(left)
        if self._delivers(planned) and (frame is None or not self._ring.put(frame)):
            self.dropped += 1

    def _delivers(self, planned: sim_settings.Planned) -> bool:
        """Whether this frame comes; reports trouble that begins or ends here."""
        trouble = planned.fate if planned.fate in ("stalled", "disconnected") else ""
        source = self.info.address
        if planned.fate == "gone":
            text = Message("the camera was disconnected and does not come back; plug it in and start again")
            self._error = DeviceError("{source}: {text}", source, text)
        elif trouble and trouble != self._trouble:
            device_event(
                self._on_event, source, Message("the camera is {trouble}; waiting for it", trouble), "error"
            )
        elif self._trouble and not trouble:
            device_event(
                self._on_event, source, Message("the camera was {trouble} and is back", self._trouble), "info"
            )
        self._trouble = trouble
        return planned.fate in ("good", "damaged")

    def _shoot(self, planned: sim_settings.Planned) -> Frame:
        image, damaged = self._exposer.expose(self.scene.render(planned.t)), planned.fate == "damaged"
        image = upper_half(image) if damaged else image
        t = self._start() + planned.t
        raw = t if self.specimen.nominal else t + self._settings.exposure_s / 2
        return Frame(image, planned.index, t, self.info.clock, 0, self.info.bits, raw, damaged)


def open_sim_camera(address: Address, on_event: EventSink, specimen: VirtualSpecimen) -> SimCamera:
    """Open ``sim:KIND?key=value...`` (``SimSettings``) on a specimen made by ``specimen_from`` of the same address.

    Raises
    ------
    ConfigError
        Unknown key or fault, or an impossible value.
    """
    options = Options(address)
    take_specimen(options)
    settings = _take_camera(options)
    options.done()
    if _automatic(options) and not specimen.nominal:
        most = rendered_fps(settings.scene(specimen), settings.sensor)
        fps = next((fps for fps in AUTO_FPS if fps <= most), AUTO_FPS[-1])
        settings = replace(settings, fps=fps, unhurried=True)
    return SimCamera(specimen, settings, address.text, on_event)


def fps_on_this_machine(address: Address) -> float:
    """The rate at which this machine renders the pictures of an address with ease, 1/s."""
    options = Options(address)
    specimen, settings = take_specimen(options), _take_camera(options)
    return rendered_fps(settings.scene(specimen), settings.sensor)


def _automatic(options: Options) -> bool:
    return ("fps", "auto") in options.address.settings


def _take_camera(options: Options) -> SimCameraSettings:
    given = take_settings(sim_settings.PictureSettings, options)
    fps = given.fps or AUTO_FPS[0]
    exposure_us = options.again("exposure_us", min(2000.0, 5e5 / fps), number(0, 1e6 / fps))
    return SimCameraSettings(
        sensor=take_sensor(options),
        fps=fps,
        exposure_s=exposure_us * 1e-6,
        radius_px=given.radius,
        contrast=given.contrast / 100,
        seed=given.seed,
        buffers=given.buffers,
        offset_s=given.offset,
        faults=sim_settings.parse_faults(given.faults, sim_settings.CAMERA_FAULTS, options.address.text),
        optics=take_optics(options),
    )
