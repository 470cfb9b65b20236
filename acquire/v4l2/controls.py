"""What an address asks of a V4L2 camera, and its controls: listed, put on manual, set, and read back.

A control that an automatic one holds (flag inactive) accepts writes and ignores them, so the automatic ones go first;
and since drivers clamp in silence, every value is read back.
"""

from __future__ import annotations

import errno
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from acquire.bounds import NotAllowed, in_steps
from acquire.errors import ConfigError
from acquire.frame import CameraSetting
from acquire.settings import FLAG, choice, keys_of, number, others, setting, whole
from acquire.text import Message
from acquire.v4l2 import api
from acquire.v4l2.device import V4L2Device
from acquire.v4l2.formats import PLANES, Plane

INTEGER, BOOLEAN, MENU, BUTTON, INTEGER64, CLASS, STRING, BITMASK, INTEGER_MENU = range(1, 10)
_VALUED = (INTEGER, BOOLEAN, MENU, BITMASK, INTEGER_MENU)
_DISABLED, _GRABBED, _READ_ONLY, _INACTIVE, _WRITE_ONLY = 0x1, 0x2, 0x4, 0x10, 0x40
_NEXT = 0x80000000

EXPOSURE_AUTO, EXPOSURE_100US, EXPOSURE_PRIORITY = 0x9A0901, 0x9A0902, 0x9A0903
GAIN, ANALOGUE_GAIN = 0x980913, 0x9E0903
POWER_LINE = 0x980918

# What an automatic control is set to so that it keeps its hands off.
MANUAL: dict[int, int] = {
    EXPOSURE_AUTO: 1,
    EXPOSURE_PRIORITY: 0,  # else the frame rate follows the light
    0x980912: 0,  # gain, automatic
    0x98090C: 0,  # white balance, automatic
    0x9A090C: 0,  # focus, continuous
    0x980919: 0,  # hue, automatic
    0x98091D: 0,  # chroma gain, automatic
    0x980920: 0,  # brightness, automatic
    0x9A0915: 0,  # wide dynamic range
    0x9A0916: 0,  # image stabilisation
    0x9A0918: 0,  # sensitivity, automatic
}
_POWER_LINE_AUTO, _POWER_LINE_OFF = 3, 0


def _fourcc(word: str) -> str | None:
    return word.strip().upper() or None


def _number_of_control(word: str) -> int:
    try:
        return int(word, 0)
    except ValueError:
        raise NotAllowed("a whole number") from None


# fmt: off
@dataclass(frozen=True, slots=True)
class V4L2Settings:
    """Settings of ``/dev/video0?...``."""

    format: str | None = setting(_fourcc, None,
        "four-character code; default the best raw grey format (Y12, Y14, Y10, Y16, GREY), then YUYV, UYVY, then a"
        " Bayer mosaic; never MJPG")
    width: int | None = setting(whole(1, 65536), None, "default the size that is set", "px")
    height: int | None = setting(whole(1, 65536), None, "default the size that is set", "px")
    fps: float | None = setting(number(1e-3, 1e5), None, "frames a second", "1/s")
    input: int | None = setting(whole(0), None, "number of the input")
    plane: Plane = setting(choice(*PLANES), "raw",
        "of a Bayer mosaic: all pixels, or those of one colour at half the width and height")
    white: int | None = setting(whole(1, 65535), None, "grey level of saturation, where it is not the highest", "GL")
    buffers: int = setting(whole(2, 32), 8, "pictures that the driver holds")
    stall_s: float | None = setting(number(0.1), None,
        "time without a picture that counts as a stall (default five frame periods and the exposure, at least 0.5);"
        " more than the longest pause of a trigger", "s")
    manual: bool = setting(FLAG, True, "no: leave automatic controls on (not for measuring)")
    exposure_us: float | None = setting(number(1), None, "exposure (cameras count in steps of 100)", "us")
    gain: int | None = setting(whole(), None, "in the camera's own steps")
    controls: Mapping[str, int] = others(_number_of_control,
        "any control by its name, `brightness=10`, as `phasedic devices` lists them")
