"""Tare as an order: never by one key under load in mid-test."""

from __future__ import annotations

import math

import pytest

from acquire.events import EventKind, Level
from acquire.load_sample import LoadCellInfo, LoadSample
from live.operate import FORCED, UNDO, OrderRefused, TareOrders


class FakeCell:
    """Notes what it is asked."""

    def __init__(self, capacity_N: float | None, protocol: str = "ascii") -> None:
        self.info = LoadCellInfo("/dev/x", "a cell", protocol, capacity_N=capacity_N)
        self.calls: list[str] = []

    def tare(self, *, force: bool = False) -> None:
        self.calls.append("forced" if force else "tare")

    def undo_tare(self) -> None:
        self.calls.append("undo")


class Bench:
    """Orders on a cell that shows a force; ``measured`` says whether the test is on."""

    def __init__(
        self, force: float = 800.0, *, measured: bool = True, capacity_N: float | None = None
    ) -> None:
        self.now, self.cell, self.told = 10.0, FakeCell(capacity_N), list[tuple[EventKind, Level, str]]()
        sample = LoadSample(10.0, force)
        self.orders = TareOrders(self.cell, lambda: measured, lambda: sample, self._tell, lambda: self.now)

    def _tell(self, kind: EventKind, source: str, text: str, level: Level) -> None:
        self.told.append((kind, level, text))

    def refused(self) -> str:
        """Why an order to tare is not carried out."""
        with pytest.raises(OrderRefused) as refused:
            self.orders.order()
        return str(refused.value)


def test_under_load_in_mid_test_it_takes_two() -> None:
    bench = Bench()
    assert "800 N in mid-test" in bench.refused() and bench.cell.calls == [] and not bench.told
    bench.now += 2.9
    bench.orders.order()
    assert bench.cell.calls == ["tare"] and bench.told[-1][0] is EventKind.TARE


def test_a_late_second_order_is_a_first_one() -> None:
    bench = Bench()
    for _ in range(4):
        bench.refused()
        bench.now += 3.1
    assert bench.cell.calls == []


def test_a_third_order_asks_again() -> None:
    bench = Bench()
    bench.refused()
    bench.orders.order()
    bench.refused()
    assert bench.cell.calls == ["tare"]


@pytest.mark.parametrize(("force", "capacity_N"), [(0.0, None), (0.9, 1000.0)])
def test_without_load_one_order_is_enough(force: float, capacity_N: float | None) -> None:
    bench = Bench(force, capacity_N=capacity_N)
    bench.orders.order()
    assert bench.cell.calls == ["tare"]


def test_before_the_test_one_order_is_enough() -> None:
    bench = Bench(measured=False)
    bench.orders.order()
    assert bench.cell.calls == ["tare"]


def test_a_load_that_is_not_known_is_not_none() -> None:
    bench = Bench(math.nan)
    assert "an unknown load" in bench.refused() and bench.cell.calls == []


def test_without_a_load_cell_there_is_nothing_to_tare() -> None:
    bench = Bench()
    bench.cell = FakeCell(None, "none")
    bench.orders = TareOrders(bench.cell, lambda: False, lambda: None, bench._tell, lambda: bench.now)
    assert "no load cell" in bench.refused()


def test_forced_and_undone_at_once() -> None:
    bench = Bench()
    bench.orders.order(FORCED)
    bench.orders.order(UNDO)
    assert bench.cell.calls == ["forced", "undo"]
    assert [kind for kind, *_ in bench.told] == [EventKind.TARE] * 2


def test_an_undoing_is_no_confirmation() -> None:
    bench = Bench()
    bench.refused()
    bench.orders.order(UNDO)
    bench.refused()
    assert bench.cell.calls == ["undo"]
