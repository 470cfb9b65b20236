"""What an address asks of a GenICam camera; None: whatever it has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from acquire.camera.timing import StampOf
from acquire.settings import choice, number, others, setting, whole

NO_TRIGGER, SOFTWARE = "no", "Software"


# fmt: off
@dataclass(frozen=True, slots=True)
class GenicamSettings:
    """Settings of ``genicam:...``."""

    format: str | None = setting(str, None,
        "Mono8, Mono10, Mono12, Mono14, Mono16, `p` and `Packed`; default the best of 12 bits")
    x: int | None = setting(whole(0), None, "region of the sensor", "px")
    y: int | None = setting(whole(0), None, "region of the sensor", "px")
    width: int | None = setting(whole(1, 65535), None, "region of the sensor", "px")
    height: int | None = setting(whole(1, 65535), None, "region of the sensor", "px")
    fps: float | None = setting(number(1e-3, 1e5), None,
        "frames a second, within the bounds of the camera; that of a software trigger", "1/s")
    exposure_us: float | None = setting(number(0.1), None, "exposure, within the bounds of the camera", "us")
    gain: float | None = setting(number(), None, "in the camera's own unit, within its bounds")
    trigger: str = setting(str, NO_TRIGGER, "`no`, a line (`Line0`), or `Software`: one picture each `1/fps`")
    bits: int | None = setting(whole(8, 16), None, "significant bits, where the camera does not have them right")
    white: int | None = setting(whole(1, 65535), None,
        "grey level of saturation (12 bits in the high bits of 16: `white=65520`)", "GL")
    packet_size: int | None = setting(whole(576, 16384), None, "of GigE; default the largest that passes", "bytes")
    buffers: int = setting(whole(2, 1000), 16, "pictures that the library holds")
    stall_s: float | None = setting(number(0.1), None,
        "time without a picture that counts as a stall; with a line trigger pauses are none", "s")
    stamp: StampOf = setting(choice("start", "end"), "", "what its stamps mark; then times are mid-exposure")
    features: Mapping[str, str] = others(str, "any feature by its name: `BlackLevel=64`, `BinningHorizontal=2`")

    @property
    def waits_for_trigger(self) -> bool:
        """Whether pauses are the trigger's own."""
        return self.trigger not in (NO_TRIGGER, SOFTWARE)

    @property
    def fires_triggers(self) -> bool:
        """Whether this program triggers each picture."""
        return self.trigger == SOFTWARE
# fmt: on
