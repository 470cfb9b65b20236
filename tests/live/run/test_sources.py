"""The grab thread: reference first, then bursts; every frame is counted once, also under disturbances.

The disturbances are at small scale with the camera from memory; docs/data/disturbances.csv has them at full scale.
"""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.burst import SummedBurst
from acquire.errors import DeviceError
from acquire.frame import Frame
from acquire.load_cell.contract import NoLoadCell
from acquire.load_sample import LoadSample
from acquire.session import Session, SessionWriter
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.commands.consumers import standard_consumers
from live.config.loading import load_config
from live.pipeline.consumer import Consumer
from live.pipeline.measurement import Measurement
from live.pipeline.reference import ReferenceBurst, ReferenceTaker
from live.pipeline.run_state import FrameCounts, RunState
from live.run import live_run as live_module
from live.run.live_run import run_live
from live.run.outcome import Outcome
from live.run.sources import CameraSource, GrabPlan
from live.stream.stream import Stream
from live.ui.terminal.screen import TerminalScreen
from tests.live.fakes import ListCamera, frame
from tests.live.streaming import KeptState, Noted
from tests.live.test_end_to_end import live_run


class Grabbed:
    """What a camera has published, to its end."""

    def __init__(
        self, camera: ListCamera, *, burst: int = 2, reference: int = 4, seconds: float | None = None
    ) -> None:
        kept = KeptState()
        noted = {kind: Noted(kept.stream, kind) for kind in (Frame, SummedBurst, ReferenceBurst)}
        self.state, self.counts, self.log = kept.state, kept.state.frame_counts, kept.state.event_log
        plan = GrabPlan(burst, reference, math.inf if seconds is None else seconds)
        self.source = CameraSource(camera, plan, kept.state, kept.stream)
        self.source.start()
        self.source.join()
        self.frames, self.bursts, self.references = (one.bodies() for one in noted.values())
        self.counts.add(measured=sum(one.n for one in self.bursts))


def test_reference_then_bursts() -> None:
    found = Grabbed(ListCamera(frame(i) for i in range(11)))
    (reference,), frame_counts = found.references, found.counts
    assert (reference.burst.first_index, reference.burst.n) == (0, 4)
    assert reference.halves is not None
    assert [(b.first_index, b.last_index) for b in found.bursts] == [(4, 5), (6, 7), (8, 9)]
    assert len(found.frames) == frame_counts.grabbed == 11
    assert (frame_counts.reference, frame_counts.measured, frame_counts.left_out) == (4, 6, 1)
    assert frame_counts.adds_up


def test_gaps_and_damage_are_left_out_and_emit() -> None:
    frames = [frame(i) for i in range(5)] + [frame(8, lost=3), frame(9), frame(10, damaged=True), frame(11)]
    found = Grabbed(ListCamera(frames), reference=1)
    frame_counts, event_log = found.counts, found.log
    assert [(b.first_index, b.last_index) for b in found.bursts] == [(1, 2), (3, 4), (8, 9)]
    assert frame_counts.lost == 4, "a damaged one is lost too"
    assert frame_counts.left_out == 2
    assert frame_counts.adds_up
    assert any(
        "3 frames lost, the last before frame 8" in event.text for event in event_log.events("warning")
    )


def test_the_end_of_the_time_ends_the_run() -> None:
    found = Grabbed(ListCamera(frame(i) for i in range(1000)), seconds=2.0)
    assert found.counts.grabbed == 21 and found.source.time_is_over
    found = Grabbed(ListCamera(frame(i) for i in range(15)), seconds=2.0)
    assert not found.source.time_is_over


def test_the_time_of_a_test_counts_from_its_first_frame() -> None:
    found = Grabbed(ListCamera(frame(i) for i in range(50, 200)), seconds=2.0)
    assert found.counts.grabbed == 21 and found.source.time_is_over


