"""Queues between threads, the latency monitor, and the priority of threads."""

from __future__ import annotations

import os
import re
import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.system import lower_priority
from live.pipeline import queues
from live.pipeline.latency import KernelWork, LatencyMonitor, LatencySample, ProcessorUse, processor_use
from live.pipeline.queues import BoundedQueue, LatestQueue, Thinned
from tests.live.ui.waiting import LONG_S


def test_newest_wins_and_the_rest_is_counted() -> None:
    box: LatestQueue[int] = LatestQueue()
    for i in range(5):
        box.put(i)
    assert box.get(0) == 4
    assert box.take_skipped() == [0, 1, 2, 3]
    assert box.take_skipped() == []
    assert box.get(0) is None


def test_a_closed_mailbox_gives_what_lies_there() -> None:
    box: LatestQueue[int] = LatestQueue()
    box.put(1)
    box.close()
    assert not box.finished
    assert box.get() == 1
    assert box.finished
    assert box.get() is None
    box.put(2)
    assert box.take_skipped() == [2]


def test_a_waiting_mailbox_skips_nothing() -> None:
    box: LatestQueue[int] = LatestQueue(waits=True)

    def produce() -> None:
        for i in range(200):
            box.put(i)
        box.close()

    thread = threading.Thread(target=produce)
    thread.start()
    taken = []
    while not box.finished:
        item = box.get(1.0)
        if item is not None:
            taken.append(item)
    thread.join()
    assert taken == list(range(200))
    assert box.take_skipped() == []


def test_what_comes_while_the_reader_prepares_waits_for_it() -> None:
    box: LatestQueue[int] = LatestQueue(at_first=3)
    for i in range(5):
        box.put(i)
    assert box.take_skipped() == [0, 1]  # no more than three may wait
    box.begin()
    assert [box.get(0), box.get(0)] == [2, 3]
    box.put(5)
    assert [box.get(0), box.get(0), box.get(0)] == [4, 5, None]  # caught up: from now on the newest
    box.put(6)
    box.put(7)
    assert box.get(0) == 7
    assert box.take_skipped() == [6]


def test_a_reader_who_never_catches_up_goes_on_with_the_newest() -> None:
    box: LatestQueue[int] = LatestQueue(at_first=3)
    box.begin()
    taken = []
    for i in range(0, 40, 2):
        box.put(i)
        box.put(i + 1)
        taken.append(box.get(0))
    assert taken[:2] == [0, 1]
    assert taken[4:] == list(range(9, 40, 2))


def test_a_reader_that_is_little_faster_catches_up_however_many_items_it_takes() -> None:
    """Three items come while it takes four."""
    box: LatestQueue[int] = LatestQueue(at_first=10)
    for i in range(10):
        box.put(i)
    box.begin()
    taken, number = [], 10
    for k in range(30):
        taken.append(box.get(0))
        if k % 4:
            box.put(number)
            number += 1
    assert taken == list(range(30)) and box.take_skipped() == []


