"""From what stood on the line to newtons: units, sign, tare, capacity, plausibility."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag, LoadSample
from acquire.protocols import Reading, newtons_per
from acquire.serial_line.settings import SerialSettings

TARE_WINDOW_S = 0.5
BEYOND = LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD

Tell = Callable[[str, str], None]  # level, sentence


class Scaling:
    """Makes samples of readings and tells what is wrong with them, once each time it begins.

    Parameters
    ----------
    settings : SerialSettings
    tell : callable taking level and text
    """

    def __init__(self, settings: SerialSettings, tell: Tell) -> None:
        self._settings, self._tell = settings, tell
        self._units: dict[str, float | None] = {}
        self._last_unit: str | None = None
        self._offset = 0.0
        self._recent: deque[tuple[float, float]] = deque(maxlen=1024)
        self._last_force = math.nan
        self._alarm = False

    def sample(self, reading: Reading, t: float, flags: LoadFlag = LoadFlag.NONE) -> LoadSample:
        """The sample of a reading that began at ``t``."""
        unit = reading.unit or self._settings.unit or ""
        flags |= reading.flags
        force = reading.value
        if not math.isnan(force):
            force, flags = self._force(force, unit, t, flags)
        self._watch(flags, force)
        return LoadSample(t, force, unit, reading.stable, flags, reading.raw, reading.device_ms)

    def _force(self, value: float, unit: str, t: float, flags: LoadFlag) -> tuple[float, LoadFlag]:
        factor = self._newtons(unit)
        if factor is None:
            return math.nan, flags | LoadFlag.ERROR
        gross = self._settings.sign * (value - self._settings.zero) * factor
        capacity = self._settings.capacity_N
        if capacity is not None and abs(gross) > capacity:
            flags |= LoadFlag.OUT_OF_RANGE
            if not self._settings.protocol.flags_overload:
                return math.nan, flags | (LoadFlag.OVERLOAD if gross > 0 else LoadFlag.UNDERLOAD)
        self._recent.append((t, gross))
        return self._stepped(gross - self._offset, flags)

    def _stepped(self, force: float, flags: LoadFlag) -> tuple[float, LoadFlag]:
        limit = self._settings.max_step_N
        if limit is not None and abs(force - self._last_force) > limit:
            flags |= LoadFlag.STEP
        self._last_force = force
        return force, flags

    def _newtons(self, unit: str) -> float | None:
        """Newtons per unit of the line; None, and told once, where it cannot be known."""
        if self._settings.gain is not None:
            return self._settings.gain
        if unit not in self._units:
            self._units[unit] = self._learn(unit)
        if self._last_unit not in (None, unit):
            self._tell("warning", f"the unit on the line changed from {self._last_unit} to {unit or 'none'}")
        self._last_unit = unit
        return self._units[unit]

    def _learn(self, unit: str) -> float | None:
        try:
            return self.check_unit(unit)
        except ConfigError as error:
            self._tell("error", f"no force from now on: {error}")
            return None

    def check_unit(self, unit: str) -> float:
        """Newtons per ``unit``.

        Raises
        ------
        ConfigError
            No unit at all, an unknown one, or a mass without leave.
        """
        if self._settings.gain is not None:
            return self._settings.gain
        if not unit:
            raise ConfigError("the line names no unit; say it in the address, for example unit=N")
        return newtons_per(unit, self._settings.mass_reads_force)

    def _watch(self, flags: LoadFlag, force: float) -> None:
        alarm = bool(flags & (BEYOND | LoadFlag.OUT_OF_RANGE))
        if alarm and not self._alarm:
            words = ", ".join(str(flag.name).lower().replace("_", " ") for flag in flags)
            self._tell("error", f"load alarm: {words}; {_last(self._last_force)}")
        elif self._alarm and not alarm and not math.isnan(force):
            self._tell("info", "the load is within its range again")
        if alarm or not math.isnan(force):
            self._alarm = alarm

    def tare(self) -> float | None:
        """Make the mean of the last half second zero; the new offset in N, None where nothing is known."""
        if not self._recent:
            return None
        since = self._recent[-1][0] - TARE_WINDOW_S
        recent = [force for t, force in self._recent if t >= since]
        self._offset = math.fsum(recent) / len(recent)
        self._last_force = math.nan
        return self._offset

    def device_tared(self) -> None:
        """The device's own zero moved: what was learned of steps and means is void."""
        self._recent.clear()
        self._last_force = math.nan


def _last(force: float) -> str:
    return "no valid sample before" if math.isnan(force) else f"last valid sample {force:.6g} N"
