"""A study of settings: the largest strain and the noise of each (the VSG study of the iDICs guide).

Only the bursts of a still and of a loaded window are measured. Noise increases the largest value of a map; so the
ZOI is chosen in one half of the bursts and its value taken from the other half, minus its value when still, which
removes the noise of the reference.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.frame import Burst
from acquire.text import Amount, Message
from analysis.evaluate import MIN_STILL_INSTANTS, evenly, noise_floor, still_phase
from analysis.picture.pattern import gauge_length, l10_strain
from live.config.loading import Config
from live.pipeline.reference import averaged
from live.replay.source import ReplaySource
from live.results.stored_fields import Readings
from live.setup.pictures import read_mask
from live.setup.prepared import MeasurePlan

if TYPE_CHECKING:
    from analysis.field import StrainField

_LOADED_FORCE = 0.98  # of the highest
MAX_STILL, MAX_LOADED = 8, 6
MIN_STILL, MIN_LOADED = MIN_STILL_INSTANTS, 2

Seconds = tuple[float, float]
Array = NDArray[np.float64]

NO_WINDOW: Seconds = (math.inf, -math.inf)
"""The still window of a test without a still phase."""

KEPT_SHARE = 0.95  # of the largest strain
SIGNIFICANT = 3.0  # sigmas above which a strain is more than noise


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Averaged bursts of both windows, to be measured with many settings.

    Attributes
    ----------
    still, loaded : tuple of Burst
        At least two each; no still ones where there is no still window.
    """

    still: tuple[Burst, ...]
    loaded: tuple[Burst, ...]


def take_windows(source: ReplaySource, still: Seconds | None, loaded: Seconds | None) -> Windows:
    """Read the bursts of both windows, s since the start; None: found from the force; ``NO_WINDOW`` for none.

    Raises
    ------
    DataError
        There are not enough bursts in one, or no force to find it from.
    """
    wanted = (still or still_window(source), loaded or _loaded(source))
    found: tuple[list[Burst], list[Burst]] = ([], [])
    for item in source.bursts:
        if not isinstance(item, Burst):
            raise DataError("the reference was renewed in this session; a study needs one without")
        t = item.t - source.start.monotonic
        for (low, high), bursts in zip(wanted, found, strict=True):
            if low <= t <= high:
                bursts.append(item)
        if t > max(high for _, high in wanted):
            break
    for name, bursts, minimum, (low, high) in zip(
        ("static", "loaded"), found, (MIN_STILL, MIN_LOADED), wanted, strict=True
    ):
        if len(bursts) < minimum and (low, high) != NO_WINDOW:
            raise DataError(
                "{n} bursts from {low:.3g} to {high:.3g} s, {needed} are needed; give --{name} A,B",
                len(bursts),
                low,
                high,
                minimum,
                name,
            )
    return Windows(_spread(found[0], MAX_STILL), _spread(found[1], MAX_LOADED))


def _no_force(option: str) -> DataError:
    return DataError(
        "there is no force to find the still and the loaded window from; give --{option} A,B in seconds",
        option,
    )


def _forces(source: ReplaySource, option: str) -> tuple[np.ndarray, np.ndarray]:
    shown = Readings.of_log(source.loads, late_s=source.start.monotonic).curve
    if not np.isfinite(shown.values).any():
        raise _no_force(option)
    return shown.t, shown.values


def still_window(source: ReplaySource) -> Seconds:
    """The still phase by the force at the bursts, by the rule of report and batch.

    Raises
    ------
    DataError
        There is no force to find it from.
    """
    times = np.zeros(0) if source.times is None else source.times
    count = still_phase(source.loads.forces_one_zero(times.tolist()))
    if not count:
        raise _no_force("static")
    return -math.inf, float(times[count - 1]) - source.start.monotonic


def _loaded(source: ReplaySource) -> Seconds:
    """The time around the highest force in which the force is near it."""
    t, force = _forces(source, "loaded")
    high = np.abs(force) >= _LOADED_FORCE * np.nanmax(np.abs(force))
    top = low = int(np.nanargmax(np.abs(force)))
    while low > 0 and high[low - 1]:
        low -= 1
    while top + 1 < len(t) and high[top + 1]:
        top += 1
    return float(t[low]), float(t[top])


def _spread(bursts: Sequence[Burst], most: int) -> tuple[Burst, ...]:
    """At most ``most`` of them, evenly."""
    return tuple(bursts[row] for row in evenly(len(bursts), most))


@dataclass(frozen=True, slots=True)
class StudySetting:
    """One of the settings tried."""

    zoi: int
    step: int
    order: int
    window: str

    @property
    def words(self) -> str:
        """In a line."""
        return Message(
            "{zoi} px ZOIs, step {step}, order {order}, {window}",
            self.zoi,
            self.step,
            self.order,
            self.window,
        )


@dataclass(frozen=True, slots=True)
class StudyResult:
    """The result of one setting; strains dimensionless.

    Attributes
    ----------
    setting : StudySetting
    noise, predicted : float
        Standard deviation of the strain along the load of one ZOI, over the ZOIs of the still window: measured
        and predicted; both predicted without a still window.
    measured : bool
        Whether there was a still window.
    l10, vsg : float, px
        Period of a strain that has lost 10 %; side of the square with the same noise.
    seen, sigma : float
        Largest strain along the load under load, corrected for noise, and its standard uncertainty.
    gradient : float, 1/px
        Largest difference of neighbours over their distance, in the same way.
    valid : float
        Share of the ZOIs that have a value under load.
    """

    setting: StudySetting
    noise: float
    predicted: float
    l10: float
    vsg: float
    seen: float
    sigma: float
    gradient: float
    valid: float
    measured: bool = True

    @property
    def is_significant(self) -> bool:
        """Whether the strain is larger than its noise."""
        return self.seen >= SIGNIFICANT * self.sigma