# fmt: on


@dataclass(frozen=True, slots=True)
class Control:
    """A control and its present value.

    Attributes
    ----------
    id, type, minimum, maximum, step, default, flags, value : int
    name : str
        In the manner of v4l2-ctl: lower case with underscores.
    title : str
        As the driver writes it.
    menu : mapping of int to str
    """

    id: int
    type: int
    name: str
    title: str
    minimum: int
    maximum: int
    step: int
    default: int
    flags: int
    value: int
    menu: Mapping[int, str] = field(default_factory=dict)

    @property
    def inactive(self) -> bool:
        """Another control holds it: writes are accepted and ignored."""
        return bool(self.flags & _INACTIVE)

    @property
    def writable(self) -> bool:
        """Not read-only and not grabbed by another program."""
        return not self.flags & (_READ_ONLY | _GRABBED)

    def allowed(self) -> str:
        """What it may be set to, in words."""
        if self.menu:
            return ", ".join(Message("{value} ({words})", value, words) for value, words in self.menu.items())
        return in_steps(self.minimum, self.maximum, self.step)

    def shown(self) -> int | str:
        """The value as it is stored: the words of a menu, else the number."""
        return self.menu.get(self.value, self.value)


def control_name(title: str) -> str:
    """``"Exposure Time, Absolute"`` becomes ``exposure_time_absolute``."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")


def list_controls(device: V4L2Device) -> dict[int, Control]:
    """All controls that have a number for a value."""
    found: dict[int, Control] = {}
    query = api.QueryControl(id=_NEXT)
    while device.tried(api.QUERYCTRL, query) and len(found) < 1000:
        control = _control(device, query)
        if control is not None:
            found[control.id] = control
        query = api.QueryControl(id=query.id | _NEXT)
    return found


def _control(device: V4L2Device, query: api.QueryControl) -> Control | None:
    if query.type not in _VALUED or query.flags & (_DISABLED | _WRITE_ONLY):
        return None
    value = read_control(device, query.id)
    if value is None:
        return None
    title = query.name.decode("utf-8", "replace")
    return Control(
        id=query.id,
        type=query.type,
        name=control_name(title),
        title=title,
        minimum=query.minimum,
        maximum=query.maximum,
        step=query.step,
        default=query.default_value,
        flags=query.flags,
        value=value,
        menu=_menu(device, query) if query.type == MENU else {},
    )


def _menu(device: V4L2Device, query: api.QueryControl) -> dict[int, str]:
    entries = {}
    for index in range(query.minimum, min(query.maximum, query.minimum + 256) + 1):
        entry = api.QueryMenu(id=query.id, index=index)
        if device.tried(api.QUERYMENU, entry):
            entries[index] = entry.name.decode("utf-8", "replace")
    return entries


def read_control(device: V4L2Device, number: int) -> int | None:
    """Its present value; None where it cannot be read."""
    value = api.ControlValue(id=number)
    try:
        device.request(api.G_CTRL, value)
    except OSError as error:
        if error.errno in (errno.ENODEV, errno.EIO):
            raise
        return None
    return int(value.value)


def write_control(device: V4L2Device, number: int, value: int) -> int | None:
    """Set it, and give what it is afterwards; None where the driver refuses."""
    try:
        device.request(api.S_CTRL, api.ControlValue(id=number, value=value))
    except OSError as error:
        if error.errno in (errno.ENODEV, errno.EIO):
            raise
        return None
    return read_control(device, number)


def apply_controls(device: V4L2Device, wishes: V4L2Settings, where: str) -> dict[int, Control]:
    """Put on manual, set what was asked, and list what is in force.

    Raises
    ------
    ConfigError
        A control that is not there, does not take the value, or is held by an automatic one.
    """
    if wishes.manual:
        _put_on_manual(device)
    controls = list_controls(device)
    for which, value, unit in _asked(controls, wishes, where):
        _set(device, controls[which], value, unit, where)
    return list_controls(device)


def _put_on_manual(device: V4L2Device) -> None:
    controls = list_controls(device)
    for which, value in MANUAL.items():
        if which in controls and controls[which].value != value and controls[which].writable:
            write_control(device, which, value)
    line = controls.get(POWER_LINE)
    if line is not None and line.value == _POWER_LINE_AUTO:
        write_control(device, POWER_LINE, _POWER_LINE_OFF)


def _asked(controls: Mapping[int, Control], wishes: V4L2Settings, where: str) -> list[tuple[int, int, str]]:
    asked: list[tuple[int, int, str]] = []
    if wishes.exposure_us is not None:
        _need(controls, EXPOSURE_100US, Message("an exposure in microseconds"), where)
        asked.append(
            (EXPOSURE_100US, max(1, round(wishes.exposure_us / 100)), Message(" (in units of 100 us)"))
        )
    if wishes.gain is not None:
        number = GAIN if GAIN in controls else ANALOGUE_GAIN
        _need(controls, number, "a gain", where)
        asked.append((number, wishes.gain, ""))
    by_name = {control.name: control for control in controls.values()}
    for name, value in wishes.controls.items():
        if name not in by_name:
            raise ConfigError("{where}: unknown setting {name}; {known}", where, repr(name), _known(controls))
        asked.append((by_name[name].id, value, ""))
    return asked


def _need(controls: Mapping[int, Control], number: int, what: str, where: str) -> None:
    if number not in controls:
        raise ConfigError(
            "{where}: this camera has no control for {what}; {known}", where, what, _known(controls)
        )


def _known(controls: Mapping[int, Control]) -> str:
    names = ", ".join(sorted(control.name for control in controls.values())) or "none"
    return Message("known: {listed}; controls of this camera: {names}", keys_of(V4L2Settings), names)


def _set(device: V4L2Device, control: Control, value: int, unit: str, where: str) -> None:
    if control.inactive:
        raise ConfigError(
            "{where}: {name} is held by an automatic control of the camera; leave out manual=no, or switch that "
            "one off by its name",
            where,
            control.name,
        )
    got = write_control(device, control.id, value)
    if got != value:
        became = (
            Message("the driver refuses it") if got is None else Message("the driver makes it {got}", got)
        )
        raise ConfigError(
            "{where}: {name}={value}{unit}: {became}; allowed: {allowed}",
            where,
            control.name,
            value,
            unit,
            became,
            control.allowed(),
        )


def still_automatic(controls: Mapping[int, Control]) -> list[str]:
    """Names of the controls that the camera goes on changing by itself."""
    automatic = [
        controls[number].name
        for number, manual in MANUAL.items()
        if number in controls and controls[number].value != manual
    ]
    line = controls.get(POWER_LINE)
    return automatic + ([line.name] if line is not None and line.value == _POWER_LINE_AUTO else [])


def exposure_s(controls: Mapping[int, Control]) -> float | None:
    """The exposure in s; None where it is automatic or the driver counts in units of its own."""
    control = controls.get(EXPOSURE_100US)
    if control is None or control.inactive:
        return None
    automatic = controls.get(EXPOSURE_AUTO)
    if automatic is not None and automatic.value not in (1, 2):  # manual, shutter priority
        return None
    return control.value * 1e-4


def changeable(controls: Mapping[int, Control], fps: float | None) -> tuple[CameraSetting, ...]:
    """Exposure and gain where they can be set, in the units of the address; an exposure within one picture."""
    found, now_s = [], exposure_s(controls)
    if now_s and controls[EXPOSURE_100US].writable:
        control, now = controls[EXPOSURE_100US], now_s * 1e6
        low, most = 100.0 * max(1, control.minimum), 100.0 * control.maximum
        high = max(now, min(most, 1e6 / fps if fps else most))
        found.append(CameraSetting("exposure_us", now, min(low, now), high, 100.0, log=True))
    gain = controls.get(GAIN) or controls.get(ANALOGUE_GAIN)
    if gain is not None and gain.writable and not gain.inactive:
        found.append(CameraSetting("gain", gain.value, gain.minimum, gain.maximum, max(1, gain.step)))
    return tuple(found)
