"""The check of a load cell before a test: rate, noise, range, flags, and what its lines look like.

``listen`` collects ten seconds, ``report`` judges them. ``stillness`` separates the noise of a load from its
movement; a tare needs it too.
"""

from __future__ import annotations

import dataclasses
import math
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.load_cell.contract import LoadCell
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample
from acquire.text import Message
from acquire.text.quantity import MINUS

MIN_VALUES = 3  # fewer give no noise
ROBUST_VALUES = 12  # values from which a few odd ones do not count

LINES_SHOWN = 5
SLOW_HZ = 5.0
STUCK = 20  # samples without any change


@dataclass(frozen=True, slots=True)
class LoadStillness:
    """Mean, noise and movement of some values of a load.

    Attributes
    ----------
    n : int
    mean_N, noise_N : float, N
        Noise: standard deviation of one value, from second differences, so that neither a drift nor
        a ramp counts. NaN with fewer than three values.
    step_N : float, N
        Resolution of the display: as given, or the least change that was seen in both directions.
    moved_N : float, N
        By how much a straight line through the values rises, with its sign.
    range_N : float, N
    """

    n: int
    mean_N: float
    noise_N: float
    step_N: float
    moved_N: float
    range_N: float

    @property
    def still(self) -> bool:
        """Whether nothing but noise and the last digit moved."""
        if self.n < MIN_VALUES:
            return False
        drift = self.noise_N * max(5 * math.sqrt(12 / self.n), 1) + 2 * self.step_N
        return abs(self.moved_N) <= drift and self.range_N <= 10 * self.noise_N + 3 * self.step_N


def stillness(times: ArrayLike, forces: ArrayLike, step_N: float = 0.0) -> LoadStillness:
    """Judge the values of a load.

    Parameters
    ----------
    times : (N,) float, s
    forces : (N,) float, N
        All finite.
    step_N : float, N
        Resolution of the display, as far as it is known.
    """
    t, f = np.asarray(times, float), np.asarray(forces, float)
    mean, reach = (float(f.mean()), float(np.ptp(f))) if f.size else (math.nan, math.nan)
    if f.size < MIN_VALUES:
        return LoadStillness(f.size, mean, math.nan, step_N, reach, reach)
    second = np.abs(np.diff(f, 2))
    second[second < 1e-9 * np.abs(f).max()] = 0.0  # rounding
    spread = (
        1.4826 * float(np.median(second)) if f.size >= ROBUST_VALUES else math.sqrt(float((second**2).mean()))
    )
    step = max(step_N, _flicker(np.diff(f)), 1e-9 * float(np.abs(f).max()))
    return LoadStillness(f.size, mean, spread / math.sqrt(6), step, _rise(t - t[0], f - mean), reach)


def _flicker(steps: NDArray[np.float64]) -> float:
    """The least change that was seen in both directions: a last digit; a movement has one."""
    up, down = steps[steps > 0], -steps[steps < 0]
    return float(min(up.min(), down.min())) if up.size and down.size else 0.0


def _rise(t: NDArray[np.float64], f: NDArray[np.float64]) -> float:
    """By how much the line of least squares rises from the first value to the last."""
    away = t - t.mean()
    square = float(away @ away)
    return float(away @ f) / square * float(np.ptp(t)) if square > 0 else 0.0


