"""A load cell that is away when the test ends is counted; one that has come to its end is not."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from acquire.errors import DeviceError
from acquire.load_cell.contract import NoLoadCell
from acquire.load_sample import LoadSample
from live.run.sources import LoadSource
from tests.live.streaming import KeptState
from tests.live.ui.waiting import LONG_S


class SilentCell(NoLoadCell):
    """Sends ``count`` samples at 10 a second, and then nothing until it is stopped."""

    def __init__(self, now: list[float], count: int, *, ends: bool = False) -> None:
        self._now, self._count, self._ends = now, count, ends
        self.silent, self._stopped = threading.Event(), threading.Event()

    def __iter__(self) -> Iterator[LoadSample]:
        for _ in range(self._count):
            self._now[0] += 0.1
            yield LoadSample(self._now[0], 1.0)
        self.silent.set()
        if not self._ends:
            self._stopped.wait(LONG_S)

    def stop(self) -> None:
        self._stopped.set()


class SlowCell(SilentCell):
    """Sends 2 a second."""

    def __iter__(self) -> Iterator[LoadSample]:
        for sample in super().__iter__():
            self._now[0] += 0.4
            yield sample


@pytest.mark.parametrize(
    ("kind", "count", "silent_s", "ends", "missing"),
    [
        pytest.param(SilentCell, 21, 4.0, False, 40, id="away at the end"),
        pytest.param(SilentCell, 21, 0.9, False, 0, id="silent for ten periods"),
        pytest.param(SilentCell, 0, 4.0, False, 1, id="never a sample"),
        pytest.param(SilentCell, 21, 4.0, True, 0, id="at its end"),
        pytest.param(SlowCell, 21, 4.9, False, 0, id="slow, silent for ten periods"),
        pytest.param(SlowCell, 21, 5.1, False, 10, id="slow, away"),
    ],
)
def test_samples_that_are_missing_at_the_end(
    monkeypatch: pytest.MonkeyPatch,
    kind: type[SilentCell],
    count: int,
    silent_s: float,
    ends: bool,
    missing: int,
) -> None:
    now, kept = [100.0], KeptState()
    run_state = kept.state
    monkeypatch.setattr(kept.keeper, "_clock", lambda: now[0])
    cell = kind(now, count, ends=ends)
    source = LoadSource(cell, kept.stream)
    kept.keeper.begin()
    source.start()
    assert cell.silent.wait(LONG_S)
    if ends:
        source.join()
    now[0] += silent_s
    kept.keeper.end()
    source.stop()
    source.join()
    counts = run_state.frame_counts
    assert (counts.load_lost, counts.loss) == (missing, missing > 0)
    assert ("load samples lost" in counts.line()) is (missing > 0)
    assert any("the load is missing" in event.text for event in run_state.event_log.events("warning")) is (
        missing > 0
    )


class BrokenCell(NoLoadCell):
    """Sends one sample, and then fails."""

    def __init__(self, error: Exception) -> None:
        super().__init__()
        self._error = error

    def __iter__(self) -> Iterator[LoadSample]:
        yield LoadSample(1.0, 5.0)
        raise self._error


@pytest.mark.parametrize(("error", "code"), [(DeviceError("unplugged"), 3), (ZeroDivisionError("oh"), 1)])
def test_a_load_that_fails_leaves_its_exit_code_and_an_event(error: Exception, code: int) -> None:
    kept = KeptState()
    source = LoadSource(BrokenCell(error), kept.stream)
    source.start()
    source.join()
    assert (kept.keeper.load_failure, kept.state.frame_counts.load_samples) == (code, 1)
    (event,) = kept.state.event_log.events("error")
    assert event.text == f"the load is lost, images go on: {error}"
