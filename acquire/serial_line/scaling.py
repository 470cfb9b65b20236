"""From what stood on the line to newtons: units, sign, tare, capacity, plausibility."""

from __future__ import annotations

import math
from collections.abc import Callable

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag, LoadSample
from acquire.protocols import Reading, newtons_per
from acquire.serial_line.settings import SerialSettings
from acquire.serial_line.zero import Zero

BEYOND = LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD

Tell = Callable[[str, str], None]  # level, sentence


class Scaling:
    """Makes samples of readings and tells what is wrong with them, once each time it begins.

    Parameters
    ----------
    settings : SerialSettings
    tell : callable taking level and text

    Attributes
    ----------
    zero : Zero
        What is taken off every force.
    """

    def __init__(self, settings: SerialSettings, tell: Tell) -> None:
        self._settings, self._tell = settings, tell
        self._units: dict[str, float | None] = {}
        self._last_unit: str | None = None
        self.zero = Zero()
        self._last_force = math.nan
        self._alarm = False
        self._decimals = 0

    def sample(self, reading: Reading, t: float, flags: LoadFlag = LoadFlag.NONE) -> LoadSample:
        """The sample of a reading that began at ``t``."""
        unit = reading.unit or self._settings.unit or ""
        flags |= reading.flags
        force = reading.value
        if not math.isnan(force):
            gross, flags = self._gross(force, unit, flags)
            force, flags = self._stepped(gross - self.zero.offset, flags)
        self._see(t, force, flags)
        self._watch(flags, force)
        return LoadSample(t, force, unit, reading.stable, flags, reading.raw, reading.device_ms)

    def _gross(self, value: float, unit: str, flags: LoadFlag) -> tuple[float, LoadFlag]:
        factor = self._newtons(unit)
        if factor is None:
            return math.nan, flags | LoadFlag.ERROR
        self._learn_step(value, factor)
        gross = self._settings.sign * (value - self._settings.zero) * factor
        capacity = self._settings.capacity_N
        if capacity is not None and abs(gross) > capacity:
            flags |= LoadFlag.OUT_OF_RANGE
            if not self._settings.protocol.flags_overload:
                return math.nan, flags | (LoadFlag.OVERLOAD if gross > 0 else LoadFlag.UNDERLOAD)
        return gross, flags

    def _learn_step(self, value: float, factor: float) -> None:
        """The last digit of the display, from the most digits it has shown."""
        self._decimals = max(self._decimals, len(f"{value:.9g}".partition(".")[2].partition("e")[0]))
        self.zero.step_N = abs(factor) * 10.0**-self._decimals

    def _stepped(self, force: float, flags: LoadFlag) -> tuple[float, LoadFlag]:
        if math.isnan(force):
            return force, flags
        limit = self._settings.max_step_N
        if limit is not None and abs(force - self._last_force) > limit:
            flags |= LoadFlag.STEP
        self._last_force = force
        return force, flags

    def _see(self, t: float, force: float, flags: LoadFlag) -> None:
        """What a tare may rest on; late readings and lines that are none do not count either way."""
        if flags & BEYOND:
            self.zero.saw(t, math.nan, "in overload")
        elif not math.isnan(force) and LoadFlag.STALE not in flags:
            unfit = "unstable, as the device says" if LoadFlag.UNSTABLE in flags else ""
            self.zero.saw(t, force + self.zero.offset, unfit)

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

    def tared(self) -> None:
        """Zero moved: the next step is none."""
        self._last_force = math.nan


def _last(force: float) -> str:
    return "no valid sample before" if math.isnan(force) else f"last valid sample {force:.6g} N"