def test_losses_that_were_not_told_are_in_the_next_report() -> None:
    """At most one report in two seconds; 10 frames a second."""
    lost = {5: 1, 9: 2, 30: 3}
    frames = [frame(i, lost=lost.get(i, 0)) for i in range(35)]
    found = Grabbed(ListCamera(frames))
    assert found.counts.lost == 6
    told = [event.data for event in found.log.events("warning")]
    assert told == [{"count": 1, "before": 5}, {"count": 5, "before": 30}]


def test_the_rate_follows_the_frames_by_a_tenth() -> None:
    found = Grabbed(ListCamera(frame(i) for i in (0, 1, 2, 3)))
    assert found.state.health.fps == pytest.approx(10.0)
    found = Grabbed(ListCamera(frame(i) for i in (0, 1, 2, 7)))
    assert found.state.health.fps == pytest.approx(10.0 - 0.1 * 8.0)


def test_a_camera_that_dies_is_told_and_kept() -> None:
    camera = ListCamera([frame(0), frame(1)], error=DeviceError("list: is gone; plug it in again"))
    found = Grabbed(camera, reference=1)
    assert isinstance(found.source.error, DeviceError)
    assert found.counts.adds_up
    assert found.log.events("error")[0].text == "list: is gone; plug it in again"


@pytest.mark.parametrize(("live", "missing"), [(True, 69), (False, 0)])
def test_a_gap_that_is_open_at_the_end_is_counted(
    monkeypatch: pytest.MonkeyPatch, live: bool, missing: int
) -> None:
    """The last frame came 7 s before the end, of a camera with 10 frames a second."""
    now = [100.0]
    monkeypatch.setattr("live.run.sources.time.monotonic", lambda: now[0])
    camera = ListCamera((frame(i) for i in range(4)), live=live)
    camera.info = replace(camera.info, fps=10.0)
    run_state, stream = RunState.new(0.5), Stream()

    def take(record: Any) -> None:
        now[0] += 7.0 if record.body.index == 3 else 0.1

    Noted(stream, Frame, each=take)
    source = CameraSource(camera, GrabPlan(1, 1), run_state, stream)
    source.start()
    source.join()
    assert run_state.frame_counts.lost == missing
    assert run_state.frame_counts.loss is live
    texts = [event.text for event in run_state.event_log.events("warning")]
    assert texts == (["69 frames lost at the end: none came for the last 7.0 s"] if live else [])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 32])
