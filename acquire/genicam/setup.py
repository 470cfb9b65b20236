"""A GenICam camera set up as its address asks: bounds checked, everything read back, a difference refused."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from acquire.bounds import NotAllowed, as_number, in_steps, not_kept, not_possible, same_value
from acquire.camera.timing import Bounded, drifting, exposure_and_gain, longest_pause_s
from acquire.errors import ConfigError, DeviceError
from acquire.frame import CameraInfo
from acquire.genicam.device import NO_ADJUSTMENT, GenicamDevice
from acquire.genicam.formats import FORMATS, MonoFormat, preferred, readable
from acquire.genicam.library import GenicamError
from acquire.genicam.settings import NO_TRIGGER, GenicamSettings
from acquire.settings import no_feature
from acquire.text import Message

# Set to "Off", so that nothing changes by itself during a test.
AUTOMATIC = (
    *("ExposureAuto", "GainAuto", "BlackLevelAuto", "BalanceWhiteAuto", "AcquisitionFrameRateAuto"),
    *("TargetBrightnessAuto", "DefectCorrectStaticAuto"),
)
# Set to false, so that grey levels stay proportional to light, and buffers hold a picture alone.
SWITCHED_OFF = ("GammaEnable", "LUTEnable", "ChunkModeActive")
# Stored with the recording where the camera has them.
SHOWN = (
    *("DeviceFirmwareVersion", "DeviceTemperature", "PixelFormat", "Width", "Height", "OffsetX", "OffsetY"),
    *("BinningHorizontal", "BinningVertical", "ExposureTime", "ExposureTimeAbs", "Gain", "GainRaw"),
    *("BlackLevel", "Gamma", "AcquisitionFrameRate", "ResultingFrameRate", "AcquisitionResultingFrameRate"),
    *("TriggerMode", "TriggerSource", "TriggerActivation", "GevSCPSPacketSize", "GevSCPD"),
    *AUTOMATIC,
)
RESULTING_RATES = ("ResultingFrameRate", "AcquisitionResultingFrameRate", "ResultingFrameRateAbs")
SMALL_PACKETS, TEST_PACKET = 1500, "GevSCPSFireTestPacket"


@dataclass(frozen=True, slots=True)
class GenicamSetup:
    """What is in force.

    Attributes
    ----------
    info : CameraInfo
    format : MonoFormat
    x, y : int, px
    gain : float or None
    """

    info: CameraInfo
    format: MonoFormat
    x: int
    y: int
    gain: float | None

    def kept(self, asked: GenicamSettings) -> GenicamSettings:
        """What to ask of the camera when it comes back: it may have lost its power and all its settings."""
        info, exposure_s = self.info, self.info.exposure_s
        return replace(
            asked, format=self.format.name, x=self.x, y=self.y, width=info.width, height=info.height,
            exposure_us=None if exposure_s is None else exposure_s * 1e6, gain=self.gain,
        )  # fmt: skip


def set_up(device: GenicamDevice, settings: GenicamSettings, where: str) -> GenicamSetup:
    """Set the camera up.

    Parameters
    ----------
    device : GenicamDevice
    settings : GenicamSettings
    where : str
        The address.

    Raises
    ------
    ConfigError
        The camera does not honour what was asked; says what it offers.
    DeviceError
        It offers nothing that can be measured with.
    GenicamError
        It does not answer.
    """
    _put_on_manual(device)
    for feature, value in settings.features.items():
        _set_feature(device, feature, value, where)
    pixel_format = _choose_format(device, settings.format, where)
    _set_region(device, settings, where)
    _set_trigger(device, settings, where)
    for what, key, number in (
        ("exposure_time", "exposure_us", settings.exposure_us),
        ("gain", "gain", settings.gain),
        ("frame_rate", "fps", None if settings.fires_triggers else settings.fps),
    ):
        if number is not None:
            _set_number(device, what, key, number, where)
    _set_packets(device, settings, where)
    return _in_force(device, settings, pixel_format, where)


def _put_on_manual(device: GenicamDevice) -> None:
    for feature in AUTOMATIC:
        if device.has(feature) and "Off" in device.choices(feature):
            with contextlib.suppress(GenicamError):
                device.set_text(feature, "Off")
    for feature in SWITCHED_OFF:
        if device.has(feature):
            with contextlib.suppress(GenicamError):
                device.set_text(feature, "false")
    if device.has("AcquisitionMode"):
        device.set_text("AcquisitionMode", "Continuous")


def _set_feature(device: GenicamDevice, feature: str, value: str, where: str) -> None:
    if not device.has(feature):
        raise no_feature(where, repr(feature), GenicamSettings)
    kind = device.kind(feature)
    if kind == "Enumeration" and value not in device.choices(feature):
        raise not_possible(where, feature, value, ", ".join(device.choices(feature)))
    try:
        device.set_text(feature, value)
    except GenicamError as error:
        raise ConfigError(
            "{where}: {feature}={value}: the camera refuses it ({error})", where, feature, value, error
        ) from error
    if kind != "Command" and not same_value(got := device.text(feature), value):
        raise not_kept(where, feature, value, got)


def _choose_format(device: GenicamDevice, asked: str | None, where: str) -> MonoFormat:
    offered = device.choices("PixelFormat")
    usable = readable(offered)
    if not usable:
        raise DeviceError(
            "{where}: offers {listed}, none of them grey levels we can read",
            where,
            ", ".join(offered) or "nothing",
        )
    name = preferred(offered) if asked is None else asked
    if name not in usable:
        raise not_possible(where, "format", asked, ", ".join(usable))
    device.set_text("PixelFormat", name)
    if (got := device.text("PixelFormat")) != name:
        raise not_kept(where, "format", name, got)
    return FORMATS[name]


def _set_region(device: GenicamDevice, settings: GenicamSettings, where: str) -> None:
    asked = (settings.x, settings.y, settings.width, settings.height)
    if asked == (None,) * 4:
        return
    offsets = [name for name in ("OffsetX", "OffsetY") if device.has(name)]
    for name in offsets:  # the size that is possible depends on where it begins
        device.set_integer(name, device.integer_bounds(name)[0])
    for name, key, value in (
        ("Width", "width", settings.width),
        ("Height", "height", settings.height),
        ("OffsetX", "x", settings.x),
        ("OffsetY", "y", settings.y),
    ):
        if value is not None:
            _set_whole(device, name, key, value, where)


def _set_whole(device: GenicamDevice, feature: str, key: str, value: int, where: str) -> None:
    low, high, step = device.integer_bounds(feature)
    if not low <= value <= high or (value - low) % max(step, 1):
        raise not_possible(where, key, value, in_steps(low, high, step))
    device.set_integer(feature, value)
    if (got := device.integer(feature)) != value:
        raise not_kept(where, key, value, got)


def _set_trigger(device: GenicamDevice, settings: GenicamSettings, where: str) -> None:
    if device.has("TriggerMode"):
        device.ask("arv_camera_clear_triggers")
    if settings.trigger == NO_TRIGGER:
        return
    offered = device.choices("TriggerSource") if device.has("TriggerSource") else []
    if settings.trigger not in offered:
        raise not_possible(where, "trigger", settings.trigger, ", ".join([NO_TRIGGER, *offered]))
    if settings.fires_triggers and settings.fps is None:
        raise ConfigError(
            "{where}: trigger=Software needs fps=, the rate at which pictures are triggered", where
        )
    device.ask("arv_camera_set_trigger", settings.trigger)
    got = device.text("TriggerMode"), device.text("TriggerSource")
    if got != ("On", settings.trigger):
        raise not_kept(where, "trigger", settings.trigger, f"{got[1]}, {got[0]}")


def _set_number(device: GenicamDevice, what: str, key: str, value: float, where: str) -> None:
    if not device.ask(f"arv_camera_is_{what}_available"):
        raise ConfigError(
            "{where}: {key}={value:g}: this camera has no such setting; leave it out", where, key, value
        )
    try:
        as_number(value, *device.bounds_of(what))
    except NotAllowed as allowed:
        raise not_possible(where, key, f"{value:g}", allowed) from None
    device.ask(f"arv_camera_set_{what}", value)
    got = device.ask(f"arv_camera_get_{what}")
    if abs(got - value) > 0.01 * abs(value):
        raise not_kept(where, key, f"{value:g}", f"{got:g}")


def _set_packets(device: GenicamDevice, settings: GenicamSettings, where: str) -> None:
    if settings.packet_size is not None and not device.is_gige:
        raise ConfigError("{where}: packet_size= is for GigE cameras; leave it out", where)
    if not device.is_gige:
        return
    if settings.packet_size is None:
        if device.has(TEST_PACKET):
            device.ask("arv_camera_gv_auto_packet_size")
        return
    device.ask("arv_camera_gv_set_packet_size_adjustment", NO_ADJUSTMENT)
    device.ask("arv_camera_gv_set_packet_size", settings.packet_size)
    got = device.ask("arv_camera_gv_get_packet_size")
    if got != settings.packet_size:
        raise not_kept(where, "packet_size", settings.packet_size, got)


def _in_force(
    device: GenicamDevice, settings: GenicamSettings, pixel_format: MonoFormat, where: str
) -> GenicamSetup:
    exposure_us, gain = (
        device.ask(f"arv_camera_get_{what}") if device.ask(f"arv_camera_is_{what}_available") else None
        for what in ("exposure_time", "gain")
    )
    fps = _rate(device, settings)
    exposure_s = None if exposure_us is None else exposure_us * 1e-6
    bits = _bits(settings, pixel_format, where)
    info = CameraInfo(
        address=where,
        name=f"{device.identity}, {'GigE' if device.is_gige else 'USB3'} Vision",
        width=device.integer("Width"),
        height=device.integer("Height"),
        bits=bits,
        live=True,
        clock="device",
        fps=fps,
        exposure_s=exposure_s,
        pixel_format=pixel_format.name,
        controls=dict(_shown(device, settings)),
        warnings=tuple(_warnings(device, settings, fps)),
        settings=exposure_and_gain(
            _bounded(device, "exposure_time", exposure_us), _bounded(device, "gain", gain), fps
        ),
        formats=tuple(readable(device.choices("PixelFormat"))),
        white_level=_white(device, settings, bits),
        pause_s=_pause_s(settings, fps, exposure_s),
    )
    x, y = (device.integer(name) if device.has(name) else 0 for name in ("OffsetX", "OffsetY"))
    return GenicamSetup(info, pixel_format, x, y, gain)


def _pause_s(settings: GenicamSettings, fps: float | None, exposure_s: float | None) -> float:
    """Time without a picture that is no fault; a camera that waits for a trigger may rest for hours."""
    if settings.stall_s is not None:
        return settings.stall_s
    return math.inf if settings.waits_for_trigger else longest_pause_s(fps, exposure_s)


def _rate(device: GenicamDevice, settings: GenicamSettings) -> float | None:
    """Frames a second; None where a line triggers them."""
    if settings.waits_for_trigger:
        return None
    if settings.fires_triggers:
        return settings.fps
    for feature in RESULTING_RATES:
        if device.has(feature):
            return float(device.text(feature)) or None
    if not device.ask("arv_camera_is_frame_rate_available"):
        return None
    return float(device.ask("arv_camera_get_frame_rate")) or None


def _bits(settings: GenicamSettings, pixel_format: MonoFormat, where: str) -> int:
    if settings.bits is None:
        return pixel_format.bits
    if not (8 if pixel_format.bits == 8 else 9) <= settings.bits <= pixel_format.bits:
        raise ConfigError(
            "{where}: bits={bits} is not possible with {name}", where, settings.bits, pixel_format.name
        )
    return settings.bits


def _white(device: GenicamDevice, settings: GenicamSettings, bits: int) -> int | None:
    """As given, else as the camera has it, where that is below the top of its bits."""
    white = settings.white
    if white is None and device.has("PixelDynamicRangeMax"):
        with contextlib.suppress(GenicamError):
            white = device.integer("PixelDynamicRangeMax")
    return white if white is not None and 0 < white < 2**bits - 1 else None


def _shown(device: GenicamDevice, settings: GenicamSettings) -> Iterator[tuple[str, Any]]:
    for feature in dict.fromkeys((*SHOWN, *settings.features)):
        if device.has(feature):
            with contextlib.suppress(GenicamError):
                yield feature, device.text(feature)


def _bounded(device: GenicamDevice, what: str, value: float | None) -> Bounded | None:
    return None if value is None else (value, *device.bounds_of(what))


def _warnings(device: GenicamDevice, settings: GenicamSettings, fps: float | None) -> Iterator[str]:
    if words := drifting([name for name in AUTOMATIC if device.has(name) and device.text(name) != "Off"]):
        yield words
    if device.has("Gamma") and not same_value(device.text("Gamma"), "1"):
        yield Message(
            "Gamma is {text}: grey levels are not proportional to light; give Gamma=1", device.text("Gamma")
        )
    if settings.fps is not None and fps is not None and fps < 0.99 * settings.fps:
        yield Message(
            "the camera gives {fps:g} frames a second, not {fps2:g}: exposure, size or line limit it",
            fps,
            settings.fps,
        )
    if device.is_gige and (size := device.ask("arv_camera_gv_get_packet_size")) < SMALL_PACKETS:
        larger = (
            Message("larger ones did not pass")
            if device.has(TEST_PACKET)
            else Message("it cannot try larger ones by itself")
        )
        yield Message(
            "packets of {size} bytes: {larger}; set the MTU of the network card to 9000, then packet_size=8000 "
            "(docs/machine-vision.md)",
            size,
            larger,
        )
