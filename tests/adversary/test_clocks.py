"""Clocks that jump, go back, or run for twelve hours; and very large pictures."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest

from acquire.camera import CameraBase
from acquire.clock import ClockPair
from acquire.frame import CameraInfo, Frame, frozen
from acquire.load_cell import open_load_cell
from acquire.session import Session
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.config.loading import load_config
from live.run import live_run as live_module
from live.run.live_run import run_live
from live.run.outcome import Outcome
from live.setup.devices import Rig
from live.ui.terminal.screen import TerminalScreen

SHAPE = (64, 80)
SMALL = {
    "measure.zoi": 32, "measure.step": 16, "measure.reference_burst": 4, "view.enabled": False, "view.rrd": False,
    "camera.address": "stamped:",
}  # fmt: skip


class Stamped(CameraBase):
    """Two still pictures in turn, each frame with the time that ``stamp`` gives its number."""

    def __init__(self, n: int, stamp: Callable[[int], float]) -> None:
        super().__init__()
        noise = np.random.default_rng(1)
        still = 20 + 200 * Speckle(SHAPE, radius=2.0, seed=3).render(Affine(), SHAPE)
        self._images = [frozen(np.rint(still + noise.normal(0, 1, SHAPE)).astype(np.uint8)) for _ in range(2)]
        self._n, self._stamp = n, stamp
        self.info = CameraInfo("stamped:", "stamped", SHAPE[1], SHAPE[0], 8, live=False, clock="device")

    def __iter__(self) -> Iterator[Frame]:
        for k in range(self._n):
            if self.stopped.is_set():
                return
            t = self._stamp(k)
            yield Frame(self._images[k % 2], k, t, "device", 0, 8, t)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    def running(n: int, stamp: Callable[[int], float], **more: Any) -> Outcome:
        def rigs(*arguments: Any) -> list[Rig]:
            return [Rig(Stamped(n, stamp), open_load_cell("none:"), None)]

        monkeypatch.setattr(live_module, "open_rigs", rigs)
        return run_live(
            load_config(None, {**SMALL, "output.dir": str(tmp_path / "out"), **more}),
            TerminalScreen(quiet=True),
        )

    return running


def again(out: Path) -> None:
    """What was measured comes again bit by bit."""
    copy = out.with_name("again")
    assert (
        main(
            ["replay", str(out / "session.h5"), "--as-measured", "--out", str(copy), "--no-view", "--no-rrd"]
        )
        == 0
    )
    with h5py.File(out / "strain.h5") as then, h5py.File(copy / "strain.h5") as now:
        for name in ("exx", "eyy", "status", "time_s"):
            np.testing.assert_array_equal(then["entry/strain"][name][()], now["entry/strain"][name][()])


def times(out: Path) -> list[float]:
    with (out / "strain.csv").open(newline="") as file:
        return [float(row["time_s"]) for row in csv.DictReader(file)]


@pytest.mark.parametrize("jumps", [[3600.0], [-0.5], [-7200.0], [3600.0, -3600.0], [1e9]], ids=str)
def test_a_device_clock_that_jumps_loses_no_frame(
    run: Callable[..., Outcome], tmp_path: Path, jumps: Sequence[float]
) -> None:
    began = time.monotonic()

    def stamp(k: int) -> float:
        return began + k / 10 + sum(jump for number, jump in enumerate(jumps) if k > 20 + 10 * number)

    outcome = run(60, stamp)
    assert outcome.exit_code == 0
    assert outcome.run_state.frame_counts.adds_up
    assert outcome.run_state.frame_counts.recorded == 60
    assert len(times(tmp_path / "out")) == outcome.run_state.frame_counts.measured == 56
    again(tmp_path / "out")


def test_a_system_time_set_back_changes_no_measured_time(
    run: Callable[..., Outcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    began, now = time.monotonic(), datetime.now(UTC)
    told: list[ClockPair] = []

    def set_back() -> ClockPair:
        told.append(ClockPair(time.monotonic(), now - timedelta(days=len(told))))
        return told[-1]

    monkeypatch.setattr(ClockPair, "now", staticmethod(set_back))
    assert run(30, lambda k: began + k / 10).exit_code == 0
    assert np.allclose(np.diff(times(tmp_path / "out")), 0.1)
    with Session.open(tmp_path / "out" / "session.h5") as session:
        assert abs(session.start_utc - now) < timedelta(days=2)
        assert len(session) == 30
    again(tmp_path / "out")


@pytest.mark.parametrize(
    "hours", [pytest.param(3, marks=pytest.mark.slow), pytest.param(12, marks=pytest.mark.slow)]
)
def test_hours_at_one_frame_a_second(run: Callable[..., Outcome], tmp_path: Path, hours: int) -> None:
    """By the stamps of the frames; only the sums of a minute each are recorded and measured."""
    began, frames = time.monotonic(), hours * 3600
    outcome = run(frames + 4, lambda k: began + k, **{"measure.burst": 60, "record.mode": "bursts"})
    assert outcome.exit_code == 0
    frame_counts = outcome.run_state.frame_counts
    assert (frame_counts.grabbed, frame_counts.measured, frame_counts.left_out) == (frames + 4, frames, 0)
    assert frame_counts.adds_up
    seen = times(tmp_path / "out")
    assert len(seen) == 60 * hours
    assert np.allclose(np.diff(seen), 60, atol=1e-6)
    assert len(outcome.run_state.event_log.events()) < 20
    again(tmp_path / "out")


@pytest.mark.slow
def test_twenty_megapixels(tmp_path: Path) -> None:
    shape = (3648, 5472)
    part = 20 + 200 * Speckle((512, 512), radius=2.0, seed=3).render(Affine(), (512, 512))
    # A slow change of the light, so that no place looks like another.
    light = cv2.resize(
        np.random.default_rng(0).uniform(0.6, 1.0, (57, 86)), shape[::-1], interpolation=cv2.INTER_CUBIC
    )
    tile = np.rint(np.tile(part, (8, 11))[: shape[0], : shape[1]] * np.clip(light, 0.5, 1.1)).astype(np.uint8)
    for k in range(2):
        cv2.imwrite(str(tmp_path / f"a{k}.tif"), np.roll(tile, k, axis=1))
    more = ["--zoi", "128", "--step", "512", "--no-view", "--no-rrd", "--out", str(tmp_path / "out")]
    assert main(["replay", str(tmp_path), *more]) == 0
    with h5py.File(tmp_path / "out" / "strain.h5") as file:
        assert np.allclose(file["entry/strain/u"][-1], 1, atol=0.01)
        assert file["entry/strain/u"].shape[1:] == (7, 11)
