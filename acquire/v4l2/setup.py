"""A V4L2 camera set up as its address asks: everything read back, a difference refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from acquire.errors import ConfigError, DeviceError
from acquire.frame import CameraSetting
from acquire.text import Message
from acquire.v4l2 import api
from acquire.v4l2.controls import Control, apply_controls, changeable, exposure_s, still_automatic
from acquire.v4l2.device import Mode, V4L2Device
from acquire.v4l2.formats import FORMATS, PixelFormat, preferred, warning_of
from acquire.v4l2.settings import V4L2Settings


@dataclass(frozen=True, slots=True)
class Setup:
    """What is in force.

    Attributes
    ----------
    mode : Mode
    format : PixelFormat
    controls : mapping of str to JSON value
    exposure_s : float or None, s
    settings : tuple of CameraSetting
    formats : tuple of str
    rates : tuple of float, 1/s
    warnings : tuple of str
    """

    mode: Mode
    format: PixelFormat
    controls: dict[str, Any]
    exposure_s: float | None
    settings: tuple[CameraSetting, ...]
    formats: tuple[str, ...]
    rates: tuple[float, ...]
    warnings: tuple[str, ...]


def set_up(device: V4L2Device, settings: V4L2Settings, where: str) -> Setup:
    """Set the camera up.

    Parameters
    ----------
    device : V4L2Device
    settings : V4L2Settings
    where : str
        The address, for messages.

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
    return _in_force(device, settings, controls)


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
        raise ConfigError(
            "{where}: format={asked} is not possible; the camera offers {list}", where, asked, _list(usable)
        )
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
        raise ConfigError(
            "{where}: asked for format={fourcc}, the driver gives {fourcc2}; ask for that",
            where,
            fourcc,
            got.fourcc,
        )
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


def _in_force(device: V4L2Device, settings: V4L2Settings, controls: dict[int, Control]) -> Setup:
    mode = device.mode()
    pixel_format = FORMATS[mode.fourcc]
    automatic = still_automatic(controls)
    warnings = [warning_of(pixel_format, full_range=mode.full_range, plane=settings.plane)]
    if automatic:
        warnings.append(
            Message(
                "the camera goes on changing by itself: {listed}; grey levels may drift", ", ".join(automatic)
            )
        )
    if mode.field in api.FIELDS_WOVEN:
        warnings.append(
            Message(
                "interlaced: odd and even rows are of two moments, and what moves is torn between them; choose a "
                "progressive input (input=) or mode of the source"
            )
        )
    return Setup(
        mode=mode,
        format=pixel_format,
        controls={control.name: control.shown() for control in controls.values()},
        exposure_s=exposure_s(controls),
        settings=changeable(controls, mode.fps),
        formats=tuple(offer.fourcc for offer in device.formats() if offer.fourcc in FORMATS),
        rates=tuple(device.rates(mode.fourcc, mode.width, mode.height)),
        warnings=tuple(text for text in warnings if text),
    )
