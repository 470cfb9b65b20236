"""``python -m tests.bench.soak --minutes 30``: does anything grow in a long run?

The running program as in ``live_case`` (camera from memory, recording, view served and written, load cell), with
the page and a client of the strain output, each read in a process of its own. The recording is rotated and its old
parts are removed here. Every 10 s the memory and the open handles of each of its processes are read from /proc; the
slopes from the sixth minute on are what counts, those of each two minutes show whether it still grows. ``--csv`` keeps
the curve.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from live.commands.consumers import standard_consumers
from live.config.loading import load_config
from live.run.live_run import run_live
from live.ui.terminal.screen import TerminalScreen
from live.ui.web.page_controller import PageController
from tests.bench.live_case import Watch, skipped_share
from tests.live.ui.web.http_page import HttpPage

WARM_S = 300.0
"""Not counted: caches and histories fill."""
LOOK_S, PART_S = 10.0, 120.0
KEPT_PARTS = 2
STRAIN_OUT_PORT = 19_877


@dataclass
class Curve:
    """Time, memory (MiB) and handles of each process, as rows (process, s, MiB, handles)."""

    rows: list[tuple[int, str, float, float, int]] = field(default_factory=list)

    def look(self, begin: float) -> None:
        for pid in (os.getpid(), *children(os.getpid())):
            try:
                words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
                kB = int(next(line for line in status(pid) if line.startswith("VmRSS")).split()[1])
                handles = sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())
            except (OSError, StopIteration):  # it has just ended
                continue
            name = "program" if pid == os.getpid() else b" ".join(words[-2:]).decode()[-40:].strip()
            self.rows.append((pid, name, time.monotonic() - begin, kB / 1024, handles))

    def slopes(self) -> dict[str, dict[str, Any]]:
        """Of each process that lived on after ``WARM_S``: MiB a minute, first and last, handles."""
        out: dict[str, dict[str, Any]] = {}
        for pid in dict.fromkeys(row[0] for row in self.rows):
            mine = [row for row in self.rows if row[0] == pid and row[2] > WARM_S]
            if len(mine) < 3:
                continue
            t, memory = np.array([row[2] for row in mine]), np.array([row[3] for row in mine])
            out[f"{mine[0][1]} ({pid})"] = {
                "MiB a minute": slope(t, memory),
                "MiB a minute in each two": [
                    slope(t[part], memory[part])
                    for since in np.arange(WARM_S, t[-1], PART_S)
                    if (part := (t >= since) & (t < since + PART_S)).sum() > 2
                ],
                "MiB first": round(float(memory[0]), 1),
                "MiB last": round(float(memory[-1]), 1),
                "MiB most": round(float(memory.max()), 1),
                "handles first": mine[0][4],
                "handles last": mine[-1][4],
            }
        return out


def slope(t: np.ndarray, memory: np.ndarray) -> float:
    """Growth per minute, by least squares."""
    return round(float(np.polyfit(t / 60, memory, 1)[0]), 3)


def children(pid: int) -> list[int]:
    """All processes below one."""
    below: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            for line in status(int(entry.name)):
                if line.startswith("PPid:"):
                    below.setdefault(int(line.split()[1]), []).append(int(entry.name))
    found, queue = [], [pid]
    while queue:
        queue += (new := below.get(queue.pop(), []))
        found += new
    return found


def status(pid: int) -> list[str]:
    try:
        return Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return []


def attend(folder: Path, curve: Curve, ended: threading.Event) -> None:
    """Look at the processes, and remove all but the last parts of the recording."""
    begin = time.monotonic()
    while not ended.wait(LOOK_S):
        curve.look(begin)
        parts = sorted(folder.rglob("session*.h5"), key=lambda path: path.stat().st_mtime)
        for old in parts[:-KEPT_PARTS]:
            old.unlink(missing_ok=True)


def read_page(address: str) -> None:
    """As a browser: all events, and the whole curve every ``LOOK_S``."""
    page = HttpPage(address)
    threading.Thread(target=page.read_all, daemon=True).start()
    with contextlib.suppress(OSError):  # the program has ended
        while True:
            page.points()
            time.sleep(LOOK_S)


def read_strain() -> None:
    """A client of the strain output."""
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", STRAIN_OUT_PORT)) as client:
            while client.recv(2**16):
                pass
            return
        time.sleep(0.5)


@contextlib.contextmanager
def beside(target: Callable[..., None], *arguments: str) -> Iterator[None]:
    """A process of its own for ``target``."""
    process = multiprocessing.get_context("spawn").Process(target=target, args=arguments, daemon=True)
    process.start()
    yield
    process.terminate()
    process.join()


def run(case: argparse.Namespace, folder: Path) -> tuple[dict[str, object], Curve]:
    """The long run; what it kept up with and what grew."""
    camera = f"bench:?width={case.width}&height={case.height}&fps={case.fps:g}&seconds={case.minutes * 60:g}&buffers=8"
    config = load_config(None, {
        "camera.address": camera, "load.address": "sim:?rate=80", "measure.zoi": 64, "measure.step": case.step,
        "measure.burst": 1, "record.rotate_MB": 1000.0, "view.spawn": False, "output.dir": str(folder / "run"),
        "strain_out.tcp": str(STRAIN_OUT_PORT),
    })  # fmt: skip
    watch, curve, ended = Watch(), Curve(), threading.Event()
    thread = threading.Thread(target=attend, args=(folder, curve, ended), daemon=True)
    thread.start()
    screen = TerminalScreen(quiet=True)
    with PageController(None) as page, beside(read_page, page.address), beside(read_strain):
        consumers = standard_consumers(screen, [watch, page.begin({"": config})[""]])
        outcome = run_live(config, screen, consumers=consumers, on_start=page.attach)
        ended.set()
        thread.join()
    rows = watch.rows()
    early = rows[(rows[:, 0] > rows[0, 0] + 60) & (rows[:, 0] < rows[0, 0] + WARM_S), 3]
    late = rows[rows[:, 0] > rows[-1, 0] - WARM_S, 3]
    found = {
        "minutes": case.minutes, "picture": f"{case.width} x {case.height}", "ZOIs": int(rows[-1, 5]),
        "skipped %": round(100 * skipped_share(rows), 3),
        "p95 ms of minutes 2 to 5": round(float(np.percentile(early, 95)) * 1e3, 1) if len(early) else None,
        "p95 ms of the last 5": round(float(np.percentile(late, 95)) * 1e3, 1),
        "lost": outcome.run_state.frame_counts.lost, "not recorded": outcome.run_state.frame_counts.unrecorded,
        "MB of strain.h5": round((folder / "run" / "strain.h5").stat().st_size / 1e6),
        "exit code": outcome.exit_code, "processes": curve.slopes(),
    }  # fmt: skip
    return found, curve


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=1024)
    parser.add_argument("--step", type=int, default=34, help="1,008 ZOIs with a picture of 1280 x 1024")
    parser.add_argument("--csv", type=Path)
    case = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="phasedic-soak-") as name:
        found, curve = run(case, Path(name))
    if case.csv:
        lines = ["process,name,s,MiB,handles", *(",".join(map(str, row)) for row in curve.rows)]
        case.csv.write_text("\n".join(lines) + "\n")
    print(json.dumps(found, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