@dataclass(frozen=True, slots=True)
class Advice:
    """The recommended setting, and why."""

    found: StudyResult
    why: str


def study(
    source: ReplaySource, windows: Windows, config: Config, settings: Sequence[StudySetting]
) -> Iterator[StudyResult]:
    """Measure both windows with one setting after the other.

    Raises
    ------
    ConfigError, DataError
        As for a replay with such a setting; also where no ZOI has a value in both windows.
    """
    for setting in settings:
        measure = dataclasses.replace(config.measure, **dataclasses.asdict(setting))
        one = dataclasses.replace(config, measure=measure, gauges={})  # none is read
        yield _found(setting, one.specimen.axis, *_fields(source, windows, one))


def _fields(
    source: ReplaySource, windows: Windows, config: Config
) -> tuple[list[StrainField], list[StrainField]]:
    camera = source.camera
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    ready = MeasurePlan.of(config, camera, mask).on(source.reference)

    def measured(bursts: Sequence[Burst]) -> list[StrainField]:
        start, found = None, []
        for burst in map(ready.plan.correct, bursts):
            noise = averaged(ready.noise_GL, burst.n)
            start = ready.kernel.measure(burst.mean, start=start, noise=noise, clipped=burst.clipped)
            found.append(dataclasses.replace(start, measure=cast(Any, config.measure.strain)))
        return found

    return measured(windows.still), measured(windows.loaded)


def _found(
    setting: StudySetting, axis: str, still: list[StrainField], loaded: list[StrainField]
) -> StudyResult:
    name = "exx" if axis == "x" else "eyy"
    pulled = _stacked(loaded, name)
    at_rest = _stacked(still, name) if still else np.zeros((2, *pulled.shape[1:]))
    known = np.isfinite(at_rest).all(0) & np.isfinite(pulled).all(0)
    if known.sum() < 2:
        raise ConfigError(
            "{setting}: fewer than two ZOIs have a value in both windows; leave it out", setting.words
        )
    sigmas = _stacked(still or loaded, f"sigma_{name}")
    predicted = math.sqrt(float(np.mean(sigmas[:, known] ** 2)))
    floor = noise_floor(zip(np.where(known, at_rest, np.nan), sigmas, strict=True)) if still else None
    noise = predicted if floor is None else floor.measured
    first, second = (np.where(known, pulled[k::2].mean(0) - at_rest[k::2].mean(0), np.nan) for k in (0, 1))
    grid = loaded[0].grid
    share = 1 / len(pulled[1::2]) + (1 / len(still[1::2]) if still else 0)
    return StudyResult(
        setting=setting,
        noise=noise,
        predicted=predicted,
        l10=l10_strain(setting.zoi, cast(Any, setting.window)),
        vsg=gauge_length(setting.zoi, cast(Any, setting.window)),
        seen=_largest(first, second),
        sigma=noise * math.sqrt(share),
        gradient=max(_largest(np.diff(first, axis=k), np.diff(second, axis=k)) for k in (0, 1)) / grid.step,
        valid=float(np.isfinite(pulled).all(0).sum() / max(1, grid.n_active)),
        measured=bool(still),
    )


def _stacked(fields: Sequence[StrainField], name: str) -> Array:
    return np.stack([np.asarray(getattr(field, name), np.float64) for field in fields])


def _largest(first: Array, second: Array) -> float:
    """The value of ``second`` where ``first`` has its largest magnitude; 0 without one."""
    if not np.isfinite(first).any():
        return 0.0
    place = np.unravel_index(int(np.nanargmax(np.abs(first))), first.shape)
    return float(max(0.0, np.sign(first[place]) * second[place]))


def _least_noise(kept: int) -> str:
    alone = Message("it alone shows")
    return alone if kept == 1 else Message("it has the least noise of the {n} settings that show", kept)


def recommended(found: Sequence[StudyResult]) -> Advice:
    """The knee: least noise among those that still show the largest strain.

    Raises
    ------
    ConfigError
        No setting shows a strain larger than its noise.
    """
    significant = [one for one in found if one.is_significant]
    if not significant:
        raise ConfigError(
            "no setting shows a strain above its noise: take larger ZOIs (--zoi), or another --loaded window"
        )
    top = max(significant, key=lambda one: one.seen - one.sigma)
    keep = [one for one in significant if one.seen >= KEPT_SHARE * (top.seen - top.sigma)]
    best = min(keep, key=lambda one: one.noise)
    strain = Amount("strain", top.seen)
    why = Message(
        "{what} at least {share:.0%} of the largest strain ({strain}, with {setting})",
        *(_least_noise(len(keep)), KEPT_SHARE, strain, top.setting.words),
    )
    larger = [one for one in significant if one.noise < best.noise]
    if larger:
        nearest = max(larger, key=lambda one: one.seen)
        share = nearest.seen / top.seen
        why += Message("; {setting} has less, but shows {share:.0%}", nearest.setting.words, share)
    sizes = [one.setting.zoi for one in found]
    if best.setting.zoi == max(sizes):
        why += Message("; it is the largest tried, larger ones may do as well")
    elif best.setting.zoi == min(sizes):
        why += Message("; it is the smallest tried, smaller ones may show more")
    return Advice(best, why)
