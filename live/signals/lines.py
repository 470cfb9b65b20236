"""A measurement as a line: JSON, or CSV under a line of names."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from live.channels import Readings
from live.measure import Measurement


class Lines:
    """Writes the chosen channels of measurements.

    Parameters
    ----------
    readings : Readings
    channels : sequence of str
    form : "json" or "csv"

    Attributes
    ----------
    heading : str
        The first line a client is told; empty where there is none.
    """

    def __init__(self, readings: Readings, channels: Sequence[str], form: str) -> None:
        self._readings, self._channels, self._json = readings, tuple(channels), form == "json"
        self.heading = "" if self._json else ",".join(channels)

    def of(self, measurement: Measurement) -> str:
        """The line, without its end; what is not known is null in JSON and nan in CSV."""
        values = self._readings.read(measurement)
        if not self._json:
            return ",".join(_number(values.get(channel, math.nan)) for channel in self._channels)
        told = {channel: _rounded(values.get(channel, math.nan)) for channel in self._channels}
        return json.dumps(told, separators=(",", ":"))


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.8g}"


def _rounded(value: float) -> float | None:
    if isinstance(value, int):
        return value
    return float(f"{value:.8g}") if math.isfinite(value) else None
