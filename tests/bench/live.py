"""``python -m tests.bench --live``: the running program, not the kernel alone, against the clock of a camera.

Each case is a process of its own (``live_case``): pictures from memory, 1280 x 1024 px where nothing else is said,
recording to disk, view served and written, load cell at 80 Hz, 22 s. Skips and latencies count from 2 s after the
first measurement.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any


def _camera(width: int, height: int) -> list[str]:
    """Options of a case with another picture, and the disk measured."""
    return ["--width", str(width), "--height", str(height), "--disk"]


CASES: dict[str, list[str]] = {
    "30 fps, 945 ZOIs": [],
    "the same, 0.3 % saturated": ["--saturated", "0.003"],
    "the same, 12 bits": ["--bits", "12"],
    "the same, a viewer attached": ["--viewer"],
    "30 fps, 4,000 ZOIs of 32 px": ["--zoi", "32", "--step", "17"],
    "60 fps, 285 ZOIs": ["--fps", "60", "--step", "64"],
    "60 fps, burst 4, 945 ZOIs": ["--fps", "60", "--burst", "4"],
    "150 fps, burst 4, 945 ZOIs": ["--fps", "150", "--burst", "4", "--disk"],
    "30 fps, 945 ZOIs, nothing else": ["--bare"],
    "two cameras, 30 fps, burst 2, 400 ZOIs each": [
        *("--two", "--burst", "2", "--roi", "320,192,672,672", "--step", "32", "--seconds", "66")
    ],
    "2448x2048, 75 fps, burst 2, 1,147 ZOIs": [
        *_camera(2448, 2048),
        "--fps",
        "75",
        "--burst",
        "2",
        "--step",
        "65",
    ],
    "4096x3000, 15 fps, 1,230 ZOIs": [*_camera(4096, 3000), "--fps", "15", "--step", "100"],
}


def case(words: list[str]) -> dict[str, Any]:
    """The figures of one case; raises where the run failed."""
    command = [sys.executable, "-m", "tests.bench.live_case", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr[-2000:])
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def shown(found: dict[str, Any]) -> dict[str, Any]:
    """The columns of the table; ``found`` has the case's own settings too, and the disk only where measured."""
    left_out = ("fps", "burst", "bits", "ZOI", "exit code", "disk MB/s")
    return {k: v for k, v in found.items() if k not in left_out} | {"disk MB/s": found.get("disk MB/s", "")}
