"""The free text of microcontroller sketches: talks by itself, understands nothing."""

from __future__ import annotations

from typing import ClassVar, Literal

from hw_mocks.indicator import Indicator, Shown

Style = Literal["millis", "plain", "label", "openscale"]
SATURATED = {"overload": 8388607, "underload": -8388608}  # of a 24-bit converter
COUNTS_PER_N = 800
TEMPERATURE = 21.5


class AsciiIndicator(Indicator):
    """Parameters as ``Indicator``, and the style of its lines.

    - millis: ``12345,0.512,N``
    - plain: ``0.512 N``
    - label: ``Reading: 0.512 N``
    - openscale: ``12345,0.512,N,409,21.5,``
    """

    name = "ascii"
    line = (115200, 8, "N")
    unasked: ClassVar[bool] = True
    banner: ClassVar[bytes] = b"\r\nSerial load cell, press x for menu\r\nReadings:\r\n"

    def __init__(self, resolution: float = 0.1, unit: str = "N", style: Style = "millis") -> None:
        super().__init__(resolution, unit)
        self._style = style

    def render(self, shown: Shown) -> bytes:
        """See ``Indicator``; a saturated converter shows its end value."""
        value, unit = self.displayed(shown)
        if shown.status in SATURATED and self._style != "openscale":
            value = str(SATURATED[shown.status])
        if shown.status == "error":
            value = "nan"
        return (self._text(shown, value, unit) + "\r\n").encode()

    def _text(self, shown: Shown, value: str, unit: str) -> str:
        if self._style == "plain":
            return f"{value} {unit}"
        if self._style == "label":
            return f"Reading: {value} {unit}"
        if self._style == "millis":
            return f"{shown.ms:.0f},{value},{unit}"
        raw = SATURATED.get(shown.status, round(shown.force * COUNTS_PER_N))
        return f"{shown.ms:.0f},{value},{unit},{raw},{TEMPERATURE},"
