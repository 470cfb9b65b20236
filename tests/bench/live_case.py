"""One live run with the camera from memory, and what it kept up with: ``python -m tests.bench.live_case --fps 30 ...``.

The run is the program's own (``run_live``): recording to disk, view served and written, load cell at 80 Hz.
Prints one JSON object.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from live.commands.consumers import standard_consumers
from live.config.cameras import camera_configs
from live.config.loading import Config, load_config
from live.pipeline.consumer import Consumer
from live.pipeline.measurement import Measurement
from live.run.live_run import CameraOfTest, run_cameras, run_live
from live.run.outcome import Outcome
from live.ui.rerun.view import url, viewer_binary
from live.ui.terminal.screen import TerminalScreen

PORT = 19_876
SETTLED_S = 2.0
"""Skips and latencies count from so long after the first measurement was there; those before count as at the start."""


class Watch(Consumer):
    """Keeps when each measurement was there."""

    name = "bench"
    blocks = False

    def __init__(self) -> None:
        # Not in memory: a soak watches what grows there.
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - ends with the process

    def measurement(self, measurement: Measurement) -> None:
        i, b = measurement.time_step, measurement.burst
        numbers = (b.t, b.first_index, b.last_index, i.latency_s, i.measure_s, i.n_valid)
        self._file.write(np.array(numbers, np.float64).tobytes())

    def rows(self) -> np.ndarray:
        """All so far, (N, 6)."""
        self._file.seek(0)
        return np.frombuffer(self._file.read()).reshape(-1, 6)


def skipped_share(rows: np.ndarray) -> float:
    """Share of the frames of ``rows`` (N, 6) that lie between measured bursts."""
    frames = rows[-1, 2] - rows[0, 1] + 1
    return float(1 - (rows[:, 2] - rows[:, 1] + 1).sum() / frames)


def disk_MB_s(folder: Path, megabytes: int = 512) -> float:
    """What the disk takes, written in one go and synchronised."""
    block, path = os.urandom(1 << 20), folder / "disk"
    begin = time.perf_counter()
    with path.open("wb") as file:
        for _ in range(megabytes):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
    took = time.perf_counter() - begin
    path.unlink()
    return megabytes * 1.048576 / took


def configured(case: argparse.Namespace, folder: Path) -> Config:
    """The configuration of a run, with a second camera like the first where the case has two."""
    camera = (
        f"bench:?width={case.width}&height={case.height}&fps={case.fps:g}&bits={case.bits}"
        f"&seconds={case.seconds:g}&saturated={case.saturated:g}&buffers=8"
    )
    settings = {
        "camera.address": camera,
        "camera.back": camera if case.two else None,
        "load.address": "none:" if case.bare else "sim:?rate=80",
        "measure.zoi": case.zoi,
        "measure.step": case.step,
        "measure.roi": case.roi,
        "measure.burst": case.burst,
        "record.enabled": not case.bare,
        "view.enabled": not case.bare,
        "view.rrd": not case.bare,
        "view.spawn": False,
        "view.port": PORT,
        "output.dir": str(folder / "run"),
    }
    return load_config(None, {key: value for key, value in settings.items() if value is not None})


def run_both(case: argparse.Namespace, folder: Path) -> list[tuple[Outcome, np.ndarray]]:
    """A run with two cameras, front and back, and the rows of each."""
    screen, watches = TerminalScreen(quiet=not case.loud), dict[str, Watch]()
    sides = {}
    for name, config in camera_configs(configured(case, folder), {}).items():
        watches[name] = Watch()
        sides[name] = CameraOfTest(config, screen, standard_consumers(screen, [watches[name]]))
    outcomes = run_cameras(sides).cameras
    return [(outcome, watches[name].rows()) for name, outcome in outcomes.items()]


def run(case: argparse.Namespace, folder: Path) -> tuple[Outcome, np.ndarray]:
    """The live run, and the rows of its measurements."""
    config, watch = configured(case, folder), Watch()
    with attached(folder) if case.viewer else contextlib.nullcontext():
        screen = TerminalScreen(quiet=not case.loud)
        outcome = run_live(config, screen, consumers=standard_consumers(screen, [watch]))
    return outcome, watch.rows()


@contextlib.contextmanager
def attached(folder: Path) -> Iterator[None]:
    """A viewer's program that takes the whole view over the wire; it draws nothing, as one on another screen."""
    ended, taken = threading.Event(), folder / "taken.rrd"

    def take() -> None:
        while not _is_served() and not ended.wait(0.1):
            pass
        command = [str(viewer_binary()), url(PORT), "--save", str(taken)]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            ended.wait()
            process.terminate()

    thread = threading.Thread(target=take)
    thread.start()
    yield
    ended.set()
    thread.join()
    if not taken.exists() or taken.stat().st_size < 1_000_000:
        raise RuntimeError("the viewer took nothing")


def _is_served() -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", PORT), 0.2):
        return True
    return False


def figures(case: argparse.Namespace, outcome: Outcome, rows: np.ndarray) -> dict[str, Any]:
    late = rows[rows[:, 0] > settled_t(rows)]
    p50, p95 = np.percentile(late[:, 3], (50, 95)) * 1e3
    frame_counts = outcome.run_state.frame_counts
    return {
        "fps": case.fps,
        "burst": case.burst,
        "bits": case.bits,
        "ZOI": case.zoi,
        "ZOIs": int(rows[-1, 5]),
        "skipped %": 100 * skipped_share(late),
        "p50 ms": float(p50),
        "p95 ms": float(p95),
        "kernel ms": float(np.median(late[:, 4])) * 1e3,
        "bursts skipped at the start": skipped_at_start(case, rows),
        "first ms": rows[0, 3] * 1e3,
        "lost in the ring": frame_counts.lost,
        "not recorded": frame_counts.unrecorded,
        "exit code": outcome.exit_code,
    }


def settled_t(rows: np.ndarray) -> float:
    """From when on a run is settled: its own time, s."""
    return float(rows[0, 0] + rows[0, 3] + SETTLED_S)


def skipped_at_start(case: argparse.Namespace, rows: np.ndarray) -> int:
    """Bursts behind the reference (the first 32 frames) that were not measured until it was settled."""
    early = rows[rows[:, 0] < settled_t(rows)]
    missing = early[-1, 2] + 1 - 32 - (early[:, 2] - early[:, 1] + 1).sum()
    return round(missing / case.burst)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=1024)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--burst", type=int, default=1)
    parser.add_argument("--bits", type=int, default=8)
    parser.add_argument("--zoi", type=int, default=64)
    parser.add_argument("--step", type=int, default=35)
    parser.add_argument("--roi", type=lambda text: [int(v) for v in text.split(",")])
    parser.add_argument("--saturated", type=float, default=0.0)
    parser.add_argument("--seconds", type=float, default=22.0)
    parser.add_argument("--bare", action="store_true", help="no recording, view or load cell")
    parser.add_argument("--viewer", action="store_true", help="a viewer takes the view")
    parser.add_argument("--two", action="store_true", help="two such cameras; the worse figure of both")
    parser.add_argument("--disk", action="store_true", help="measure the disk too")
    parser.add_argument("--loud", action="store_true", help="print what the run prints")
    case = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="phasedic-bench-") as name:
        made = run_both(case, Path(name)) if case.two else [run(case, Path(name))]
        each = [figures(case, *one) for one in made]
        found = {key: max(one[key] for one in each) for key in each[0]}
        if case.disk:
            found["disk MB/s"] = disk_MB_s(Path(name))
    print(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
