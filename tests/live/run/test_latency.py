"""The latency of a result: from the stamp of the last frame of its burst, on the clock of this machine."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from live.pipeline.latency import LatencyMonitor, LatencySample
from live.run import measurer
from live.run.measurer import Measurer
from tests.live.made_up import START, make_measurement


@pytest.fixture
def thread(monkeypatch: pytest.MonkeyPatch) -> Measurer:
    """One that is not started; half a second has passed since START."""
    monkeypatch.setattr(measurer, "time", SimpleNamespace(monotonic=lambda: START + 0.5))
    nothing: Any = None
    return Measurer(nothing, nothing, nothing, nothing, nothing, nothing)


def test_it_counts_from_the_last_frame(thread: Measurer) -> None:
    """The burst's time is that of its middle, and it took 0.07 s."""
    assert thread._timed(make_measurement(0)).time_step.latency_s == pytest.approx(0.5 - 0.035)


def test_nominal_times_have_none(thread: Measurer) -> None:
    made = make_measurement(0)
    made = replace(made, burst=replace(made.burst, clock="nominal"))
    assert math.isnan(thread._timed(made).time_step.latency_s)


def warnings(
    latency_s: float, period_s: float = 0.1, backlog: float = 0.0, kernel_s: float = 0.01
) -> set[str]:
    """Of 20 s of measurements that come ``latency_s`` late."""
    monitor = LatencyMonitor(lambda: backlog, lambda: None)
    said = {monitor.check(LatencySample(k * period_s, latency_s, kernel_s), period_s) for k in range(200)}
    return said - {""}


def test_a_warning_from_two_periods_on() -> None:
    assert not warnings(0.19)
    assert len(warnings(0.21)) == 1


def test_the_cause_is_named() -> None:
    assert "the disk is too slow" in warnings(0.5, backlog=0.2).pop()
    assert "the kernel needs 90 ms" in warnings(0.5, kernel_s=0.09).pop()
    assert "the processor is short" in warnings(0.5).pop()


@pytest.mark.skipif(sys.platform != "linux", reason="counts threads in /proc")
def test_the_linear_algebra_of_the_program_has_no_threads_of_its_own() -> None:
    code = """
import contextlib, os, live.cli
with contextlib.suppress(SystemExit):
    live.cli.main(["--version"])
import numpy as np
np.ones((500, 500)) @ np.ones((500, 500))
print(len(os.listdir("/proc/self/task")))
"""
    without = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=without, capture_output=True, text=True, check=True
    )
    assert done.stdout.split()[-1] == "1"
