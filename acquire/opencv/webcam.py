"""Cameras through OpenCV: ``opencv:0?width=&height=&fps=&exposure=&gain=&gray=``.

For cameras of other systems; on Linux ``acquire.v4l2`` has stamps and losses too. Pictures are 8-bit colour made
grey. A thread of its own drains a live camera, since OpenCV's read may block for seconds; dead handles are opened
anew.
"""

from __future__ import annotations

import logging
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Address, Options
from acquire.camera import CameraBase, FailureGuard, FramePace, RepeatGuard
from acquire.cv2_loader import load_cv2
from acquire.errors import ConfigError, DeviceError
from acquire.events import EventSink, device_event
from acquire.frame import CameraInfo, Clock, Frame, frozen
from acquire.opencv.gray import GRAYS, WEBCAM_WARNING, to_gray

log = logging.getLogger(__name__)

BACKOFF_S = (0.2, 0.5, 1.0, 2.0)
STALL_S = 2.0


class Capture(Protocol):
    """The part of ``cv2.VideoCapture`` that is used."""

    def isOpened(self) -> bool: ...
    def read(self) -> tuple[bool, Any]: ...
    def get(self, prop: int) -> float: ...
    def set(self, prop: int, value: float) -> bool: ...
    def release(self) -> None: ...


@dataclass(frozen=True, slots=True)
class OpenCVSettings:
    """What is asked of the camera; None: whatever it has.

    Attributes
    ----------
    width, height : float or None, px
    fps : float or None, 1/s
    exposure, gain : float or None
        In the units of the system's backend.
    gray : str
    """

    width: float | None = None
    height: float | None = None
    fps: float | None = None
    exposure: float | None = None
    gain: float | None = None
    gray: str = "luma"

    def asked(self) -> dict[str, float]:
        """The settings that were given, in the order in which drivers want them."""
        names = ("width", "height", "fps", "exposure", "gain")
        return {name: value for name in names if (value := getattr(self, name)) is not None}


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
        ("white balance", cv2.CAP_PROP_AUTO_WB, 0.0),
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

    def __init__(self, capture: Capture, now: Callable[[], float]) -> None:
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


