"""What an address asks of a GenICam camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from acquire.addresses import Address, Options
from acquire.camera.timing import STAMPS, StampOf

NO_TRIGGER, SOFTWARE = "no", "Software"
KEYS = (
    *("format", "fps", "exposure_us", "gain", "x", "y", "width", "height", "trigger", "bits", "white"),
    *("packet_size", "buffers", "stall_s", "stamp"),
)
"""The settings of an address that are no features, for messages."""


@dataclass(frozen=True, slots=True)
class GenicamSettings:
    """What an address asks of a GenICam camera; None: whatever it has.

    Attributes
    ----------
    format : str or None
        Name of a pixel format; None: the best monochrome one there is.
    x, y, width, height : int or None, px
        The region of the sensor.
    fps : float or None, 1/s
        With a software trigger the rate of the triggers.
    exposure_us : float or None, us
    gain : float or None
        In the camera's own unit.
    trigger : str
        "no", "Software", or a line of the camera.
    bits, white : int or None
        Significant bits of a sample, and the grey level of saturation, where the camera does not have them right.
    packet_size : int or None, bytes
        None: the largest that passes.
    buffers : int
    stall_s : float or None, s
    stamp : "start" | "end" | ""
        What of the exposure its stamps mark; "": not known.
    features : mapping of str to str
        Any feature by its name.
    """

    format: str | None = None
    x: int | None = None
    y: int | None = None
    width: int | None = None
    height: int | None = None
    fps: float | None = None
    exposure_us: float | None = None
    gain: float | None = None
    trigger: str = NO_TRIGGER
    bits: int | None = None
    white: int | None = None
    packet_size: int | None = None
    buffers: int = 16
    stall_s: float | None = None
    stamp: StampOf = ""
    features: Mapping[str, str] = field(default_factory=dict)

    @property
    def waits_for_trigger(self) -> bool:
        """Whether pauses are the trigger's own."""
        return self.trigger not in (NO_TRIGGER, SOFTWARE)

    @property
    def fires_triggers(self) -> bool:
        """Whether this program triggers each picture."""
        return self.trigger == SOFTWARE


def genicam_settings(address: Address) -> GenicamSettings:
    """The settings of the address.

    Raises
    ------
    ConfigError
        An impossible value. Unknown keys are taken for features, and refused once the camera is open.
    """
    options = Options(address)
    stamp = options.choice("stamp", STAMPS, "")
    return GenicamSettings(
        format=options.text("format"),
        x=options.integer("x", minimum=0),
        y=options.integer("y", minimum=0),
        width=options.integer("width", minimum=1, maximum=65535),
        height=options.integer("height", minimum=1, maximum=65535),
        fps=options.number("fps", minimum=1e-3, maximum=1e5),
        exposure_us=options.number("exposure_us", minimum=0.1),
        gain=options.number("gain"),
        trigger=options.text("trigger", "no"),
        bits=options.integer("bits", minimum=8, maximum=16),
        white=options.integer("white", minimum=1, maximum=65535),
        packet_size=options.integer("packet_size", minimum=576, maximum=16384),
        buffers=options.integer("buffers", 16, minimum=2, maximum=1000),
        stall_s=options.number("stall_s", minimum=0.1),
        stamp=next(one for one in STAMPS if one == stamp),
        features=options.rest(),
    )
