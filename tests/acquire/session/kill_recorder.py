"""Kills a recording at random moments and looks what is left: the figures of docs/session-format.md.

``python -m tests.acquire.session.kill_recorder [--kills 100] [--fps 100] [--size 512]``
"""

from __future__ import annotations

import argparse
import dataclasses
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquire.clock import ClockPair
from acquire.frame import Frame, frozen
from acquire.load_sample import LoadSample
from acquire.session import Session
from acquire.session.writer import FLUSH_S
from tests.acquire.session.fixtures import CAMERA, writer

LOAD_RATE = 80.0
FLUSH_TAKES_S = 0.02  # and the wait for a core


def picture(number: int, size: int) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    """A picture that tells its number everywhere."""
    rows = (np.arange(size, dtype=np.uint32)[:, None] * 31 + number * 7) & 0xFF
    return np.broadcast_to(rows.astype(np.uint8), (size, size)).copy()


def record(path: str, fps: float, size: int) -> None:
    """The victim: records for ever, and says on stdout what it has finished, and when."""
    camera = dataclasses.replace(CAMERA, bits=8, width=size, height=size)
    with writer(Path(path), camera, start=ClockPair.now()) as session:
        began, samples, number = time.monotonic(), 0, 0
        print("ready", flush=True)
        while True:
            now = time.monotonic()
            while began + samples / LOAD_RATE <= now:
                session.write_load(LoadSample(now, float(samples), raw=b"%d N" % samples))
                print("load", samples, now, flush=True)
                samples += 1
            if began + number / fps <= now:
                image = frozen(picture(number, size))
                session.write_frame(Frame(image, number, now, "host", 0, 8, now))
                print("frame", number, now, flush=True)
                number += 1
            due = time.monotonic() + session.flush_when_due()
            time.sleep(
                max(0.0, min(began + number / fps, began + samples / LOAD_RATE, due) - time.monotonic())
            )


@dataclass(frozen=True, slots=True)
class Remains:
    """What one kill left.

    Attributes
    ----------
    frames, samples : int
        Written by the victim.
    frames_found, samples_found : int
        Of those, in the file and right.
    oldest_missing_s : float, s
        Age at the kill of the oldest frame or sample that is not; 0 where none is missing.
    """

    frames: int
    samples: int
    frames_found: int
    samples_found: int
    oldest_missing_s: float


def kill_once(folder: Path, after_s: float, fps: float, size: int) -> Remains:
    """Start a victim, kill it ``after_s`` after its first word, and look into the file."""
    path = folder / "session.h5"
    command = [sys.executable, "-m", "tests.acquire.session.kill_recorder", "--victim", str(path)]
    command += ["--fps", str(fps), "--size", str(size)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as victim:
        assert victim.stdout is not None
        assert victim.stdout.readline() == "ready\n"
        time.sleep(after_s)
        victim.kill()
        killed = time.monotonic()
        said = [line.split() for line in victim.stdout.read().splitlines() if line.count(" ") == 2]
    frames, samples = (
        {int(number): float(t) for what, number, t in said if what == kind} for kind in ("frame", "load")
    )
    with Session.open(path) as session:
        frames_found = {k for k, frame in enumerate(session.frames()) if _right(frame, k, size)}
        samples_found = {int(sample.force) for sample in session.load_samples()}
    path.unlink()
    missing = [t for k, t in frames.items() if k not in frames_found]
    missing += [t for k, t in samples.items() if k not in samples_found]
    return Remains(
        len(frames),
        len(samples),
        len(frames_found & set(frames)),
        len(samples_found & set(samples)),
        killed - min(missing, default=killed),
    )


def _right(frame: Frame, number: int, size: int) -> bool:
    return frame.index == number and bool(np.array_equal(frame.image, picture(number, size)))


def main() -> int:
    """Kill many times and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--fps", type=float, default=100.0)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--victim")
    arguments = parser.parse_args()
    if arguments.victim:
        record(arguments.victim, arguments.fps, arguments.size)
    rng = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        remains = [
            kill_once(Path(folder), rng.uniform(0.0, 1.5), arguments.fps, arguments.size)
            for _ in range(arguments.kills)
        ]
    oldest = sorted(r.oldest_missing_s * 1e3 for r in remains)
    print(f"{len(remains)} of {arguments.kills} killed recordings readable")
    print(
        f"{sum(r.frames for r in remains)} frames written, {sum(r.frames_found for r in remains)} found right"
    )
    print(f"{sum(r.samples for r in remains)} load samples written, "
          f"{sum(r.samples_found for r in remains)} found")  # fmt: skip
    print(
        f"the oldest that was lost: median {oldest[len(oldest) // 2]:.0f} ms, at most {oldest[-1]:.0f} ms old"
    )
    return oldest[-1] > 1e3 * (FLUSH_S + FLUSH_TAKES_S)


if __name__ == "__main__":
    sys.exit(main())
