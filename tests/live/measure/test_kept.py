"""Instants as columns: what goes in comes out, in little memory."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import fields, replace

import numpy as np
import pytest

from analysis.evaluate import GaugeValue
from live.measure import History, Instant

NUMBERS = [one.name for one in fields(Instant) if one.name not in ("refused", "gauges")]


def some(i: int) -> Instant:
    numbers = {name: (i * 31 + k) if name.startswith("n_") and "noise" not in name else i * 0.37 + k
               for k, name in enumerate(NUMBERS)}  # fmt: skip
    gauges = {
        "axial": GaugeValue(i * 1e-5, 1e-6),
        "hole": GaugeValue(math.nan, math.nan, f"{i % 3} ZOIs lost"),
    }
    return Instant(**numbers, refused=f"{i % 4} LOST", gauges=gauges)


def test_what_goes_in_comes_out() -> None:
    history, put = History(), [some(i) for i in range(40)]
    for instant in put:
        history.add(instant)
    assert len(history.instants) == 40
    assert [repr(instant) for instant in history.instants] == [repr(instant) for instant in put]
    assert repr(history.instants[-1]) == repr(put[-1]) and isinstance(history.instants[-1].n_zoi, int)
    assert repr(history.instants[3:9:2]) == repr(put[3:9:2])
    for name in NUMBERS:
        assert np.array_equal(history.column(name), [getattr(instant, name) for instant in put])
    axial = history.gauge("axial")
    assert axial is not None and np.array_equal(axial, [i * 1e-5 for i in range(40)])
    for beyond in (40, -41):
        with pytest.raises(IndexError):
            history.instants[beyond]


def test_a_gauge_that_comes_and_goes() -> None:
    history, late = History(), {"late": GaugeValue(1.0, 0.1)}
    for gauges in ({}, late, {}):
        history.add(replace(some(0), gauges=gauges))
    assert [dict(instant.gauges) for instant in history.instants] == [{}, late, {}]
    assert history.gauge("late") is None, "the first instant has none of that name"


def test_the_columns_grow_while_they_are_read() -> None:
    history = History()
    history.add(some(0))
    column, axial = history.column("t"), history.gauge("axial")
    history.add(some(1))
    assert column.size == 1 and axial is not None and axial.size == 1


def test_little_memory() -> None:
    history = History()
    tracemalloc.start()
    for i in range(20_000):
        history.add(some(i))
    grown = tracemalloc.get_traced_memory()[0] / 20_000
    tracemalloc.stop()
    assert grown < 320, "bytes an instant with two gauges"