class OpenCVCamera(CameraBase):
    """A live camera through OpenCV; see ``acquire.camera.Camera``.

    Parameters
    ----------
    address : str
    opener : callable giving a Capture
        Called at once, and again after every fault.
    settings : OpenCVSettings
    on_event : callable taking an Event
    now : callable giving monotonic s

    Raises
    ------
    DeviceError
        It does not open or gives no picture.
    ConfigError
        It does not honour what was asked.
    """

    def __init__(
        self,
        address: str,
        opener: Callable[[], Capture],
        settings: OpenCVSettings,
        on_event: EventSink,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self._address, self._opener, self._settings = address, opener, settings
        self._on_event, self._now = on_event, now
        self._repeats, self._failures, self._pace = RepeatGuard(), FailureGuard(), FramePace()
        self._index, self._last_t = -1, float("-inf")
        self._drain: _Drain | None = None
        self._capture: Capture | None = self._open()
        self.info = self._describe(self._capture)

    def _open(self) -> Capture:
        capture = self._opener()
        try:
            if not capture.isOpened():
                raise DeviceError(
                    f"{self._address}: no camera opens there; see what `phasedic devices` lists, and whether "
                    "another program holds it"
                )
            self._set(capture)
        except BaseException:
            capture.release()
            raise
        return capture

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
                    f"{self._address}: asked for {name}={value:g}, the driver gives {got:g}; "
                    f"ask for that, or leave {name} out"
                )

    def _describe(self, capture: Capture) -> CameraInfo:
        """Read one picture for its shape; it is thrown away, being older than the test."""
        cv2 = load_cv2()

        began = self._now()
        well, picture = capture.read()
        if not well:
            capture.release()
            verdict = self._failures.verdict(self._now() - began)
            raise DeviceError(f"{self._address}: opens but gives no picture: {verdict}")
        stamp = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
        self._clock: Clock = "device" if abs(self._now() - stamp) < 1 else "host"
        self._shape = self._gray(picture).shape
        controls = {name: capture.get(prop) for name, prop in _properties().items()}
        fps = controls["fps"]
        warnings = [WEBCAM_WARNING]
        if self._automatic:
            warnings.append(
                f"OpenCV does not switch off, or does not tell: automatic {', '.join(self._automatic)}; grey levels "
                "and sharpness may drift: set them by hand in the camera's own program"
            )
        if self._clock == "host":
            warnings.append("OpenCV tells neither stamps nor losses here: times are those of this program")
        return CameraInfo(
            address=self._address,
            name=f"OpenCV camera {self._address}",
            width=self._shape[1],
            height=self._shape[0],
            bits=8,
            live=True,
            clock=self._clock,
            fps=fps if 0 < fps < 100000 else None,
            pixel_format="BGR",
            controls=controls,
            warnings=tuple(warnings),
        )

    def _gray(self, picture: NDArray[Any]) -> NDArray[Any]:
        image = to_gray(np.asarray(picture), self._settings.gray, self._address)
        return image.copy() if image is picture else image

    def _start(self) -> None:
        if self._capture is not None and self._drain is None:
            self._begin(self._capture)

    def _begin(self, capture: Capture) -> None:
        self._capture, self._drain = None, _Drain(capture, self._now)
        self._drain.start()

    def _release(self) -> None:
        if self._capture is not None:
            self._capture.release()
        self._end_drain()

    def _end_drain(self) -> None:
        if self._drain is not None:
            self._drain.ended.set()
            self._drain.join(0.5)
            self._drain = None

    def __iter__(self) -> Iterator[Frame]:
        while not self.stopped.is_set():
            shot = self._next_shot()
            if shot is None:
                continue
            if shot.picture is None:
                self._recover(self._failures.verdict(shot.took))
            elif (frame := self._frame(shot)) is not None:
                yield frame

    def _next_shot(self) -> _Shot | None:
        """The next read; None when stopped, or when there was a stall or a dead handle to report."""
        self._start()
        began = self._now()
        while self._drain is not None and not self.stopped.is_set():
            try:
                return self._drain.shots.get(timeout=0.1)
            except queue.Empty:
                waited = self._now() - began
            if waited > STALL_S:
                self._report(f"no picture for {waited:.1f} s; still waiting")
                return None
        return None

    def _frame(self, shot: _Shot) -> Frame | None:
        image = self._gray(shot.picture)  # type: ignore[arg-type]  # asked by the caller
        if image.shape != self._shape:
            self._report(f"a picture of another size, {image.shape[1]}x{image.shape[0]}, was left out")
            return None
        raw_t = shot.stamp if self._clock == "device" else shot.returned
        t = max(raw_t, self._last_t)
        missing = self._pace.missing(t - self._last_t) if self._index >= 0 else 0
        lost = missing if self._clock == "device" else 0
        if remark := self._pace.remark(self.info.fps):
            self._report(remark)
        self._index, self._last_t = self._index + 1 + lost, t
        return Frame(frozen(image), self._index, t, self._clock, lost, 8, raw_t, self._repeated(image))

    def _repeated(self, image: NDArray[Any]) -> bool:
        repeated = self._repeats.repeated(image)
        if repeated and self._repeats.just_found:
            self._report("the driver hands out the same picture again and again; none of them is measured")
        return repeated

    def _recover(self, verdict: str) -> None:
        self._report(f"{verdict}; opening it again", "error")
        self._end_drain()
        for attempt in range(10**9):
            if self.stopped.wait(BACKOFF_S[min(attempt, len(BACKOFF_S) - 1)]):
                return
            try:
                self._begin(self._open())
            except (DeviceError, ConfigError) as error:
                log.debug("%s", error)
            else:
                self._report("opened again; the recording goes on", "info")
                return

    def _report(self, text: str, level: Any = "warning") -> None:
        device_event(self._on_event, self._address, f"{self._address}: {text}", level, last_index=self._index)


def open_opencv(address: Address, on_event: EventSink) -> OpenCVCamera:
    """Open ``opencv:0?width=&height=&fps=&exposure=&gain=&gray=``.

    Raises
    ------
    ConfigError, DeviceError
        See ``acquire.camera.open_camera``.
    """
    if not address.target.isdecimal():
        raise ConfigError(f"{address.text}: give the number of the camera, as in opencv:0")
    options = Options(address)
    settings = OpenCVSettings(
        width=options.number("width", minimum=1),
        height=options.number("height", minimum=1),
        fps=options.number("fps", minimum=1e-3),
        exposure=options.number("exposure"),
        gain=options.number("gain"),
        gray=options.choice("gray", GRAYS, "luma"),
    )
    options.done()
    return OpenCVCamera(address.text, lambda: capture(int(address.target)), settings, on_event)


def capture(number: int) -> Capture:
    """OpenCV's own handle of camera ``number``; it may turn out not to be opened."""
    cv2 = load_cv2()

    found: Capture = cv2.VideoCapture(number)
    return found
