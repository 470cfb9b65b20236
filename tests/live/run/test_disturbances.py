"""What disturbs a test is counted, and over within a second; what could be recorded is recorded.

At small scale, with the camera from memory; docs/data/disturbances.csv has what the same did at full scale.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.load_cell.none import NoLoadCell
from acquire.load_sample import LoadSample
from acquire.session import SessionWriter
from live.commands.consumers import standard_consumers
from live.measure import Measurement
from live.outputs import Consumer
from live.run import Outcome, run_live
from live.run import live_run as live_module
from live.setup import load_config
from live.tell import TerminalScreen
from tests.live.test_end_to_end import live_run

FPS = 40.0


class Watch(Consumer):
    """Notes when results came; ``each`` may hold the measuring thread up."""

    blocks = False

    def __init__(self, each: Callable[[Measurement], None]) -> None:
        self._each, self.late = each, list[tuple[float, float]]()

    def measurement(self, measurement: Measurement) -> None:
        self.late.append((measurement.t, measurement.instant.latency_s))
        self._each(measurement)


def disturbed(
    folder: Path,
    each: Callable[[Measurement], None] = lambda m: None,
    **more: Any,
) -> tuple[Outcome, np.ndarray]:
    """A run of four seconds, and time and latency of each result."""
    settings = {
        "camera.address": f"bench:?width=192&height=160&fps={FPS:g}&seconds=4&pictures=8&buffers=64",
        "measure.zoi": 48,
        "measure.step": 32,
        "measure.burst": 1,
        "measure.reference_burst": 8,
        "view.enabled": False,
        "view.rrd": False,
        "output.dir": str(folder / "run"),
        **more,
    }
    watch = Watch(each)
    screen = TerminalScreen(quiet=True)
    outcome = run_live(load_config(None, settings), screen, consumers=standard_consumers(screen, [watch]))
    assert outcome.books.ledger.adds_up
    return outcome, np.array(watch.late)


def recovered(rows: np.ndarray, after: float) -> bool:
    """Whether results were in time again a second after the disturbance ended."""
    later = rows[rows[:, 0] > after + 1.0]
    return len(later) > 5 and float(np.median(later[:, 1])) < 0.2


def test_a_measurement_held_up_skips_and_catches_up(tmp_path: Path) -> None:
    paused: list[float] = []

    def hold(m: Measurement) -> None:
        if m.number == 20:
            time.sleep(0.7)
            paused.append(time.monotonic())

    outcome, rows = disturbed(tmp_path, hold)
    ledger = outcome.books.ledger
    assert ledger.skipped >= 0.5 * FPS
    assert (ledger.unrecorded, ledger.lost) == (0, 0)
    assert ledger.recorded == ledger.grabbed
    assert recovered(rows, paused[0])


@pytest.mark.parametrize(("buffer_MB", "gap"), [(512.0, False), (1.0, True)], ids=["buffer", "no buffer"])
def test_a_slow_disk_is_borne_by_the_buffer_or_leaves_a_counted_gap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, buffer_MB: float, gap: bool
) -> None:
    plain = SessionWriter.write_frame

    def slow(self: SessionWriter, frame: Any) -> Any:
        if frame.index in range(40, 60):
            time.sleep(0.1)  # a quarter of the rate of the camera
        return plain(self, frame)

    monkeypatch.setattr(SessionWriter, "write_frame", slow)
    outcome, rows = disturbed(tmp_path, **{"record.buffer_MB": buffer_MB})
    ledger = outcome.books.ledger
    assert (ledger.unrecorded > 0) is gap
    assert ledger.recorded + ledger.unrecorded == ledger.grabbed
    assert (outcome.exit_code == 5) is gap
    assert ledger.lost == 0
    assert recovered(rows, float(rows[-1, 0]) - 1.5)


class Flood(NoLoadCell):
    """Silent for a second, then ten thousand lines at once."""

    def __iter__(self) -> Iterator[LoadSample]:
        time.sleep(1.0)
        now = time.monotonic()
        yield from (LoadSample(now + 1e-6 * k, float(k), raw=b"+1.0 N") for k in range(10_000))


def test_a_flood_of_load_lines_does_not_hold_up_the_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = live_module.open_rig
    monkeypatch.setattr(
        live_module, "open_rig", lambda *given, **named: replace(opened(*given, **named), load=Flood())
    )
    outcome, rows = disturbed(tmp_path)
    assert outcome.books.ledger.load_samples == 10_000
    assert (outcome.books.ledger.unrecorded, outcome.books.ledger.lost) == (0, 0)
    assert recovered(rows, float(rows[0, 0]) + 1.2)


def test_another_program_on_a_core_loses_no_frame(tmp_path: Path) -> None:
    burn = [sys.executable, "-c", "while True: pass"]
    with subprocess.Popen(burn) as other:
        try:
            outcome, _ = disturbed(tmp_path)
        finally:
            other.kill()
    assert (outcome.books.ledger.unrecorded, outcome.books.ledger.lost) == (0, 0)


def test_frames_that_never_make_a_reference_come_with_a_hint(tmp_path: Path) -> None:
    faults = ",".join(f"drop@{0.4 * k + 0.2:g}" for k in range(10))
    camera = f"sim:uniform?fps=40&width=224&height=192&bits=12&seconds=4&faults={faults}"
    outcome = live_run(tmp_path / "run", camera, **{"measure.reference_burst": 32})
    hints = [e.text for e in outcome.books.journal.events("warning") if e.source == "reference"]
    assert len(hints) == 1 and "no 32 frames in a row" in hints[0] and "--reference-burst" in hints[0]