def test_halves_of_a_reference(n: int) -> None:
    taker = ReferenceTaker(n)
    frames: list[Frame] = [frame(i, value=10 if i < n // 2 else 20) for i in range(n)]
    found = [r for f in frames if (r := taker.add(f)) is not None]
    assert len(found) == 1
    reference: ReferenceBurst = found[0]
    assert reference.burst.n == n
    if n < 4:
        assert reference.halves is None
    else:
        assert reference.halves is not None
        assert [float(h.mean[0, 0]) for h in reference.halves] == [10.0, 20.0]


SHAPE = (128, 160)


def shots(folder: Path, places: Sequence[float], seeds: Sequence[int] | None = None) -> Path:
    """Pictures of a pattern that has moved down by each of ``places``, px, each with noise of its own."""
    folder.mkdir()
    noise = np.random.default_rng(0)
    for number, place in enumerate(places):
        speckle = Speckle((400, 400), radius=2.0, seed=3 if seeds is None else seeds[number])
        picture = 20 + 200 * speckle.render(Affine(v=place), SHAPE) + noise.normal(0, 2, SHAPE)
        cv2.imwrite(str(folder / f"a{number:02}.png"), np.clip(np.rint(picture), 0, 255).astype(np.uint8))
    return folder


def run(camera: Path, out: Path) -> int:
    bursts = ["--reference-burst", "4", "--burst", "2", "--zoi", "48", "--step", "24"]
    return main(["run", "--camera", str(camera), *bursts, "--no-view", "--no-rrd", "--out", str(out)])


@pytest.mark.parametrize(
    "speed",
    [0.3, pytest.param(5.0, marks=pytest.mark.slow), pytest.param(20.0, marks=pytest.mark.slow), 37.0],
)
def test_the_reference_is_taken_once_the_picture_is_still(tmp_path: Path, speed: float) -> None:
    fast = [speed * k for k in range(4)]
    assert run(shots(tmp_path / "shots", [*fast, *[fast[-1]] * 26]), tmp_path / "out") == 0
    with Session.open(tmp_path / "out" / "session.h5") as session:
        references = [
            event for event in session.events() if "first" in event.data and "force_N" in event.data
        ]
        assert session.frame_counts is not None
        assert FrameCounts(**{key: session.frame_counts[key] for key in FrameCounts().as_dict()}).adds_up
    assert [event.data["first"] >= 4 for event in references] == [True]


def test_another_pattern_in_every_picture_gives_no_reference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(shots(tmp_path / "shots", [0.0] * 24, range(24)), tmp_path / "out") == 5
    assert "nothing was measured: no reference could be measured" in capsys.readouterr().out
    with Session.open(tmp_path / "out" / "session.h5") as session:
        assert len(session) == 24
        assert session.frame_counts is not None
        assert FrameCounts(**{key: session.frame_counts[key] for key in FrameCounts().as_dict()}).adds_up
        warned = [event for event in session.events() if "cannot be measured" in event.text]
    assert [event.level for event in warned] == ["warning", "warning", "error"]


FPS = 40.0


class Watch(Consumer):
    """Notes when results came; ``each`` may hold the measuring thread up."""

    blocks = False

    def __init__(self, each: Callable[[Measurement], None]) -> None:
        self._each, self.late = each, list[tuple[float, float]]()

    def measurement(self, measurement: Measurement) -> None:
        self.late.append((measurement.t, measurement.time_step.latency_s))
        self._each(measurement)


CAMERA = f"bench:?width=192&height=160&fps={FPS:g}&pictures=8&buffers=64"


def disturbed(
    folder: Path,
    each: Callable[[Measurement], None] = lambda m: None,
    **more: Any,
) -> tuple[Outcome, np.ndarray]:
    """A run of two and a half seconds, and time and latency of each result."""
    settings = {
        "camera.address": CAMERA + "&seconds=2.5",
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
    assert outcome.run_state.frame_counts.adds_up
    return outcome, np.array(watch.late)


def recovered(rows: np.ndarray, after: float) -> bool:
    """Whether results were in time again a second after the disturbance ended."""
    later = rows[rows[:, 0] > after + 1.0]
    return len(later) > 5 and float(np.median(later[:, 1])) < 0.2


@pytest.mark.slow
@pytest.mark.timed
def test_a_measurement_held_up_skips_and_catches_up(tmp_path: Path) -> None:
    paused: list[float] = []

    def hold(m: Measurement) -> None:
        if m.number == 5:
            time.sleep(1.4)
            paused.append(time.monotonic())

    outcome, rows = disturbed(tmp_path, hold, **{"camera.address": CAMERA + "&seconds=4"})
    frame_counts = outcome.run_state.frame_counts
    assert frame_counts.skipped >= 0.35 * FPS, "a second of bursts may wait while the first result is late"
    assert (frame_counts.unrecorded, frame_counts.lost) == (0, 0)
    assert frame_counts.recorded == frame_counts.grabbed
    assert recovered(rows, paused[0])


@pytest.mark.slow
@pytest.mark.timed
@pytest.mark.parametrize(("buffer_MB", "gap"), [(512.0, False), (1.0, True)], ids=["buffer", "no buffer"])
def test_a_slow_disk_is_borne_by_the_buffer_or_leaves_a_counted_gap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, buffer_MB: float, gap: bool
) -> None:
    plain = SessionWriter.write_frame

    def slow(self: SessionWriter, frame: Any) -> Any:
        if frame.index in range(16, 30):
            time.sleep(0.1)  # a quarter of the rate of the camera
        return plain(self, frame)

    monkeypatch.setattr(SessionWriter, "write_frame", slow)
    outcome, rows = disturbed(tmp_path, **{"record.buffer_MB": buffer_MB})
    frame_counts = outcome.run_state.frame_counts
    assert (frame_counts.unrecorded > 0) is gap
    assert frame_counts.recorded + frame_counts.unrecorded == frame_counts.grabbed
    assert (outcome.exit_code == 5) is gap
    assert frame_counts.lost == 0
    assert recovered(rows, float(rows[-1, 0]) - 1.3)


class Flood(NoLoadCell):
    """Silent for a little, then ten thousand lines at once."""

    def __iter__(self) -> Iterator[LoadSample]:
        time.sleep(0.6)
        now = time.monotonic()
        yield from (LoadSample(now + 1e-6 * k, float(k), raw=b"+1.0 N") for k in range(10_000))


@pytest.mark.slow
@pytest.mark.timed
def test_a_flood_of_load_lines_does_not_hold_up_the_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = live_module.open_rigs
    monkeypatch.setattr(
        live_module, "open_rigs", lambda *given: [replace(rig, load=Flood()) for rig in opened(*given)]
    )
    outcome, rows = disturbed(tmp_path)
    assert outcome.run_state.frame_counts.load_samples == 10_000
    assert (outcome.run_state.frame_counts.unrecorded, outcome.run_state.frame_counts.lost) == (0, 0)
    assert recovered(rows, float(rows[0, 0]) + 0.8)


@pytest.mark.slow
@pytest.mark.timed
def test_another_program_on_a_core_loses_no_frame(tmp_path: Path) -> None:
    burn = [sys.executable, "-c", "while True: pass"]
    with subprocess.Popen(burn) as other:
        try:
            outcome, _ = disturbed(tmp_path)
        finally:
            other.kill()
    assert (outcome.run_state.frame_counts.unrecorded, outcome.run_state.frame_counts.lost) == (0, 0)


def test_frames_that_never_make_a_reference_come_with_a_hint(tmp_path: Path) -> None:
    faults = ",".join(f"drop@{0.4 * k + 0.2:g}" for k in range(10))
    camera = f"sim:uniform?fps=40&width=224&height=192&bits=12&seconds=4&lockstep=yes&faults={faults}"
    outcome = live_run(tmp_path / "run", camera, **{"measure.reference_burst": 32})
    hints = [e.text for e in outcome.run_state.event_log.events("warning") if e.source == "reference"]
    assert len(hints) == 1 and "no 32 frames in a row" in hints[0] and "--reference-burst" in hints[0]


def damaged_in(n: int, damaged: range) -> list[Frame]:
    return [replace(frame(k), damaged=k in damaged) for k in range(n)]


@pytest.mark.parametrize(("damaged", "told"), [(range(4, 164), 2), (range(4, 5), 2), (range(0), 0)])
def test_they_are_lost_and_said(damaged: range, told: int) -> None:
    found = Grabbed(ListCamera(damaged_in(170, damaged), live=True), reference=2)
    counts = found.counts
    assert counts.lost == len(damaged) and counts.grabbed == 170
    assert counts.loss is bool(damaged)
    events = found.log.events("warning")
    assert len(events) == told
    if told:
        assert events[0].data["before"] == damaged[0] and events[-1].data["before"] == damaged[-1] + 1
        assert events[-1].data["count"] == len(damaged)


def test_those_that_last_to_the_end_are_said_at_their_begin() -> None:
    found = Grabbed(ListCamera(damaged_in(20, range(10, 20)), live=True), reference=2)
    assert found.counts.lost == 10
    assert [event.data["before"] for event in found.log.events("warning")] == [10]


def test_a_picture_of_another_size_is_a_damaged_one() -> None:
    given = damaged_in(10, range(0))
    given[5] = replace(given[5], image=np.zeros((4, 7), given[5].image.dtype))
    found = Grabbed(ListCamera(given, live=True), reference=2)
    assert found.source.error is None and found.counts.lost == 1
    assert [one.index for one in found.frames if one.damaged] == [5]
    assert found.frames[5].image.shape == given[0].image.shape and not found.frames[5].image.any()
