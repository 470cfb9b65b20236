"""From what stood on the line to newtons: units, sign, capacity, plausibility, and the tare (``TareZero``)."""

from __future__ import annotations

import itertools
import math
import statistics
from collections import deque
from collections.abc import Callable

from acquire.errors import ConfigError
from acquire.load_cell import LoadStillness, stillness
from acquire.load_sample import LoadFlag, LoadSample
from acquire.protocols.base import Reading, newtons_per
from acquire.serial_line.settings import SerialSettings
from acquire.text import Message

WINDOW_S, MAX_WINDOW_S = 0.5, 3.0  # of the samples that a tare looks at; of a slow device
KEPT = 4096  # samples
UNDONE = 16  # tares that can be undone

Seen = tuple[float, float, str]  # time, gross force, why it cannot be used

BEYOND = LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD

Report = Callable[[str, str], None]  # level, sentence


class TareZero:
    """The offset that is taken off every force, and the samples that decide whether it may move.

    Attributes
    ----------
    offset : float, N
    step_N : float, N
        Value of the last digit seen.
    """

    def __init__(self) -> None:
        self.offset, self.step_N = 0.0, 0.0
        self._before: deque[float] = deque(maxlen=UNDONE)
        self._seen: deque[Seen] = deque(maxlen=KEPT)

    def saw(self, t: float, gross: float, unfit: str = "") -> None:
        """A sample of ``t``; ``unfit``: why a tare must not rest on it."""
        self._seen.append((t, gross, unfit))

    def why_not(self, now: float) -> str:
        """Why no tare should be made now; "" where the load is still."""
        # Half a second; of a slow device as long as a few samples take.
        last = [t for t, *_ in itertools.islice(reversed(self._seen), 8)]
        steps = [later - earlier for later, earlier in itertools.pairwise(last)]
        window = min(max(WINDOW_S, 3.5 * statistics.median(steps)), MAX_WINDOW_S) if steps else WINDOW_S
        recent = [seen for seen in self._seen if seen[0] >= now - window]
        if not recent:
            return Message("no valid sample in the last {window:.1f} s", window)
        unfit = [why for _, gross, why in recent if why and (math.isnan(gross) or why == recent[-1][2])]
        if unfit:
            return Message(
                "{count} of the {len2} samples of the last {window:.1f} s are {unfit}",
                len(unfit),
                len(recent),
                window,
                unfit[-1],
            )
        found = self._judge(recent)
        if found.n < 3:
            return Message("only {n} samples in the last {window:.1f} s", found.n, window)
        if not found.still:
            moved = max(abs(found.moved_N), found.range_N)
            return Message(
                "the load is not still: it moved by {moved:.4g} N in the last {window:.1f} s", moved, window
            )
        return ""

    def _judge(self, seen: list[Seen]) -> LoadStillness:
        return stillness([t for t, *_ in seen], [gross for _, gross, _ in seen], self.step_N)

    def load(self) -> float:
        """The mean load before the offset, N, of the last valid samples, however old; NaN where there is none."""
        valid = [seen for seen in self._seen if math.isfinite(seen[1])]
        recent = [gross for t, gross, _ in valid if t >= valid[-1][0] - WINDOW_S]
        return math.fsum(recent) / len(recent) if recent else math.nan

    def take(self) -> float:
        """Make that load zero; by how much forces fall from now on, N."""
        return self._move(self.load())

    def undo(self) -> float | None:
        """As before the last tare; by how much forces fall from now on, None where there was no tare."""
        if not self._before:
            return None
        offset = self._before.pop()
        step, self.offset = offset - self.offset, offset
        return step

    def moved_in_device(self) -> float:
        """The device made the present load zero; by how much forces fall from now on, N.

        What was seen is void. An undoing is made here, by what the load was, since the device has none.
        """
        load = self.load()
        step = load - self.offset
        self._before.append(self.offset)
        self._before = deque((before - load for before in self._before), maxlen=UNDONE)
        self.offset = 0.0
        self._seen.clear()
        if math.isnan(load):
            self._before.clear()
        return step

    def _move(self, offset: float) -> float:
        self._before.append(self.offset)
        step, self.offset = offset - self.offset, offset
        return step


