"""The history of a test: its time steps as columns, and the load axis found from them.

Columns of numbers and texts grow by the hour: their newest blocks are in memory, the others in a temporary file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from acquire.files.block_file import BlockFile
from acquire.load_cell import LoadLog
from acquire.text import Message
from analysis.evaluate import Curve, GaugeValue, LoadAxis, load_axis
from live.pipeline.measurement import AXIAL, TRANSVERSE, TimeStep, extension_along, strains_along
from live.pipeline.queues import Thinned
from live.pipeline.timed.figure import Arrivals

_ROWS = 1024  # of a block


class NumberColumn:
    """Numbers in blocks of ``_ROWS``: the newest two in memory, the others in a file.

    A block of equal numbers takes the memory of one.
    """

    def __init__(self, kind: str, file: BlockFile) -> None:
        self._kind, self._file, self._count = kind, file, 0
        self._blocks: list[NDArray[Any] | int] = []

    def append(self, value: float) -> None:
        at = self._count % _ROWS
        if at == 0:
            self._file_last_but_one()
            self._blocks.append(np.zeros(_ROWS, self._kind))
        block = self._blocks[-1]
        assert not isinstance(block, int)
        block[at] = value
        if at == _ROWS - 1 and block.tobytes() == block[:1].tobytes() * _ROWS:
            self._blocks[-1] = np.broadcast_to(block[0], _ROWS)
        self._count += 1

    def _file_last_but_one(self) -> None:
        """The last one stays, for those that look at the newest time steps."""
        if len(self._blocks) > 1:
            block = self._blocks[-2]
            if not isinstance(block, int) and block.strides != (0,):
                self._blocks[-2] = self._file.put(block)

    def __getitem__(self, i: int) -> Any:  # float or int
        block, at = self._blocks[i // _ROWS], i % _ROWS
        if isinstance(block, int):
            return self._file.get(block + at * np.dtype(self._kind).itemsize, self._kind, 1).item()
        return block.item(at)

    def copied(self, count: int) -> NDArray[np.float64]:
        """The first ``count``, (count,) float64."""
        blocks = (
            self._file.get(one, self._kind, _ROWS) if isinstance(one, int) else one
            for one in list(self._blocks)
        )  # fmt: skip
        return np.concatenate([np.empty(0), *blocks])[:count]


class TextColumn:
    """Texts, each stored once: few of them differ."""

    def __init__(self, file: BlockFile) -> None:
        self._numbers: dict[str, int] = {}
        self._texts: list[str] = []
        self._column = NumberColumn("i", file)

    def append(self, text: str) -> None:
        if text not in self._numbers:
            self._texts.append(text)
            self._numbers[text] = len(self._numbers)
        self._column.append(self._numbers[text])

    def __getitem__(self, i: int) -> str:
        return self._texts[int(self._column[i])]


Array = NDArray[np.float64]

MAX_KEPT = 2000
"""Time steps that ``AxisFinder`` keeps, evenly thinned."""
_GROWTH = 1.1  # of the time steps from one search for the axis to the next
_COUNTS = ("n_valid", "n_zoi", "n_parts")
SHORT = (
    "sigma_exx", "sigma_eyy", "sigma_exy", "sigma_extension_x", "sigma_extension_y", "zoi_sigma", "u", "v", "noise_GL",
    "measure_s", "latency_s", "misfit", "blur", "sigma_blur", "width_s", "sigma_lens_exx", "sigma_lens_eyy",
)  # fmt: skip
"""Numbers of which nobody needs more than seven digits."""
_TYPES = {
    one.name: "i" if one.name in _COUNTS else "f" if one.name in SHORT else "d"
    for one in fields(TimeStep)
    if one.name not in ("refused", "gauges")
}


class TimeSeries(Sequence[TimeStep]):
    """A list that one thread appends to and any thread reads: numbers as columns, each text once.

    A time step takes at most 180 bytes, and 25 more for each gauge, in memory only while it is among the newest; of
    ``sigma`` and the like seven digits are kept.
    """

    def __init__(self) -> None:
        self._file = BlockFile()
        self._numbers = {name: NumberColumn(kind, self._file) for name, kind in _TYPES.items()}
        self._refused = TextColumn(self._file)
        self._gauges: dict[str, _GaugeColumn] = {}
        self._count = 0

    def append(self, time_step: TimeStep) -> None:
        """Add the newest."""
        for name, column in self._numbers.items():
            column.append(getattr(time_step, name))
        self._refused.append(time_step.refused)
        for name in time_step.gauges:
            if name not in self._gauges:
                self._gauges[name] = _GaugeColumn(self._count, self._file)
        for name, gauge in self._gauges.items():
            gauge.append(time_step.gauges.get(name))
        # Counted last: another thread then reads whole time steps only.
        self._count += 1

    def column(self, name: str) -> Array:
        """One number over time, (N,) float64."""
        return self._numbers[name].copied(self._count)

    @property
    def gauges(self) -> tuple[str, ...]:
        """Names of the gauges of the first time step."""
        return tuple(name for name, column in list(self._gauges.items()) if not column.since)

    def gauge(self, name: str) -> Array | None:
        """Values of a gauge, (N,) float64; None where the first time step has none of that name."""
        column = self._gauges.get(name)
        return None if column is None or column.since else column.values.copied(self._count)

    def gauge_sigma(self, name: str) -> Array | None:
        """Standard uncertainties of a gauge, (N,) float64; None as for ``gauge``."""
        column = self._gauges.get(name)
        return None if column is None or column.since else column.sigmas.copied(self._count)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, at: int) -> TimeStep: ...

    @overload
    def __getitem__(self, at: slice) -> list[TimeStep]: ...

    def __getitem__(self, at: int | slice) -> TimeStep | list[TimeStep]:
        if isinstance(at, slice):
            return [self._time_step(i) for i in range(*at.indices(self._count))]
        if not -self._count <= at < self._count:
            raise IndexError(f"time step {at} of {self._count}")
        return self._time_step(at % self._count)

    def __iter__(self) -> Iterator[TimeStep]:
        return (self._time_step(i) for i in range(self._count))

    def _time_step(self, i: int) -> TimeStep:
        numbers: dict[str, Any] = {name: column[i] for name, column in self._numbers.items()}
        values = {name: gauge.at(i) for name, gauge in self._gauges.items()}
        gauges = {name: value for name, value in values.items() if value is not None}
        return TimeStep(**numbers, refused=self._refused[i], gauges=gauges)


class _GaugeColumn:
    """The values of one gauge, which the first ``since`` time steps do not have."""

    def __init__(self, since: int, file: BlockFile) -> None:
        self.since = since
        self.values, self.sigmas = NumberColumn("d", file), NumberColumn("d", file)
        self._shares, self._missing = NumberColumn("f", file), NumberColumn("b", file)
        self._reasons = TextColumn(file)
        for _ in range(since):
            self.append(None)

    def append(self, value: GaugeValue | None) -> None:
        stored = value or GaugeValue(math.nan, math.nan)
        self.values.append(stored.value)
        self.sigmas.append(stored.sigma)
        self._shares.append(stored.share)
        self._reasons.append(stored.reason)
        self._missing.append(value is None)

    def at(self, i: int) -> GaugeValue | None:
        if self._missing[i]:
            return None
        return GaugeValue(self.values[i], self.sigmas[i], self._reasons[i], self._shares[i])


def curve_of(
    column: Callable[[str], Array | None], gauges: Container[str], axis: str, t: Array, stress: Array
) -> Curve:
    """The curve of a test: ``stress`` over its extension, with the strains that E and nu are from, and the blur.

    Parameters
    ----------
    column : callable
        Takes the name of a gauge or of a column of ``TimeStep``; None where there is none.
    gauges : container of str
        Names of the gauges.
    axis : "x" or "y"
        Of the load.
    t, stress : (N,) float64
    """
    axial, transverse = strains_along(gauges, axis)
    elastic, extension = column(axial), column(extension_along(gauges, axis))
    region = Message("{axial} of the region", axial)
    plain = Curve(
        t, _known(elastic, t), stress, column(transverse), lens=column(f"sigma_lens_e{axis}{axis}"), source=region,
        blur=column("blur"),
    )  # fmt: skip
    if axial == AXIAL:
        return replace(plain, source=Message("gauge {name}", AXIAL))
    if extension is None:  # files of before November 2026, with means of the gradients
        return replace(plain, source=Message("mean {axial}", axial))
    if not np.isfinite(extension).any():
        return plain
    across = column(TRANSVERSE if transverse == TRANSVERSE else f"extension_{'x' if axis == 'y' else 'y'}")
    return replace(
        plain,
        strain=extension,
        elastic=elastic,
        uneven=column(f"uneven_{axial}"),
        misfit=column("misfit"),
        narrowing=None if across is None or not np.isfinite(across).any() else across,
        source=Message("extension between strips along {axis}", axis),
        elastic_source=region,
    )


def _known(strain: Array | None, t: Array) -> Array:
    return np.full(len(t), math.nan) if strain is None else strain


class History:
    """All time steps so far: added by one thread, read by any.

    Parameters
    ----------
    axis : "x", "y" or "auto"
        Of the load, as configured.

    Attributes
    ----------
    time_steps : TimeSeries
    arrivals : Arrivals
        Of the measured bursts.
    """

    def __init__(self, axis: str = "y") -> None:
        self.time_steps, self.arrivals, self._finder = TimeSeries(), Arrivals(), AxisFinder(axis)

    def add(self, time_step: TimeStep) -> None:
        """Keep ``time_step``."""
        self.arrivals.add(time_step.t)
        self.time_steps.append(time_step)
        self._finder.add(time_step)

    @property
    def current_axis(self) -> Literal["x", "y"]:
        """Axis of the load: as configured, or as found from the strains so far; y until it is found."""
        return self._finder.axis

    @property
    def axis_assumed(self) -> bool:
        """That axis is neither configured nor found yet."""
        return self._finder.assumed

    @property
    def has_values(self) -> bool:
        """Whether any ZOI had a value at any time step."""
        return bool(self.column("n_valid").any())

    @property
    def ends_with_values(self) -> bool:
        """Whether any ZOI had a value at the last time step."""
        return bool(self.column("n_valid")[-1:].any())

    def column(self, name: str) -> Array:
        """One quantity over time, (N,) float64."""
        return self.time_steps.column(name)

    def forces(self, loads: LoadLog) -> Array:
        """The force at each time step with all samples so far, (N,) float64, N.

        All have the zero of the first time step: a tare in mid-test is no unloading.
        """
        return loads.forces_one_zero(self.column("t").tolist())

    def tared_in_mid_test(self, loads: LoadLog) -> float:
        """What tares after the first time step have subtracted from the force of the last one, N."""
        t = self.column("t")
        return loads.zero_at(t[-1]) - loads.zero_at(t[0]) if t.size else 0.0

    def axis(self, given: str) -> LoadAxis:
        """Axis of the load: "x" or "y" as ``given``, or found from all time steps where that is "auto"."""
        sigma = np.fmax(self.column("sigma_exx"), self.column("sigma_eyy"))
        return load_axis(self.column("exx"), self.column("eyy"), self.column("exy"), given, sigma)

    def curve(self, stress: Array, axis: str) -> Curve:
        """``stress`` (N,) over the extension of the test, with the strains that E and nu are from."""
        chosen = axis if axis in ("x", "y") else self.axis(axis).axis
        return curve_of(self._strain, self.time_steps.gauges, chosen, self.column("t"), stress)

    def along(self, axis: str) -> tuple[Array, Array]:
        """Strain along and across the load: the gauges ``axial`` and ``transverse``, or else of the region."""
        chosen = axis if axis in ("x", "y") else self.axis(axis).axis
        axial, transverse = strains_along(self.time_steps.gauges, chosen)
        return self._strain(axial), self._strain(transverse)

    def _strain(self, name: str) -> Array:
        gauge = self.gauge(name) if name in (AXIAL, TRANSVERSE) else None
        return self.column(name) if gauge is None else gauge

    def gauge(self, name: str) -> Array | None:
        """A gauge over time, (N,) float64; None where there is none of that name."""
        return self.time_steps.gauge(name)


class AxisFinder:
    """Finds the axis of the load from the strains; the same time steps give the same axis, live and in a replay.

    Parameters
    ----------
    given : "x", "y" or "auto"

    Attributes
    ----------
    axis : "x" or "y"
        As given, or as found from the strains; y until it is found.
    assumed : bool
        It is neither given nor found.
    """

    def __init__(self, given: str) -> None:
        self.axis: Literal["x", "y"] = "x" if given == "x" else "y"
        self._seeks = self.assumed = given not in ("x", "y")
        self._strains: Thinned[tuple[float, float, float, float]] = Thinned(MAX_KEPT)
        self._count, self._next = 0, 1
        self._t = -math.inf

    def add(self, time_step: TimeStep) -> Literal["x", "y"]:
        """The axis with one more time step; one that is added twice counts once."""
        if self._seeks and time_step.t > self._t:
            self._t, self._count = time_step.t, self._count + 1
            sigma = max(time_step.sigma_exx, time_step.sigma_eyy)
            self._strains.append((time_step.exx, time_step.eyy, time_step.exy, sigma))
            if self._count >= self._next:
                self._next = math.ceil(self._count * _GROWTH)
                exx, eyy, exy, sigma = np.array(self._strains.kept, np.float64).T
                found = load_axis(exx, eyy, exy, sigma=sigma)
                self.axis, self.assumed = found.axis, found.assumed
        return self.axis
