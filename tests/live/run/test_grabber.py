"""The grab thread: reference first, then bursts; every frame has one fate."""

from __future__ import annotations

import math

import pytest

from acquire.errors import DeviceError
from acquire.frame import Burst, Frame
from live.measure.reference import Reference, ReferenceTaker
from live.run.grabber import Grabber, GrabPlan
from live.tell import Books
from tests.live.fakes import ListCamera, frame


def grabbed(camera: ListCamera, *, burst: int = 2, reference: int = 4, seconds: float | None = None):
    books, seen = Books.new(0.5), []
    ledger, journal = books.ledger, books.journal
    plan = GrabPlan(burst, reference, math.inf if seconds is None else seconds)
    grabber = Grabber(camera, plan, books, seen.append)
    grabber.start()
    bursts: list[Burst] = []
    while not grabber.bursts.finished:
        item = grabber.bursts.get(1.0)
        if item is not None:
            bursts.append(item)
            ledger.add(measured=item.n)
    grabber.join()
    for item in grabber.bursts.take_skipped():
        ledger.add(skipped=item.n)
    return grabber, bursts, ledger, journal, seen


def test_reference_then_bursts() -> None:
    grabber, bursts, ledger, _, seen = grabbed(ListCamera(frame(i) for i in range(11)))
    reference = grabber.references.get()
    assert (reference.burst.first_index, reference.burst.n) == (0, 4)
    assert reference.halves is not None
    assert [(b.first_index, b.last_index) for b in bursts] == [(4, 5), (6, 7), (8, 9)]
    assert len(seen) == ledger.grabbed == 11
    assert (ledger.reference, ledger.measured, ledger.left_out) == (4, 6, 1)
    assert ledger.adds_up


def test_gaps_and_damage_are_left_out_and_told() -> None:
    frames = [frame(i) for i in range(5)] + [frame(8, lost=3), frame(9), frame(10, damaged=True), frame(11)]
    _, bursts, ledger, journal, _ = grabbed(ListCamera(frames), reference=1)
    assert [(b.first_index, b.last_index) for b in bursts] == [(1, 2), (3, 4), (8, 9)]
    assert ledger.lost == 3
    assert ledger.left_out == 2
    assert ledger.adds_up
    assert any(
        "3 frames were lost, the last before frame 8" in event.text for event in journal.events("warning")
    )


def test_the_end_of_the_time_ends_the_run() -> None:
    _, _, ledger, _, _ = grabbed(ListCamera(frame(i) for i in range(1000)), seconds=2.0)
    assert ledger.grabbed == 21


def test_a_camera_that_dies_is_told_and_kept() -> None:
    camera = ListCamera([frame(0), frame(1)], error=DeviceError("list: is gone; plug it in again"))
    grabber, _, ledger, journal, _ = grabbed(camera, reference=1)
    assert isinstance(grabber.error, DeviceError)
    assert ledger.adds_up
    assert journal.events("error")[0].text == "list: is gone; plug it in again"


def test_a_live_source_never_waits() -> None:
    """Nobody takes the bursts: all but the newest are skipped, and counted."""
    camera = ListCamera((frame(i) for i in range(21)), live=True)
    grabber = Grabber(camera, GrabPlan(2, 1), Books.new(0.5))
    grabber.start()
    grabber.join()
    assert sum(b.n for b in grabber.bursts.take_skipped()) == 18
    last = grabber.bursts.get(0)
    assert last is not None
    assert last.last_index == 20


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 32])
def test_halves_of_a_reference(n: int) -> None:
    taker = ReferenceTaker(n)
    frames: list[Frame] = [frame(i, value=10 if i < n // 2 else 20) for i in range(n)]
    found = [r for f in frames if (r := taker.add(f)) is not None]
    assert len(found) == 1
    reference: Reference = found[0]
    assert reference.burst.n == n
    if n < 4:
        assert reference.halves is None
    else:
        assert reference.halves is not None
        assert [float(h.mean[0, 0]) for h in reference.halves] == [10.0, 20.0]
