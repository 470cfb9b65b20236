"""``python -m tests.bench.disturbances``: what disturbs a test, at full scale; two minutes.

1280 x 1024 px at 30 fps from memory, 945 ZOIs of 64 px, recorded, view served and written, load cell. From the 8th
second on something goes wrong; told are what was skipped, lost and not recorded, and after how many seconds results
were in time (three periods) again. The same at small scale are tests.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acquire.load_cell import LoadCell
from acquire.load_sample import LoadSample
from acquire.session import SessionWriter
from live.commands.consumers import standard_consumers
from live.config.loading import load_config
from live.pipeline.measure import Tracker
from live.pipeline.measurement import Measurement
from live.run import live_run
from live.run.live_run import run_live
from live.ui.terminal.screen import TerminalScreen
from tests.bench.live_case import PORT, Watch, attached
from tests.bench.soak import children, status

assert sys.platform != "win32"  # no SIGSTOP there
BEGIN_S, SECONDS, FPS = 8.0, 24.0, 30.0
IN_TIME_S = 3 / FPS


class Disturbed(Watch):
    """Disturbs once, some seconds after the first measurement; notes when it was over."""

    def __init__(self, disturb: Callable[[], object], *, here: bool = False) -> None:
        super().__init__()
        self._disturb, self._here = disturb, here
        self.over_t = self._begin_t = float("nan")

    def measurement(self, measurement: Measurement) -> None:
        """In the measuring thread."""
        super().measurement(measurement)
        if np.isnan(self._begin_t):
            self._begin_t = measurement.t + BEGIN_S
        if measurement.t >= self._begin_t:
            self._begin_t = float("inf")
            if self._here:
                self._do()
            else:
                threading.Thread(target=self._do, daemon=True).start()

    def _do(self) -> None:
        self._disturb()
        self.over_t = time.monotonic()


def view_process() -> int:
    """The one that draws."""
    for pid in children(os.getpid()):
        if b"live.ui.rerun.drawing" in Path(f"/proc/{pid}/cmdline").read_bytes():
            return pid
    raise RuntimeError(f"no view among {[status(pid)[:1] for pid in children(os.getpid())]}")


def burn(seconds: float = 5.0) -> None:
    """Another program takes a core."""
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as other:
        time.sleep(seconds)
        other.kill()


def stop_viewer(seconds: float = 5.0) -> None:
    """The viewer that takes the view is stopped and goes on."""
    viewers = [pid for pid in children(os.getpid()) if b"--save" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    if not viewers:
        raise RuntimeError("no viewer is attached")
    for order in (signal.SIGSTOP, signal.SIGCONT):
        for pid in viewers:
            os.kill(pid, order)
        time.sleep(seconds if order is signal.SIGSTOP else 0)


class SlowDisk:
    """Half of the rate of the camera, for ten seconds."""

    def __init__(self) -> None:
        self._until = 0.0
        plain = SessionWriter.write_frame

        def slow(writer: SessionWriter, frame: Any) -> Any:
            if time.monotonic() < self._until:
                time.sleep(2 / FPS)
            return plain(writer, frame)

        SessionWriter.write_frame = slow  # type: ignore[method-assign,assignment]

    def __call__(self) -> None:
        self._until = time.monotonic() + 10.0
        time.sleep(10.0)


class FloodedCell:
    """A load cell that gives ten thousand lines more, at once."""

    def __init__(self, cell: LoadCell, told: threading.Event) -> None:
        self._cell, self._told = cell, told

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cell, name)

    def __enter__(self) -> FloodedCell:
        self._cell.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._cell.__exit__(None, None, None)

    def __iter__(self) -> Iterator[LoadSample]:
        for sample in self._cell:
            if self._told.is_set():
                self._told.clear()
                yield from (replace(sample, t=sample.t + 1e-7 * k) for k in range(10_000))
            yield sample


def flood() -> Callable[[], object]:
    """The next rig opened has such a cell."""
    told, opened = threading.Event(), vars(live_run)["open_rigs"]

    def open_flooded(*given: Any) -> Any:
        (rig,) = opened(*given)
        return (replace(rig, load=FloodedCell(rig.load, told)),)

    vars(live_run)["open_rigs"] = open_flooded
    return told.set


def slower(factor: float) -> Disturbed:
    """The kernel of this test takes ``factor`` times as long as from one burst to the next, from the first burst on."""
    plain, rng = Tracker.measure, np.random.default_rng(1)

    def slow(tracker: Tracker, burst: Any) -> Any:
        begin = time.monotonic()
        field = plain(tracker, burst)
        time.sleep(max(0.0, factor * rng.normal(1.0, 0.1) / FPS - (time.monotonic() - begin)))
        return field

    Tracker.measure = slow  # type: ignore[method-assign,assignment]
    return Disturbed(lambda: None)


CASES: dict[str, Callable[[], Disturbed]] = {
    "nothing": lambda: Disturbed(lambda: None),
    "the viewer is stopped for 5 s": lambda: Disturbed(stop_viewer),
    "the view's process is killed": lambda: Disturbed(lambda: os.kill(view_process(), signal.SIGKILL)),
    "the disk at half of the rate for 10 s": lambda: Disturbed(SlowDisk()),
    "10,000 load lines at once": lambda: Disturbed(flood()),
    "the measuring thread stands for 2 s": lambda: Disturbed(lambda: time.sleep(2.0), here=True),
    "another program takes a core for 5 s": lambda: Disturbed(burn),
    "slower than the camera by 1.3": lambda: slower(1.3),
    "slower than the camera by 2": lambda: slower(2.0),
}


def run(name: str, folder: Path) -> dict[str, Any]:
    """One case; what came of it."""
    config = load_config(None, {
        "camera.address": f"bench:?width=1280&height=1024&fps={FPS:g}&seconds={SECONDS:g}&buffers=8",
        "load.address": "sim:?rate=80", "measure.zoi": 64, "measure.step": 35, "measure.burst": 1,
        "view.spawn": False, "view.port": PORT, "output.dir": str(folder / "run"),
    })  # fmt: skip
    watch = CASES[name]()
    with attached(folder) if "viewer" in name else contextlib.nullcontext():
        screen = TerminalScreen(quiet=True)
        outcome = run_live(config, screen, consumers=standard_consumers(screen, [watch]))
    rows, frame_counts = watch.rows(), outcome.run_state.frame_counts
    after = rows[rows[:, 0] > watch.over_t]
    late = after[after[:, 3] > IN_TIME_S]
    return {
        "skipped": frame_counts.skipped, "lost": frame_counts.lost, "not recorded": frame_counts.unrecorded,
        "in time again after s": round(float(late[-1, 0] - watch.over_t), 2) if len(late) else 0.0,
        "p50 ms after it": round(float(np.percentile(after[:, 3], 50)) * 1e3, 1),
        "p95 ms after it": round(float(np.percentile(after[:, 3], 95)) * 1e3, 1),
        "said": [e.text for e in outcome.run_state.event_log.events("warning") if "late (p95)" in e.text],
        "load samples": frame_counts.load_samples, "exit code": outcome.exit_code,
    }  # fmt: skip


def main() -> int:
    """All cases, each in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", choices=CASES)
    case = parser.parse_args().case
    if case:
        with tempfile.TemporaryDirectory(prefix="phasedic-disturbed-") as name:
            print(json.dumps(run(case, Path(name))))
        return 0
    for case in CASES:
        command = [sys.executable, "-m", "tests.bench.disturbances", "--case", case]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        told = done.stdout.splitlines()[-1] if done.returncode == 0 else done.stderr[-1500:]
        print(f"{case}: {told}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