@dataclass(frozen=True, slots=True)
class LoadReport:
    """What was seen.

    Attributes
    ----------
    samples, good : int
        Lines, and those with a value.
    seconds : float, s
        That were listened to.
    rate : float, 1/s
        Of all samples, NaN with fewer than two.
    jitter_s, longest_s : float, s
        Standard deviation and greatest of the intervals; silence before the first value and after the
        last one counts for the greatest.
    silent_s : float, s
        Since the last value.
    unique : int
        Different values.
    step_N : float, N
        Least difference between two values: the resolution of the display.
    lowest_N, highest_N, mean_N, noise_N : float, N
        Noise: standard deviation of one reading from second differences, so that a movement of the
        load does not count.
    moved_N : float, N
        Between the lowest and the highest mean of a tenth of the time.
    of_capacity : float or None
        Greatest force as a part of the capacity.
    flags : tuple of (name, count)
    lines : tuple of bytes
        The last different lines, in their order.
    remarks : tuple of str
        What a person should look into.
    """

    samples: int
    good: int
    seconds: float
    rate: float
    jitter_s: float
    longest_s: float
    silent_s: float
    unique: int
    step_N: float
    lowest_N: float
    highest_N: float
    mean_N: float
    noise_N: float
    moved_N: float
    of_capacity: float | None
    flags: tuple[tuple[str, int], ...]
    lines: tuple[bytes, ...]
    remarks: tuple[str, ...]

    @property
    def ready(self) -> bool:
        """Whether a test can begin with it."""
        return self.good > 0 and not self.remarks

    @property
    def mean_text(self) -> str:
        """The mean in N, to a hundredth of the noise of one reading."""
        if not self.noise_N > 0:
            return Message("{mean:.6g}", self.mean_N)
        digits = min(max(2 - math.floor(math.log10(self.noise_N)), 0), 6)
        return Message(f"{{mean:.{digits}f}}", round(self.mean_N, digits) + 0.0)


@dataclass(frozen=True, slots=True)
class ListenResult:
    """The samples of some seconds.

    Attributes
    ----------
    samples : tuple of LoadSample
    began, ended : float, s
    """

    samples: tuple[LoadSample, ...]
    began: float
    ended: float


def listen(cell: LoadCell, seconds: float) -> ListenResult:
    """The samples of so many seconds; the cell is closed after that."""
    timer = threading.Timer(seconds, cell.stop)
    with cell:
        timer.start()
        began = time.monotonic()
        try:
            samples = tuple(cell)
        finally:
            timer.cancel()
    return _as_of_now(samples, began, time.monotonic())


def _as_of_now(samples: tuple[LoadSample, ...], began: float, ended: float) -> ListenResult:
    """A recording is not of now: its own times are all there is."""
    if samples and not (began - 1 < samples[0].t and samples[-1].t < ended + 1):
        began, ended = samples[0].t, samples[-1].t
    return ListenResult(samples, began, ended)


def report(listened: ListenResult, info: LoadCellInfo) -> LoadReport:
    """The figures of these samples, and remarks."""
    samples = listened.samples
    times = np.array([sample.t for sample in samples])
    steps = np.diff(times)
    good = [sample for sample in samples if not math.isnan(sample.force)]
    forces = np.array([sample.force for sample in good])
    gaps = np.diff([listened.began, *(sample.t for sample in good), listened.ended])
    still = stillness([sample.t for sample in good], forces)
    values = np.unique(forces)
    flags = Counter(str(flag.name).lower() for sample in samples for flag in sample.flags)
    span = float(times[-1] - times[0]) if len(times) > 1 else 0.0
    greatest = float(np.abs(forces).max()) if forces.size else math.nan
    newest = dict.fromkeys(sample.raw for sample in reversed(samples) if sample.raw)
    found = LoadReport(
        samples=len(samples),
        good=len(forces),
        seconds=listened.ended - listened.began,
        rate=len(steps) / span if span > 0 else math.nan,
        jitter_s=float(steps.std()) if steps.size else math.nan,
        longest_s=float(gaps.max()),
        silent_s=float(gaps[-1]),
        unique=len(values),
        step_N=float(np.diff(values).min()) if len(values) > 1 else math.nan,
        lowest_N=float(forces.min()) if forces.size else math.nan,
        highest_N=float(forces.max()) if forces.size else math.nan,
        mean_N=still.mean_N,
        noise_N=still.noise_N,
        moved_N=_moved(good, listened),
        of_capacity=greatest / info.capacity_N if info.capacity_N and forces.size else None,
        flags=tuple(sorted(flags.items())),
        lines=tuple(newest)[:LINES_SHOWN][::-1],
        remarks=(),
    )
    return dataclasses.replace(found, remarks=tuple(_remarks(found, samples, still.step_N)))


