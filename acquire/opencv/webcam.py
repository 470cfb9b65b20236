"""Cameras through OpenCV: ``opencv:0?width=1280&height=720``.

For cameras of other systems; on Linux ``acquire.v4l2`` has stamps and losses too. Pictures are 8-bit colour made
grey. A thread of its own drains a live camera, since OpenCV's read may block for seconds.
"""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Address
from acquire.camera.live import DeviceFault, LiveCamera, Picture
from acquire.clock import Clock
from acquire.cv2_loader import load_cv2
from acquire.errors import ConfigError, DeviceError
from acquire.events import EventSink
from acquire.files.picture import GRAYS, WEBCAM_WARNING, to_gray
from acquire.frame import CameraInfo, ClockKind, frozen
from acquire.settings import choice, number, read_settings, setting
from acquire.text import Message

STALL_S, INSTANT_S = 2.0, 0.005


class Capture(Protocol):
    """The part of ``cv2.VideoCapture`` that is used."""

    def isOpened(self) -> bool: ...
    def read(self) -> tuple[bool, Any]: ...
    def get(self, prop: int) -> float: ...
    def set(self, prop: int, value: float) -> bool: ...
    def release(self) -> None: ...


# fmt: off
@dataclass(frozen=True, slots=True)
class OpenCVSettings:
    """Settings of ``opencv:0``; None: whatever the camera has."""

    width: float | None = setting(number(1), None, "of the picture", "px")
    height: float | None = setting(number(1), None, "of the picture", "px")
    fps: float | None = setting(number(1e-3), None, "frames a second", "1/s")
    exposure: float | None = setting(number(), None, "in the unit of the system's driver")
    gain: float | None = setting(number(), None, "in the unit of the system's driver")
    gray: str = setting(choice(*GRAYS), "luma", "what is grey in a colour picture")

    def asked(self) -> dict[str, float]:
        """The settings that were given, in the order in which drivers want them."""
        names = ("width", "height", "fps", "exposure", "gain")
        return {name: value for name in names if (value := getattr(self, name)) is not None}
# fmt: on


def _properties() -> dict[str, int]:
    cv2 = load_cv2()

    return {
        "width": cv2.CAP_PROP_FRAME_WIDTH,
        "height": cv2.CAP_PROP_FRAME_HEIGHT,
        "fps": cv2.CAP_PROP_FPS,
        "exposure": cv2.CAP_PROP_EXPOSURE,
        "gain": cv2.CAP_PROP_GAIN,
    }


