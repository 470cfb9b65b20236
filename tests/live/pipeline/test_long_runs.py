"""Queues and histories of hours, in fast motion: what run, page and display keep grows by little, or not at all.

What is kept of each load sample is its time and force; the time steps wait in a file.
"""

from __future__ import annotations

import tempfile
import tracemalloc
from dataclasses import fields, replace
from typing import NoReturn

import numpy as np
import pytest

from acquire.load_sample import LoadSample
from live.pipeline.history import History
from live.pipeline.latency import LatencyMonitor, LatencySample
from live.pipeline.measurement import ForceMatching, TimeStep
from live.pipeline.run_state import RunState
from live.ui.rerun.messages import ViewSetup
from live.ui.rerun.outbox import Outbox, Pending
from live.ui.rerun.wire import Kind
from live.ui.web.run_panels import CurveHistory
from tests.live.made_up import make_grid, make_measurement

LOAD_HZ = 10
FIRST = make_measurement(0, 1e-3)
STEP = FIRST.time_step
FLOATS = [
    one.name for one in fields(TimeStep) if isinstance(getattr(STEP, one.name), float) and one.name != "t"
]


class Kept:
    """All that is kept of each frame and of each load sample."""

    def __init__(self) -> None:
        self.run_state, self.curve = RunState.new(0.25), CurveHistory(["t", "force", "axial", "exx"])
        self.pending = Pending()
        self.outbox = Outbox(ViewSetup("long", 640, 480, 8, make_grid(), 0.0), self.pending)
        self.matching = ForceMatching(self.run_state.loads)
        self.latency = LatencyMonitor(lambda: 0.0, lambda: None)
        self.matched = 0

    def frame(self, t: float) -> None:
        step = changed(t)
        self.run_state.history.add(step)
        measurement = replace(FIRST, burst=replace(FIRST.burst, t=t), time_step=step)
        self.matched += len(self.matching.add(measurement))
        self.latency.check(LatencySample(t, step.latency_s, step.measure_s), 1.0)
        self.curve.add([t, 1e3 * t, step.exx, step.exx])
        self.pending.row(Kind.MEANS, (t, step.exx, 1e-5, step.eyy, 1e-5, step.exy, 1e-5))
        self.pending.row(Kind.POINTS, (step.exx, 1e3 * t))
        while self.outbox.next(t) is not None:
            pass

    def load(self, t: float) -> None:
        self.run_state.loads.append(LoadSample(t, 1e3 * t))
        self.pending.row(Kind.LOADS, (t, 1e3 * t))


def changed(t: float) -> TimeStep:
    """Every number is another one at each time, as in no test: nothing is saved."""
    return replace(STEP, **{name: k + 1e-6 * t for k, name in enumerate(FLOATS)}, t=t, n_valid=int(t))


@pytest.mark.slow
@pytest.mark.parametrize(("hours", "fps"), [(10, 1), (2, 30)], ids=["1 fps", "30 fps"])
def test_memory_of_hours(hours: float, fps: int) -> None:
    kept, frames, half = Kept(), round(hours * 3600 * fps), 0
    every = max(fps // LOAD_HZ, 1)
    tracemalloc.start()
    try:
        for i in range(frames):
            kept.frame(i / fps)
            if i % every == 0:
                kept.load(i / fps)
            if i == frames // 2:
                half = tracemalloc.get_traced_memory()[0]
        grown = tracemalloc.get_traced_memory()[0] - half
    finally:
        tracemalloc.stop()
    history = kept.run_state.history
    assert len(history.time_steps) == frames, "nothing is thinned that figures are from"
    assert history.column("exx") == pytest.approx(FLOATS.index("exx") + 1e-6 * history.column("t"), rel=1e-12)
    assert history.column("t") == pytest.approx(np.arange(frames) / fps, rel=1e-12)
    # 16 bytes a load sample, in a list that has room for a sixteenth more as it grows; and a block of the history.
    assert grown == pytest.approx(frames / 2 * 1.07 * 16 / every, abs=1024 * 180 + frames)
    assert len(kept.curve.since(-1, 0)["rows"]) <= 4001
    assert kept.pending.dropped == 0
    assert kept.matched + len(kept.matching) == frames and len(kept.matching) <= 2


def test_time_steps_stay_in_memory_where_no_file_can_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(**options: object) -> NoReturn:
        raise OSError("No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    history = History()
    for i in range(5000):
        history.add(changed(i / 7))
    assert history.column("t").tolist() == [i / 7 for i in range(5000)]
    assert history.time_steps[1500].exx == changed(1500 / 7).exx
