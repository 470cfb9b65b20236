"""Basler cameras through pypylon: ``pylon:SERIAL?format=Mono12&fps=30&exposure_us=5000``; no target: the only one.

For those who have the maker's drivers anyway. Times are those of arrival.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from acquire.addresses import Address
from acquire.bounds import not_kept, not_possible, same_value
from acquire.camera.contract import CameraListing, not_one
from acquire.camera.live import DeviceFault, LiveCamera, Picture
from acquire.camera.timing import Bounded, exposure_and_gain, longest_pause_s
from acquire.errors import DataError, DeviceError
from acquire.events import EventSink
from acquire.frame import CameraInfo
from acquire.genicam.formats import FORMATS, decode, preferred, readable
from acquire.settings import no_feature, number, others, read_settings, setting, whole
from acquire.text import Message

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


# fmt: off
@dataclass(frozen=True, slots=True)
class PylonSettings:
    """Settings of ``pylon:...``; None: whatever the camera has."""

    format: str | None = setting(str, None, "as of `genicam:`")
    width: str | None = setting(str, None, "region of the sensor", "px")
    height: str | None = setting(str, None, "region of the sensor", "px")
    x: str | None = setting(str, None, "region of the sensor", "px")
    y: str | None = setting(str, None, "region of the sensor", "px")
    exposure_us: str | None = setting(str, None, "exposure, within the bounds of the camera", "us")
    gain: str | None = setting(str, None, "in the camera's own unit, within its bounds")
    fps: str | None = setting(str, None, "frames a second, within the bounds of the camera", "1/s")
    white: int | None = setting(whole(1, 65535), None, "grey level of saturation, where it is not the highest", "GL")
    buffers: int = setting(whole(2, 1000), 16, "pictures that the library holds")
    stall_s: float | None = setting(number(0.1), None, "time without a picture that counts as a stall", "s")
    features: Mapping[str, str] = others(str, "any feature by its name")

    def asked(self) -> dict[str, str]:
        """What the camera is asked for, by the keys of the address."""
        given = {key: getattr(self, key) for key in FEATURES}
        return {**self.features, **{key: value for key, value in given.items() if value is not None}}
# fmt: on


class PylonDriver:
    """An open Basler camera; see ``acquire.camera.live.Driver``.

    Parameters
    ----------
    address : Address
    serial : str

    Raises
    ------
    DeviceFault, DeviceError, ConfigError
        It cannot be opened, or does not honour what was asked.
    """

    cycle = 2**64

    def __init__(self, address: Address, serial: str) -> None:
        self._pylon, self._genicam = _pylon()
        self.name = self._address = address.text
        self._serial = serial
        self._settings = read_settings(PylonSettings, address)
        self._asked = self._settings.asked()
        with self._faults():
            self._camera = self._open()
            try:
                self._set_up()
                self.info = self._describe()
            except BaseException:
                self._camera.Close()
                raise

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        try:
            yield
        except self._genicam.GenericException as error:
            raise DeviceFault(str(error)) from error

    @property
    def alike(self) -> tuple[str, str, int, int]:
        """Who it is, and what its pictures are."""
        return self._serial, self._format.name, self.info.width, self.info.height

    def _open(self) -> Any:
        wanted = self._pylon.DeviceInfo()
        wanted.SetSerialNumber(self._serial)
        camera = self._pylon.InstantCamera(self._pylon.TlFactory.GetInstance().CreateFirstDevice(wanted))
        camera.Open()
        return camera

    def _node(self, *names: str) -> Any:
        """The first feature of these names that the camera has now; None: it has none."""
        nodes = (self._camera.GetNodeMap().GetNode(name) for name in names)
        return next((node for node in nodes if node is not None and self._genicam.IsAvailable(node)), None)

    def _set_up(self) -> None:
        for name, value in FIRST.items():
            if (node := self._node(name)) is not None and self._genicam.IsWritable(node):
                with contextlib.suppress(self._genicam.GenericException):
                    node.FromString(value)
        offered = list(self._camera.PixelFormat.Symbolics)
        asked = {"format": preferred(offered) or "Mono8", **self._asked}
        for key in [*(asked.keys() - FEATURES.keys()), *(key for key in FEATURES if key in asked)]:
            self._set(key, asked[key])
        if (got := self._camera.PixelFormat.ToString()) not in FORMATS:
            raise not_possible(self._address, "format", got, ", ".join(readable(offered)) or Message("none"))

    def _set(self, key: str, value: str) -> None:
        node = self._node(*FEATURES.get(key, (key,)))
        if node is None:
            raise no_feature(self._address, key, PylonSettings)
        try:
            node.FromString(value)
        except self._genicam.GenericException as error:
            raise not_possible(self._address, key, value, _allowed(node)) from error
        if not same_value(got := node.ToString(), value):
            raise not_kept(self._address, key, value, got)

    def _describe(self) -> CameraInfo:
        camera, device = self._camera, self._camera.GetDeviceInfo()
        nodes = {key: self._node(*names) for key, names in FEATURES.items()}
        rate, exposure = self._node(*RATE), nodes["exposure_us"]
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
            white_level=self._settings.white,
            pause_s=self._settings.stall_s or longest_pause_s(fps, exposure_s),
        )

    def start(self) -> None:
        """Stream."""
        with self._faults():
            if not self._camera.IsGrabbing():
                self._camera.MaxNumBuffer.Value = self._settings.buffers
                self._camera.StartGrabbing(self._pylon.GrabStrategy_OneByOne)

    def fetch(self, timeout_s: float) -> Picture | None:
        """See ``Driver``."""
        with self._faults():
            timeout = round(timeout_s * 1000)
            result = self._camera.RetrieveResult(timeout, self._pylon.TimeoutHandling_Return)
            try:
                if result.IsValid():
                    return self._picture(result, time.monotonic())
                if self._camera.IsCameraDeviceRemoved() or not self._camera.IsGrabbing():
                    raise DeviceFault("the camera no longer answers (cable, power?)")
                return None
            finally:
                result.Release()

    def _picture(self, result: Any, now: float) -> Picture:
        number = result.BlockID
        if not result.GrabSucceeded():
            return Picture(None, now, number, result.GetErrorDescription(), "host")
        try:
            size = self.info.width, self.info.height
            image = decode(result.GetBuffer(), self._format, *size, result.PaddingX)
        except DataError as error:
            return Picture(None, now, number, error.text, "host")
        return Picture(image, now, number, "", "host")

    def close(self) -> None:
        """Give it back."""
        with contextlib.suppress(self._genicam.GenericException):
            self._camera.Close()


def open_pylon(address: Address, on_event: EventSink) -> LiveCamera:
    """Open ``pylon:...``; ``PylonSettings`` are its settings.

    Raises
    ------
    ConfigError, DeviceError
        See ``acquire.camera.open_camera``.
    """
    serial = _only(address)
    return LiveCamera(address.text, lambda before: PylonDriver(address, serial), on_event)


def _only(address: Address) -> str:
    """The serial number of the camera that is meant."""
    _pylon()
    here = list_cameras()
    found = [one.address for one in here if address.target in ("", one.address.removeprefix("pylon:"))]
    if len(found) != 1:
        raise not_one(address.text, len(found), [f"{one.address}  {one.name}" for one in here])
    return found[0].removeprefix("pylon:")


def _allowed(node: Any) -> str:
    if hasattr(node, "Symbolics"):
        return ", ".join(node.Symbolics)
    return f"{node.Min:g} to {node.Max:g}" if hasattr(node, "Min") else Message("what the camera takes")


def _bounded(node: Any) -> Bounded | None:
    return None if node is None else (float(node.Value), float(node.Min), float(node.Max))


def list_cameras() -> list[CameraListing]:
    """All that answer; none where pypylon is not installed."""
    with contextlib.suppress(DeviceError):
        found = _pylon()[0].TlFactory.GetInstance().EnumerateDevices()
        return [CameraListing(f"pylon:{one.GetSerialNumber()}", one.GetFriendlyName()) for one in found]
    return []