def _automatics() -> list[tuple[str, int, float]]:
    """What a camera changes by itself: name, property, and the value that switches it off.

    Of the exposure that is 1 behind V4L2 (``V4L2_EXPOSURE_MANUAL``) and 0 behind the other backends.
    """
    cv2 = load_cv2()
    manual = 1.0 if sys.platform == "linux" else 0.0
    return [
        ("exposure", cv2.CAP_PROP_AUTO_EXPOSURE, manual),
        (Message("white balance"), cv2.CAP_PROP_AUTO_WB, 0.0),
        ("focus", cv2.CAP_PROP_AUTOFOCUS, 0.0),
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """One read: its picture (None: failed), when it returned, how long it took, the driver's stamp."""

    picture: NDArray[Any] | None
    returned: float
    took: float
    stamp: float


class _Drain(threading.Thread):
    """Reads one capture and nothing else, until it fails or is stopped."""

    def __init__(self, capture: Capture, now: Clock) -> None:
        super().__init__(name="opencv-drain", daemon=True)
        self._capture, self._now = capture, now
        self.shots: queue.Queue[_Shot] = queue.Queue(maxsize=4)
        self.ended = threading.Event()

    def run(self) -> None:
        """Read until the first failure, which is handed on like a picture."""
        cv2 = load_cv2()

        try:
            while not self.ended.is_set():
                began = self._now()
                well, picture = self._capture.read()
                done = self._now()
                stamp = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
                self._put(_Shot(picture if well else None, done, done - began, stamp))
                if not well:
                    return
        finally:
            self._capture.release()

    def _put(self, shot: _Shot) -> None:
        while not self.ended.is_set():
            try:
                self.shots.put(shot, timeout=0.1)
            except queue.Full:
                continue
            return


class OpenCVDriver:
    """A live camera through OpenCV; see ``acquire.camera.live.Driver``.

    Parameters
    ----------
    address : str
    capture : Capture
    settings : OpenCVSettings
    now : callable giving monotonic s

    Raises
    ------
    DeviceError
        It does not open or gives no picture.
    ConfigError
        It does not honour what was asked.
    """

    cycle = 1

    def __init__(self, address: str, capture: Capture, settings: OpenCVSettings, now: Clock) -> None:
        self.name, self._capture, self._settings, self._now = address, capture, settings, now
        self._drain: _Drain | None = None
        try:
            if not capture.isOpened():
                raise DeviceError(
                    "{address}: no camera opens there; see what `phasedic devices` lists, and whether another program "
                    "holds it",
                    address,
                )
            self._set(capture)
            self.info = self._describe(capture)
        except BaseException:
            capture.release()
            raise

    @property
    def alike(self) -> tuple[int, int]:
        """What its pictures are; OpenCV does not tell who it is."""
        return self.info.width, self.info.height

    def _set(self, capture: Capture) -> None:
        properties = _properties()
        self._automatic = [
            name
            for name, prop, manual in _automatics()
            if not (capture.set(prop, manual) and capture.get(prop) == manual)
            and (name == "exposure" or capture.get(prop) > 0)  # not every camera has the others
        ]
        for name, value in self._settings.asked().items():
            capture.set(properties[name], value)
        for name, value in self._settings.asked().items():
            got = capture.get(properties[name])
            if abs(got - value) > 0.01 * abs(value):
                raise ConfigError(
                    "{name}: asked for {name2}={value:g}, the driver gives {got:g}; ask for that, or leave {name2} out",
                    self.name,
                    name,
                    value,
                    got,
                )

    def _describe(self, capture: Capture) -> CameraInfo:
        """Read one picture for its shape; it is thrown away, being older than the test."""
        cv2 = load_cv2()

        began = self._now()
        well, picture = capture.read()
        if not well:
            raise DeviceError(
                "{name}: opens but gives no picture: {verdict}", self.name, _verdict(self._now() - began)
            )
        stamp = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
        self._clock: ClockKind = "device" if abs(self._now() - stamp) < 1 else "host"
        height, width = self._gray(picture).shape
        controls = {name: capture.get(prop) for name, prop in _properties().items()}
        fps = controls["fps"]
        warnings = [WEBCAM_WARNING]
        if self._automatic:
            warnings.append(
                Message(
                    "OpenCV does not switch off, or does not tell: automatic {listed}; grey levels and sharpness may "
                    "drift: set them by hand in the camera's own program",
                    ", ".join(self._automatic),
                )
            )
        if self._clock == "host":
            warnings.append(
                Message("OpenCV tells neither stamps nor losses here: times are those of this program")
            )
        return CameraInfo(
            address=self.name,
            name=Message("OpenCV camera {name}", self.name),
            width=width,
            height=height,
            bits=8,
            live=True,
            clock=self._clock,
            fps=fps if 0 < fps < 100000 else None,
            pixel_format="BGR",
            controls=controls,
            warnings=tuple(warnings),
            pause_s=STALL_S,
        )

    def _gray(self, picture: NDArray[Any]) -> NDArray[Any]:
        image = to_gray(np.asarray(picture), self._settings.gray, self.name)
        return image.copy() if image is picture else image

    def start(self) -> None:
        """Stream."""
        if self._drain is None:
            self._drain = _Drain(self._capture, self._now)
            self._drain.start()

    def fetch(self, timeout_s: float) -> Picture | None:
        """See ``Driver``."""
        assert self._drain is not None
        try:
            shot = self._drain.shots.get(timeout=timeout_s)
        except queue.Empty:
            return None
        if shot.picture is None:
            raise DeviceFault(_verdict(shot.took))
        image, t = self._gray(shot.picture), shot.stamp if self._clock == "device" else shot.returned
        if image.shape != (self.info.height, self.info.width):
            return Picture(
                None,
                t,
                None,
                Message("it is of {shape}x{shape2} px", image.shape[1], image.shape[0]),
                self._clock,
            )
        return Picture(frozen(image), t, None, "", self._clock, arrived=shot.returned)

    def close(self) -> None:
        """Give it back; a read that still blocks does so when it returns."""
        if self._drain is None:
            self._capture.release()
            return
        self._drain.ended.set()
        self._drain.join(0.5)


def _verdict(took_s: float) -> str:
    """Words for a failed read that took so long: one that failed at once waited for nothing."""
    if took_s < INSTANT_S:
        return Message("the device is gone or dead (its reads fail at once)")
    return Message("no picture within {took_s:.1f} s", took_s)


def open_opencv(address: Address, on_event: EventSink) -> LiveCamera:
    """Open ``opencv:0?...``; ``OpenCVSettings`` are its settings.

    Raises
    ------
    ConfigError, DeviceError
        See ``acquire.camera.open_camera``.
    """
    if not address.target.isdecimal():
        raise ConfigError("{text}: give the number of the camera, as in opencv:0", address.text)
    settings = read_settings(OpenCVSettings, address)
    return live_camera(address.text, lambda: capture(int(address.target)), settings, on_event)


def live_camera(
    address: str,
    opened: Callable[[], Capture],
    settings: OpenCVSettings,
    on_event: EventSink,
    now: Clock = time.monotonic,
) -> LiveCamera:
    """The camera of the captures that ``opened`` gives, at once and after every fault."""
    return LiveCamera(address, lambda before: OpenCVDriver(address, opened(), settings, now), on_event, now)


def capture(number: int) -> Capture:
    """OpenCV's own handle of camera ``number``; it may turn out not to be opened."""
    cv2 = load_cv2()

    found: Capture = cv2.VideoCapture(number)
    return found