def _moved(good: Sequence[LoadSample], listened: ListenResult) -> float:
    """Between the lowest and the highest mean of a tenth of the time, N."""
    tenth = max((listened.ended - listened.began) / 10, 1e-9)
    parts: dict[int, list[float]] = {}
    for sample in good:
        parts.setdefault(int((sample.t - listened.began) / tenth), []).append(sample.force)
    means = [math.fsum(part) / len(part) for part in parts.values()]
    return max(means) - min(means) if means else math.nan


def _remarks(found: LoadReport, samples: Sequence[LoadSample], digit_N: float) -> Iterator[Message]:
    if not samples:
        yield Message(
            "nothing came: check cable, port, baud, and whether the device must be asked (mode=poll)"
        )
        return
    if not found.good:
        yield Message(
            "lines came, but no value: check protocol, baud, parity and column against the lines above"
        )
        return
    bad = sum(LoadFlag.ERROR in sample.flags for sample in samples)
    old = sum(LoadFlag.STALE in sample.flags and not math.isnan(sample.force) for sample in samples)
    beyond = sum(bool(sample.flags & (LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD)) for sample in samples)
    if bad:
        yield Message(
            "{bad} of {samples} lines gave no value: noise on the line, or another grammar",
            bad,
            found.samples,
        )
    if 2 * old > found.good:
        yield Message(
            "{old} of {good} values are of unknown age (STALE): the device should send each line at once, or its "
            "own time with it (millis=)",
            old,
            found.good,
        )
    if beyond:
        yield Message(
            "{beyond} samples in overload or saturated: unload the cell, or check its wiring", beyond
        )
    if found.rate < SLOW_HZ or math.isnan(found.rate):
        yield Message(
            "only {rate:.3g} samples a second: the force at a burst is interpolated over long gaps",
            found.rate,
        )
    usual = 0.25 if math.isnan(found.rate) else max(5 / found.rate, 0.25)
    if found.silent_s > usual:
        yield Message(
            "silence for the last {silent_s:.2f} s: the device stopped sending; power, cable?", found.silent_s
        )
    elif found.longest_s > usual:
        yield Message("a gap of {longest_s:.2f} s: across such gaps the force is not known", found.longest_s)
    if found.moved_N > max(10 * found.noise_N, 5 * digit_N):
        yield Message(
            "the force ran between {lowest} and {highest} N: leave the load still, or look for a drift",
            Message("{force:.6g}", found.lowest_N),
            Message("{force:.6g}", found.highest_N),
        )
    if found.unique == 1 and found.good >= STUCK:
        yield Message("every value is the same: a frozen display, or far too coarse for this load")


def report_lines(found: LoadReport) -> list[str]:
    """The report for a person."""
    lines: list[str] = [
        Message(
            "{samples} samples in {seconds:.1f} s, {good} with a value",
            found.samples,
            found.seconds,
            found.good,
        )
    ]
    if found.good:
        lines += [
            Message(
                "rate     {rate:.4g} 1/s, jitter {jitter_s:.2f} ms, longest gap {longest_s:.0f} ms",
                found.rate,
                found.jitter_s * 1e3,
                found.longest_s * 1e3,
            ),
            Message(
                "force    mean {mean_text} N, from {lowest_N:.6g} to {highest_N:.6g} N",
                found.mean_text.replace(MINUS, "-"),  # as the device sends it, to be compared and typed again
                found.lowest_N,
                found.highest_N,
            )
            + (
                ""
                if found.of_capacity is None
                else Message(" ({of_capacity:.1%} of the capacity)", found.of_capacity)
            ),
            Message(
                "noise    {noise_N:.3g} N (one reading), {unique} different values, step {step_N:.3g} N",
                found.noise_N,
                found.unique,
                found.step_N,
            ),
            Message("moved    {moved_N:.3g} N (means of a tenth of the time)", found.moved_N),
        ]
    lines += [Message("flag     {name}: {count}", name, count) for name, count in found.flags]
    lines += [
        Message("line     {line}", repr(line.decode("ascii", "backslashreplace"))) for line in found.lines
    ]
    return lines + [Message("look     {remark}", remark) for remark in found.remarks]
