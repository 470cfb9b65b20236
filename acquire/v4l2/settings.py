"""What an address asks of a V4L2 camera; None: whatever it has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from acquire.bounds import NotAllowed
from acquire.settings import FLAG, choice, number, others, setting, whole
from acquire.v4l2.formats import PLANES, Plane


def _fourcc(word: str) -> str | None:
    return word.strip().upper() or None


def _control(word: str) -> int:
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
    controls: Mapping[str, int] = others(_control,
        "any control by its name, `brightness=10`, as `phasedic devices` lists them")
# fmt: on