def test_a_slow_reader_is_not_kept_in_the_past(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(queues, "time", SimpleNamespace(monotonic=lambda: now[0]))
    box: LatestQueue[int] = LatestQueue(at_first=50)
    for i in range(40):
        box.put(i)
    box.begin()
    assert box.get(0) == 0
    now[0] += queues.CATCH_UP_S
    assert box.get(0) == 1
    now[0] += 0.01
    assert box.get(0) == 39
    assert box.take_skipped() == list(range(2, 39))


def test_a_reader_that_is_late_now_and_then_gets_all() -> None:
    box: LatestQueue[int] = LatestQueue(keeps=3)
    box.begin()
    assert box.get(0) is None
    for late in range(4):
        for i in range(3):
            box.put(3 * late + i)
        assert [box.get(0) for _ in range(3)] == [3 * late, 3 * late + 1, 3 * late + 2]
        assert box.get(0) is None
    assert box.take_skipped() == []


class Simulated:
    """A queue with a reader that takes ``took(t)`` s an item, fed with an item every 0.1 s; no real time."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, keeps: int = 3) -> None:
        self.now, self.number, self.latencies = 0.0, 0, list[float]()
        self.box: LatestQueue[int] = LatestQueue(keeps=keeps)
        clock = SimpleNamespace(monotonic=lambda: self.now)
        monkeypatch.setattr(queues, "time", clock)
        monkeypatch.setattr(self.box, "_change", Waits(self.wait_for))
        self.box.begin()

    def wait_for(self, ready: Any, timeout_s: float) -> None:
        """Time passes until the next item, where none is there."""
        if not ready():
            self.until((self.number + 1) * 0.1)

    def until(self, t: float) -> None:
        """What comes before ``t``, which is then."""
        while (self.number + 1) * 0.1 <= t + 1e-9:
            self.number += 1
            self.box.put(self.number)
        self.now = max(self.now, t)

    def read(self, seconds: float, took: float) -> list[int]:
        """What the reader takes; the latency of each result behind its item."""
        taken, end, self.latencies = [], self.now + seconds, []
        while self.now < end:
            item = self.box.get(1.0)
            assert item is not None
            self.until(self.now + took)
            taken.append(item)
            self.latencies.append(self.now - 0.1 * item)
        return taken


class Waits:
    """A condition of one thread, whose time is simulated."""

    def __init__(self, wait_for: Any) -> None:
        self.wait_for = wait_for

    def __enter__(self) -> None:
        pass

    def __exit__(self, *error: object) -> None:
        pass

    def notify_all(self) -> None:
        pass


@pytest.mark.parametrize("slower", [1.1, 1.3, 2.0, 3.0])
def test_a_reader_that_is_slower_over_a_second_gets_the_newest(
    monkeypatch: pytest.MonkeyPatch, slower: float
) -> None:
    test = Simulated(monkeypatch, keeps=30)
    test.read(1.5, 0.05)
    assert not test.box.newest_only and test.box.take_skipped() == []
    test.read(2.5, 0.1 * slower)
    assert test.box.newest_only and test.box.take_skipped()
    test.read(10.0, 0.1 * slower)
    assert max(test.latencies) <= 0.2 * slower + 1e-9, "at most two of its own times"
    test.read(1.5, 0.05)
    assert not test.box.newest_only, "it has time to spare again"
    test.box.take_skipped()
    test.until(test.now + 0.9)
    test.read(2.0, 0.05)
    assert test.box.take_skipped() == [], "and is waited for again"


def test_a_hiccup_skips_nothing_even_of_a_reader_that_is_hardly_faster(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    test = Simulated(monkeypatch, keeps=4)
    for _ in range(3):
        taken = test.read(3.0, 0.09)
        test.until(test.now + 0.25)
        assert taken == list(range(taken[0], taken[0] + len(taken)))
    test.read(5.0, 0.09)
    assert test.box.take_skipped() == [] and not test.box.newest_only


def test_one_that_stands_gets_the_newest_and_then_all_again(monkeypatch: pytest.MonkeyPatch) -> None:
    test = Simulated(monkeypatch, keeps=3)
    test.read(2.0, 0.05)
    test.until(test.now + 2.0)
    assert test.box.newest_only and len(test.box.take_skipped()) == 19
    test.read(1.0, 0.05)
    assert not test.box.newest_only and test.box.take_skipped() == []


def test_closing_frees_a_waiting_producer() -> None:
    box: LatestQueue[int] = LatestQueue(waits=True)
    box.put(1)
    thread = threading.Thread(target=box.put, args=(2,))
    thread.start()
    box.close()
    thread.join(LONG_S)
    assert not thread.is_alive()
    assert box.take_skipped() == [2]


def test_the_buffer_is_bounded_in_bytes() -> None:
    buffer: BoundedQueue[str] = BoundedQueue(100)
    assert buffer.put("a", 60)
    assert not buffer.put("b", 60)
    assert buffer.put("c", 40)
    assert buffer.put("small", 500, always=True)
    assert buffer.waiting_bytes == 600
    assert [buffer.get(0), buffer.get(0), buffer.get(0), buffer.get(0)] == ["a", "c", "small", None]
    assert buffer.put("large", 1000)  # an empty one takes anything, else it would never be written
    buffer.close()
    assert not buffer.put("late", 1)
    assert buffer.get() == "large"
    assert buffer.finished


def test_what_was_taken_makes_room() -> None:
    buffer: BoundedQueue[int] = BoundedQueue(100)
    assert [buffer.put(i, 40) for i in range(3)] == [True, True, False]
    assert (buffer.get(0), buffer.waiting_bytes) == (0, 40)
    assert [buffer.put(i, 40) for i in (3, 4)] == [True, False]
    assert [buffer.get(0), buffer.get(0), buffer.waiting_bytes] == [1, 3, 0]


def test_a_waiting_buffer_loses_nothing() -> None:
    buffer: BoundedQueue[int] = BoundedQueue(3, waits=True)
    thread = threading.Thread(target=lambda: [buffer.put(i, 1) for i in range(100)] and buffer.close())
    thread.start()
    taken = []
    while not buffer.finished:
        item = buffer.get(1.0)
        if item is not None:
            taken.append(item)
    thread.join()
    assert taken == list(range(100))


PERIOD_S = 1 / 30


def told(latency_s: float, seconds: float = 4.0) -> list[str]:
    """The warnings of some seconds of measurements."""
    pace = LatencyMonitor(lambda: 0.0, lambda: None)
    samples = (LatencySample(k * PERIOD_S, latency_s, 0.01) for k in range(round(seconds * 30)))
    said = [words for one in samples if (words := pace.check(one, PERIOD_S))]
    assert pace.p95_s == pytest.approx(latency_s)
    return said


def test_nothing_is_said_while_all_is_well() -> None:
    assert told(0.04) == []


def test_a_lost_pace_is_told_once_with_its_cause() -> None:
    (warning,) = told(0.1)
    assert "up to 100 ms late (p95), bursts every 33 ms" in warning and "the processor is short" in warning


def test_bursts_that_come_seldom_have_a_latency_and_no_warning() -> None:
    pace = LatencyMonitor(lambda: 0.0, lambda: ProcessorUse(0.0, 0.0, 0.0, 0.0))
    assert [pace.check(LatencySample(2.0 * k, 9.0, 0.01), 2.0) for k in range(20)] == [""] * 20
    assert pace.p95_s == pytest.approx(9.0)


def test_the_bursts_that_waited_for_the_first_result_tell_nothing() -> None:
    pace = LatencyMonitor(lambda: 0.0, lambda: ProcessorUse(0.0, 0.0, 0.0, 0.0))
    late = [max(0.8 - 0.3 * k * PERIOD_S, 0.02) for k in range(150)]
    assert not any(pace.check(LatencySample(k * PERIOD_S, late[k], 0.01), PERIOD_S) for k in range(150))
    assert pace.p95_s < 0.05


def test_it_is_told_again_when_it_lasts() -> None:
    assert len(told(0.1, seconds=68)) == 3


def test_this_machine_says_who_uses_it() -> None:
    before = processor_use()
    assert before is not None
    sum(k * k for k in range(2_000_000))
    after = processor_use()
    assert after is not None
    assert after.own > before.own
    assert after.all >= before.all > 0


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is on Linux only")
def test_a_thread_that_has_just_ended_hides_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    threads = Path.iterdir

    def with_one_gone(folder: Path) -> list[Path]:
        return [folder / "0", *threads(folder)]

    monkeypatch.setattr(Path, "iterdir", with_one_gone)
    assert processor_use() is not None


@pytest.mark.skipif(sys.platform != "linux", reason="threads have a nice value of their own on Linux only")
def test_only_the_calling_thread_becomes_nicer() -> None:
    found: list[int] = []

    def work() -> None:
        lower_priority(3)
        found.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))

    before = os.getpriority(os.PRIO_PROCESS, 0)
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [min(before + 3, 19)]
    assert os.getpriority(os.PRIO_PROCESS, 0) == before


def test_of_what_is_skipped_only_the_brief_is_kept() -> None:
    box: LatestQueue[list[int]] = LatestQueue(at_first=2, brief=lambda item: item[:1])
    for i in range(5):
        box.put([i] * 1000)
    box.begin()
    assert len(box.get(0) or []) == len(box.get(0) or []) == 1000
    box.close()
    box.put([5] * 1000)
    assert box.take_skipped() == [[0], [1], [2], [5]]


def test_a_kernel_that_is_too_slow_is_told_once_with_what_would_keep_up() -> None:
    monitor = LatencyMonitor(lambda: 0.0, lambda: None, KernelWork(64, 16, 2))
    samples = (LatencySample(k * PERIOD_S, 1.5 * PERIOD_S, 1.3 * PERIOD_S) for k in range(3000))
    (told,) = filter(None, (monitor.check(one, PERIOD_S, newest_only=True) for one in samples))
    assert told.endswith(
        "measuring takes 43 ms, so only the newest are measured; --step 21, --zoi 50 or --burst 4 would keep up"
    )
    assert len(told) <= 160


def test_what_is_said_to_keep_up_does() -> None:
    for share in (0.9, 1.3, 2.0, 5.0):
        work = KernelWork(64, 16, 3)
        step, zoi, burst = map(int, re.findall(r"\d+", work.keeping_up(share)))
        assert max((16 / step) ** 2, (zoi / 64) ** 2, 3 / burst) * share <= 0.8 + 1e-9


@given(size=st.integers(2, 30), count=st.integers(0, 500))
def test_evenly_thinned_from_the_first_to_the_newest(size: int, count: int) -> None:
    history: Thinned[int] = Thinned(size)
    for item in range(count):
        history.append(item)
    stride = 2**history.halvings
    assert history.kept == list(range(0, count, stride))
    assert len(history.kept) <= size and (stride == 1 or len(history.kept) > size // 2 - 1)
    items = history.items()
    assert items[-1:] == ([count - 1] if count else []) and len(set(items)) == len(items)