class Scaling:
    """Makes samples of readings and reports what is wrong with them, once each time it begins.

    Parameters
    ----------
    settings : SerialSettings
    report : callable taking level and text

    Attributes
    ----------
    zero : TareZero
        What is taken off every force.
    """

    def __init__(self, settings: SerialSettings, report: Report) -> None:
        self._settings, self._report = settings, report
        self._units: dict[str, float | None] = {}
        self._last_unit: str | None = None
        self.zero = TareZero()
        self._last_force = math.nan
        self._alarm = False
        self._decimals = 0

    def sample(self, reading: Reading, t: float, flags: LoadFlag = LoadFlag.NONE) -> LoadSample:
        """The sample of a reading that began at ``t``."""
        unit = reading.unit or self._settings.given.unit or ""
        flags |= reading.flags
        force = reading.value
        if not math.isnan(force):
            gross, flags = self._gross(force, unit, flags)
            force, flags = self._stepped(gross - self.zero.offset, flags)
        # What a tare may rest on; late readings and lines that are none do not count either way.
        if flags & BEYOND:
            self.zero.saw(t, math.nan, Message("in overload"))
        elif not math.isnan(force) and LoadFlag.STALE not in flags:
            unfit = Message("unstable, as the device says") if LoadFlag.UNSTABLE in flags else ""
            self.zero.saw(t, force + self.zero.offset, unfit)
        self._watch(flags, force)
        return LoadSample(t, force, unit, reading.stable, flags, reading.raw, reading.device_ms)

    def _gross(self, value: float, unit: str, flags: LoadFlag) -> tuple[float, LoadFlag]:
        factor = self._newtons(unit)
        if factor is None:
            return math.nan, flags | LoadFlag.ERROR
        # The last digit of the display, from the most digits it has shown.
        self._decimals = max(self._decimals, len(f"{value:.9g}".partition(".")[2].partition("e")[0]))
        self.zero.step_N = abs(factor) * 10.0**-self._decimals
        gross = self._settings.sign * (value - self._settings.zero) * factor
        capacity = self._settings.given.capacity
        if capacity is not None and abs(gross) > capacity:
            flags |= LoadFlag.OUT_OF_RANGE
            if not self._settings.protocol.flags_overload:
                return math.nan, flags | (LoadFlag.OVERLOAD if gross > 0 else LoadFlag.UNDERLOAD)
        return gross, flags

    def _stepped(self, force: float, flags: LoadFlag) -> tuple[float, LoadFlag]:
        if math.isnan(force):
            return force, flags
        limit = self._settings.given.max_step
        if limit is not None and abs(force - self._last_force) > limit:
            flags |= LoadFlag.STEP
        self._last_force = force
        return force, flags

    def _newtons(self, unit: str) -> float | None:
        """Newtons per unit of the line; None, and reported once, where it is unknown."""
        if self._settings.gain is not None:
            return self._settings.gain
        if unit not in self._units:
            self._units[unit] = self._learn(unit)
        if self._last_unit not in (None, unit):
            self._report(
                "warning",
                Message(
                    "the unit on the line changed from {last_unit} to {unit}",
                    self._last_unit,
                    unit or Message("none"),
                ),
            )
        self._last_unit = unit
        return self._units[unit]

    def _learn(self, unit: str) -> float | None:
        try:
            return self.check_unit(unit)
        except ConfigError as error:
            self._report("error", Message("no force from now on: {error}", error))
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
        return newtons_per(unit, self._settings.given.mass_reads_force)

    def _watch(self, flags: LoadFlag, force: float) -> None:
        alarm = bool(flags & (BEYOND | LoadFlag.OUT_OF_RANGE))
        if alarm and not self._alarm:
            words = ", ".join(str(flag.name).lower().replace("_", " ") for flag in flags)
            self._report("error", Message("load alarm: {words}; {last}", words, _last(self._last_force)))
        elif self._alarm and not alarm and not math.isnan(force):
            self._report("info", Message("the load is within its range again"))
        if alarm or not math.isnan(force):
            self._alarm = alarm

    def tared(self) -> None:
        """Zero moved: the next step is none."""
        self._last_force = math.nan


def _last(force: float) -> str:
    return (
        Message("no valid sample before")
        if math.isnan(force)
        else Message("last valid sample {force:.6g} N", force)
    )
