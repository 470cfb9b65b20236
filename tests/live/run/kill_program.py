"""Kills whole runs of phasedic at random moments and checks the files that they leave.

``python -m tests.live.run.kill_program [--kills 100] [--fps 100] [--replay 5]``
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquire.session.reader import Session

START_S = 60.0  # patience with a start on a busy machine
GRACE_S = 0.06  # what is younger at the kill may be missing: 50 ms, and the flush


@dataclass(frozen=True, slots=True)
class Remains:
    """What of one killed run is readable in its file."""

    frames: int
    samples: int
    frame_age_s: float  # of the newest frame at the kill
    sample_age_s: float
    gaps: int  # steps of the index that ``lost_before`` does not account for
    period_s: float  # median interval of frames

    def missing(self, load_period_s: float) -> int:
        """Frames and samples older than the grace that should be there and are not, by their pace."""
        frames = (self.frame_age_s - GRACE_S) / self.period_s - 1
        samples = (self.sample_age_s - GRACE_S) / load_period_s - 1
        return max(0, int(frames)) + max(0, int(samples)) + self.gaps


def command(folder: Path, fps: float) -> list[str]:
    """A headless run on the simulated rig, longer than anybody lets it live."""
    camera = f"sim:?width=256&height=256&bits=8&fps={fps:g}&seconds=120"
    measure = ["--zoi", "32", "--step", "32", "--reference-burst", "4", "--burst", "8"]
    phasedic = [sys.executable, "-m", "live.cli", "run"]
    return [
        *phasedic,
        "--camera",
        camera,
        "--load",
        "sim:",
        "--no-view",
        "--no-rrd",
        *measure,
        "--out",
        str(folder),
    ]


def kill_once(folder: Path, after_s: float, fps: float) -> Remains:
    """Start a run, kill it ``after_s`` after its recording has begun, and read what is left."""
    path = folder / "session.h5"
    with subprocess.Popen(command(folder, fps), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
        until = time.monotonic() + START_S
        while not (path.exists() and path.stat().st_size > 2_000_000) and time.monotonic() < until:
            time.sleep(0.02)
        time.sleep(after_s)
        run.kill()
        killed = time.monotonic()
    if not path.exists():
        raise RuntimeError(f"{' '.join(command(folder, fps))} did not begin to record within {START_S:g} s")
    return look(path, killed)


def look(path: Path, killed: float) -> Remains:
    """Read every frame and sample of a killed run."""
    with Session.open(path) as session:
        frames = list(session.frames())
        samples = session.load_samples()
        steps = np.diff([frame.index for frame in frames]) - 1
        told = np.array([frame.lost_before for frame in frames[1:]])
        return Remains(
            frames=len(frames),
            samples=len(samples),
            frame_age_s=killed - frames[-1].t,
            sample_age_s=killed - samples[-1].t,
            gaps=int(np.sum(steps != told)),
            period_s=float(np.median(np.diff([frame.t for frame in frames]))),
        )


def replays(path: Path, out: Path) -> bool:
    """Whether ``phasedic replay`` takes the file as it is."""
    replay = [sys.executable, "-m", "live.cli", "replay", str(path), "--out", str(out)]
    return subprocess.run(replay, capture_output=True, timeout=300).returncode in (0, 5)


def main() -> int:
    """Kill many times and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--fps", type=float, default=100.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--replay", type=int, default=5, help="how many of the files are replayed too")
    arguments = parser.parse_args()
    rng, remains, replayed = random.Random(arguments.seed), [], 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(arguments.kills):
            run = Path(folder) / f"{number}"
            remains.append(kill_once(run, rng.uniform(0.0, 1.5), arguments.fps))
            print(remains[-1], flush=True)
            if number < arguments.replay:
                replayed += replays(run / "session.h5", run / "again")
            (run / "session.h5").unlink()
    missing = [r.missing(1 / 80) for r in remains]
    print(
        f"{len(remains)} runs killed, all readable;"
        f" {sum(m == 0 for m in missing)} complete to within {GRACE_S * 1e3:.0f} ms"
    )
    print(f"{sum(r.frames for r in remains)} frames and {sum(r.samples for r in remains)} load samples read;"
          f" newest frame at most {max(r.frame_age_s for r in remains) * 1e3:.0f} ms old at the kill")  # fmt: skip
    print(f"{replayed} of {min(arguments.replay, len(remains))} replayed")
    return int(any(missing))


if __name__ == "__main__":
    sys.exit(main())
