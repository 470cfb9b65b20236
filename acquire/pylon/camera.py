"""Basler cameras through pypylon: ``pylon:SERIAL?format=Mono12&fps=30&exposure_us=5000``; no target: the only one.

For those who have the maker's drivers anyway. Settings: ``format``, ``fps``, ``exposure_us``, ``gain``, ``x``, ``y``,
``width``, ``height``, ``white``, ``buffers``, ``stall_s``, and any feature of the camera by its name. Times are those
of arrival. A camera that stalls or goes away is closed, looked for and opened again by a thread of its own.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Iterator
from typing import Any

from acquire.addresses import Address, Options
from acquire.bounds import same_value
from acquire.camera import CameraBase, CameraListing, FrameCounter, StallWatch, longest_pause_s
from acquire.camera.timing import DEAD, Bounded, exposure_and_gain
from acquire.errors import ConfigError, DataError, DeviceError
from acquire.events import EventSink, Level, device_event
from acquire.frame import CameraInfo, Frame
from acquire.genicam.formats import FORMATS, decode, preferred, readable
from acquire.opening_thread import open_again

SLICE_MS, CLOSE_S = 100, 0.3
# Set before all others, where the camera has them: nothing changes by itself, grey levels are proportional to light,
# and the largest picture is possible.
FIRST = {
    **dict.fromkeys(("ExposureAuto", "GainAuto", "TriggerMode"), "Off"),
    **dict.fromkeys(("GammaEnable", "LUTEnable", "ChunkModeActive", "OffsetX", "OffsetY"), "0"),
    "AcquisitionFrameRateEnable": "1",
}
# Key of an address -> the names that cameras have for it, in the order in which they are set, after other features.
FEATURES = {
    "format": ("PixelFormat",), "width": ("Width",), "height": ("Height",), "x": ("OffsetX",), "y": ("OffsetY",),
    "exposure_us": ("ExposureTime", "ExposureTimeAbs"), "gain": ("Gain", "GainRaw"),
    "fps": ("AcquisitionFrameRate", "AcquisitionFrameRateAbs"),
}  # fmt: skip
RATE = ("ResultingFrameRate", "BslResultingAcquisitionFrameRate", "ResultingFrameRateAbs", *FEATURES["fps"])


def _pylon() -> tuple[Any, Any]:
    """The modules ``pylon`` and ``genicam`` of pypylon."""
    try:
        from pypylon import genicam, pylon
    except ImportError as error:
        raise DeviceError("pylon: cameras need pypylon: pip install 'phasedic[pylon]'") from error
    return pylon, genicam


class PylonCamera(CameraBase):
    """A Basler camera at an address; see ``acquire.camera.Camera``, also for what is raised."""

    def __init__(self, address: Address, on_event: EventSink) -> None:
        super().__init__()
        self._pylon, self._genicam = _pylon()
        self._errors = (self._genicam.GenericException, DeviceError)
        self._address, self._on_event = address.text, on_event
        options = Options(address)
        self._white = options.integer("white", minimum=1, maximum=65535)
        self._buffers = options.integer("buffers", 16, minimum=2, maximum=1000)
        stall_s = options.number("stall_s", minimum=0.1)
        self._asked = options.rest()
        self._stall, self._counter = StallWatch(self._report), FrameCounter(2**64)
        self._t, self._guard = -math.inf, threading.RLock()
        self._serial = self._only(address.target)
        try:
            self._camera = self._open()
        except self._genicam.GenericException as error:
            raise DeviceError(f"{self._address}: {error}. Close other programs that use it") from error
        self.info = self._describe(stall_s)
        self._pause_s = self.info.pause_s or math.inf

    def _only(self, target: str) -> str:
        """The serial number of the camera that is meant."""
        here = list_cameras()
        found = [one.address for one in here if target in ("", one.address.removeprefix("pylon:"))]
        if len(found) != 1:
            listed = "; ".join(f"{one.address}  {one.name}" for one in here) or "none"
            raise (ConfigError if found else DeviceError)(
                f"{self._address}: {len(found)} cameras are meant; give a serial number. Cameras here: {listed}"
            )
        return found[0].removeprefix("pylon:")

    def _open(self) -> Any:
        wanted = self._pylon.DeviceInfo()
        wanted.SetSerialNumber(self._serial)
        camera = self._pylon.InstantCamera(self._pylon.TlFactory.GetInstance().CreateFirstDevice(wanted))
        camera.Open()
        try:
            self._set_up(camera)
        except BaseException:
            camera.Close()
            raise
        return camera

    def _node(self, camera: Any, *names: str) -> Any:
        """The first feature of these names that the camera has now; None: it has none."""
        nodes = (camera.GetNodeMap().GetNode(name) for name in names)
        return next((node for node in nodes if node is not None and self._genicam.IsAvailable(node)), None)

    def _set_up(self, camera: Any) -> None:
        for name, value in FIRST.items():
            if (node := self._node(camera, name)) is not None and self._genicam.IsWritable(node):
                with contextlib.suppress(self._genicam.GenericException):
                    node.FromString(value)
        offered = list(camera.PixelFormat.Symbolics)
        asked = {"format": preferred(offered) or "Mono8", **self._asked}
        for key in [*(asked.keys() - FEATURES.keys()), *(key for key in FEATURES if key in asked)]:
            self._set(camera, key, asked[key])
        if (got := camera.PixelFormat.ToString()) not in FORMATS:
            raise ConfigError(f"{self._address}: format={got} is no grey levels; the camera offers {offered}")

    def _set(self, camera: Any, key: str, value: str) -> None:
        node = self._node(camera, *FEATURES.get(key, (key,)))
        if node is None:
            raise ConfigError(
                f"{self._address}: this camera has no {key}; known settings: {', '.join(FEATURES)}"
            )
        try:
            node.FromString(value)
        except self._genicam.GenericException as error:
            raise ConfigError(f"{self._address}: {key}={value} is not possible; {_allowed(node)}") from error
        if not same_value(got := node.ToString(), value):
            raise ConfigError(f"{self._address}: {key}={value}: the camera makes it {got}; ask for that")

    def _describe(self, stall_s: float | None) -> CameraInfo:
        camera, device = self._camera, self._camera.GetDeviceInfo()
        nodes = {key: self._node(camera, *names) for key, names in FEATURES.items()}
        rate, exposure = self._node(camera, *RATE), nodes["exposure_us"]
        fps = None if rate is None else float(rate.Value)
        exposure_s = None if exposure is None else exposure.Value * 1e-6
        self._format = FORMATS[camera.PixelFormat.ToString()]
        return CameraInfo(
            address=self._address,
            name=f"{device.GetVendorName()} {device.GetModelName()} ({self._serial})",
            width=camera.Width.Value,
            height=camera.Height.Value,
            bits=self._format.bits,
            live=True,
            clock="host",
            fps=fps,
            exposure_s=exposure_s,
            pixel_format=self._format.name,
            controls={key: node.ToString() for key, node in nodes.items() if node is not None} | self._asked,
            settings=exposure_and_gain(_bounded(exposure), _bounded(nodes["gain"]), fps),
            formats=tuple(readable(list(camera.PixelFormat.Symbolics))),
            white_level=self._white,
            pause_s=stall_s or longest_pause_s(fps, exposure_s),
        )

    def _start(self) -> None:
        if self._camera is not None and not self._camera.IsGrabbing():
            self._camera.MaxNumBuffer.Value = self._buffers
            self._camera.StartGrabbing(self._pylon.GrabStrategy_OneByOne)
            self._stall.restart(time.monotonic())

    def _release(self) -> None:
        with self._guard:
            camera, self._camera = self._camera, None
        if camera is not None:  # requests to a camera that is gone block
            closing = threading.Thread(target=camera.Close, name="pylon-closing", daemon=True)
            closing.start()
            closing.join(CLOSE_S)

    def __iter__(self) -> Iterator[Frame]:
        self._start()
        while not self.stopped.is_set():
            try:
                frame = self._next()
            except self._errors as error:
                self._recover(str(error))
            else:
                if frame is not None:
                    yield frame

    def _next(self) -> Frame | None:
        with self._guard:
            if self._camera is None:
                return None
            result = self._camera.RetrieveResult(SLICE_MS, self._pylon.TimeoutHandling_Return)
            gone = self._camera.IsCameraDeviceRemoved() or not self._camera.IsGrabbing()
        now = time.monotonic()
        try:
            if result.IsValid():
                self._stall.came(now)
                return self._frame(result, now)
            if gone or self._stall.waited(now, self._pause_s) > DEAD * self._pause_s:
                raise DeviceError("the camera no longer answers (cable, power?)")
            return None
        finally:
            result.Release()

    def _frame(self, result: Any, now: float) -> Frame | None:
        """A frame; one that is not whole is left out, and counted as lost with the next one."""
        try:
            if not result.GrabSucceeded():
                raise DataError(result.GetErrorDescription())
            size = self.info.width, self.info.height
            image = decode(result.GetBuffer(), self._format, *size, result.PaddingX)
        except DataError as error:
            self._report(f"a frame came without a whole picture ({error}) and is counted as lost")
            return None
        lost, self._t = self._counter.count(result.BlockID, now, self.info.fps), max(self._t, now)
        index, bits = self._counter.index, self._format.bits
        return Frame(image, index, self._t, "host", lost, bits, now, white_level=self._white)

    def _recover(self, why: str) -> None:
        if not self._stall.stalled:
            self._report(f"{why}; looking for it again", "error")
        with self._guard:
            old, self._camera = self._camera, None

        def attempt() -> Any:
            if old is not None:
                old.Close()
            return self._open()

        camera = open_again(attempt, lambda found: found.Close(), self.stopped, (*self._errors, ConfigError))
        if camera is not None:
            with self._guard:
                self._camera = camera
                self._counter.restart()
                self._start()
            self._report("opened again; the frames in between are counted as lost", "info")
        if self._closed:
            self._release()

    def _report(self, text: str, level: Level = "warning") -> None:
        device_event(self._on_event, self._address, f"{self._address}: {text}", level)


def _allowed(node: Any) -> str:
    if hasattr(node, "Symbolics"):
        return f"allowed: {', '.join(node.Symbolics)}"
    return f"allowed: {node.Min:g} to {node.Max:g}" if hasattr(node, "Min") else "the camera refuses it"


def _bounded(node: Any) -> Bounded | None:
    return None if node is None else (float(node.Value), float(node.Min), float(node.Max))


def list_cameras() -> list[CameraListing]:
    """All that answer; none where pypylon is not installed."""
    with contextlib.suppress(DeviceError):
        found = _pylon()[0].TlFactory.GetInstance().EnumerateDevices()
        return [CameraListing(f"pylon:{one.GetSerialNumber()}", one.GetFriendlyName()) for one in found]
    return []
