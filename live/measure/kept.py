"""Instants in little memory: a test of a day has millions of them."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate import GaugeValue
from live.measure.instant import Instant

Array = NDArray[np.float64]
_NUMBERS = tuple(one.name for one in fields(Instant) if one.name not in ("refused", "gauges"))
_COUNTS = ("n_valid", "n_zoi")


class Instants(Sequence[Instant]):
    """A list to which one thread appends and that any may read: numbers as columns, each word once.

    About 200 bytes an instant and 24 more for each gauge.
    """

    def __init__(self) -> None:
        self._numbers = {name: array("d") for name in _NUMBERS}
        self._refused = _Words()
        self._gauges: dict[str, _GaugeColumn] = {}
        self._count = 0

    def append(self, instant: Instant) -> None:
        """Add the newest."""
        for name, kept in self._numbers.items():
            kept.append(getattr(instant, name))
        self._refused.append(instant.refused)
        for name in instant.gauges:
            if name not in self._gauges:
                self._gauges[name] = _GaugeColumn(self._count)
        for name, column in self._gauges.items():
            column.append(instant.gauges.get(name))
        # Counted last: whoever reads meanwhile sees whole instants only.
        self._count += 1

    def column(self, name: str) -> Array:
        """One number over time, (N,) float64."""
        return _copied(self._numbers[name], self._count)

    @property
    def gauges(self) -> tuple[str, ...]:
        """Names of the gauges that the first instant has."""
        return tuple(name for name, column in list(self._gauges.items()) if not column.since)

    def gauge(self, name: str) -> Array | None:
        """Values of a gauge, (N,) float64; None where the first instant has none of that name."""
        column = self._gauges.get(name)
        return None if column is None or column.since else _copied(column.values, self._count)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, at: int) -> Instant: ...

    @overload
    def __getitem__(self, at: slice) -> list[Instant]: ...

    def __getitem__(self, at: int | slice) -> Instant | list[Instant]:
        if isinstance(at, slice):
            return [self._made(i) for i in range(*at.indices(self._count))]
        if not -self._count <= at < self._count:
            raise IndexError(f"instant {at} of {self._count}")
        return self._made(at % self._count)

    def __iter__(self) -> Iterator[Instant]:
        return (self._made(i) for i in range(self._count))

    def _made(self, i: int) -> Instant:
        numbers: dict[str, Any] = {name: kept[i] for name, kept in self._numbers.items()}
        numbers |= {name: int(numbers[name]) for name in _COUNTS}
        asked = {name: column.at(i) for name, column in self._gauges.items()}
        gauges = {name: value for name, value in asked.items() if value is not None}
        return Instant(**numbers, refused=self._refused[i], gauges=gauges)


class _Words:
    """Texts of which few differ."""

    def __init__(self) -> None:
        self._known: dict[str, int] = {}
        self._texts: list[str] = []
        self._which = array("l")

    def append(self, text: str) -> None:
        if text not in self._known:
            self._texts.append(text)
            self._known[text] = len(self._known)
        self._which.append(self._known[text])

    def __getitem__(self, i: int) -> str:
        return self._texts[self._which[i]]


class _GaugeColumn:
    """Of one gauge, which the first ``since`` instants do not have."""

    def __init__(self, since: int) -> None:
        nothing = [math.nan] * since
        self.since = since
        self.values, self._sigmas = array("d", nothing), array("d", nothing)
        self._reasons, self._missing = _Words(), array("b", [1] * since)
        for _ in range(since):
            self._reasons.append("")

    def append(self, value: GaugeValue | None) -> None:
        told = value or GaugeValue(math.nan, math.nan)
        self.values.append(told.value)
        self._sigmas.append(told.sigma)
        self._reasons.append(told.reason)
        self._missing.append(value is None)

    def at(self, i: int) -> GaugeValue | None:
        return None if self._missing[i] else GaugeValue(self.values[i], self._sigmas[i], self._reasons[i])


def _copied(kept: array[float], count: int) -> Array:
    # Of a slice: an array that lends its memory to numpy cannot grow meanwhile.
    return np.frombuffer(kept[:count], np.float64).copy()
