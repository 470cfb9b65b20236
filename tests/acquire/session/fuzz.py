"""Damages session files in many ways and looks what reading them does.

``python -m tests.acquire.session.fuzz [--cases 300] [--seed 0]`` prints how often each end was reached.
A worker process reads; where it hangs or dies the case is told and kept.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.session import Session
from tests.acquire.session.fixtures import frame, sample, writer

FRAMES = 8
PATIENCE_S = 90.0  # the reader's own patience with a child is shorter

Damage = Callable[[bytearray, random.Random], bytearray]


def _flip(content: bytearray, rng: random.Random) -> bytearray:
    for _ in range(rng.choice([1, 1, 8])):
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    return content


def _header(content: bytearray, rng: random.Random) -> bytearray:
    for _ in range(3):
        content[rng.randrange(4096)] = rng.randrange(256)
    return content


def _zeros(content: bytearray, rng: random.Random) -> bytearray:
    at = rng.randrange(len(content))
    end = min(at + 512, len(content))
    content[at:end] = bytes(end - at)
    return content


def _cut(content: bytearray, rng: random.Random) -> bytearray:
    return content[: rng.randrange(len(content))]


DAMAGES: dict[str, Damage] = {"flip": _flip, "header": _header, "zeros": _zeros, "cut": _cut}


def whole_session(path: Path, *, abandoned: bool = False) -> bytes:
    """The bytes of a session of some frames, samples, events and a ledger; or as a kill leaves it."""
    with writer(path) as session:
        for k in range(FRAMES):
            session.write_load(sample(k))
            session.write_frame(frame(k))
            session.write_event(Event(1001.0, EventKind.NOTE, "operator", "x" * 300))
        session.write_ledger({"grabbed": FRAMES})
        session.flush()
        if abandoned:
            return path.read_bytes()
    return path.read_bytes()


def damaged(content: bytes, seed: int) -> tuple[str, bytes]:
    """The kind of damage of case ``seed``, and the damaged bytes."""
    rng = random.Random(seed)
    kind = rng.choice(list(DAMAGES))
    return kind, bytes(DAMAGES[kind](bytearray(content), rng))


def outcome(path: Path) -> str:
    """What reading gives: "refused", "right", "a part, with an error", or "WRONG"."""
    try:
        with Session.open(path) as session:
            wrong = any(not _right(session, number) for number in range(len(session)))
            session.load_samples(), session.events(), session.frame_counts, session.clock_pairs
            short = len(session) != FRAMES
    except DataError:
        return "refused"
    return "WRONG" if wrong else "fewer frames" if short else "right"


def _right(session: Session, number: int) -> bool:
    found = session.frame(number)
    return bool(np.array_equal(found.image, frame(number).image)) and found.t == frame(number).t


def work() -> None:
    """The worker: a path comes in a line, an outcome goes out."""
    for line in sys.stdin:
        print(outcome(Path(line.strip())), flush=True)


class Worker:
    """A process that reads files, replaced when it dies or hangs."""

    def __init__(self) -> None:
        self._process = self._start()

    def _start(self) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "tests.acquire.session.fuzz", "--worker"]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def read(self, path: Path) -> str:
        """The outcome, "HANGS" or "DIES"."""
        import selectors

        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(f"{path}\n")
        self._process.stdin.flush()
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            said = self._process.stdout.readline().strip() if selector.select(PATIENCE_S) else "HANGS"
        if said and said != "HANGS":
            return said
        self.close()
        self._process = self._start()
        return said or "DIES"

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()


def fuzz(folder: Path, cases: range, *, abandoned: bool = False) -> Counter[tuple[str, str]]:
    """How often each kind of damage came to each end; files of bad ends are kept in ``folder``."""
    content = whole_session(folder / "whole.h5", abandoned=abandoned)
    ends: Counter[tuple[str, str]] = Counter()
    worker = Worker()
    for seed in cases:
        kind, broken = damaged(content, seed)
        path = folder / f"{kind}-{seed}.h5"
        path.write_bytes(broken)
        end = worker.read(path)
        ends[kind, end] += 1
        if not end.isupper():
            path.unlink()
    worker.close()
    return ends


def main() -> int:
    """Fuzz and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--worker", action="store_true")
    parser.add_argument("--abandoned", action="store_true", help="files as a killed recorder leaves them")
    arguments = parser.parse_args()
    if arguments.worker:
        work()
        return 0
    folder = Path(tempfile.mkdtemp(prefix="phasedic-fuzz-"))
    cases = range(arguments.seed, arguments.seed + arguments.cases)
    ends = fuzz(folder, cases, abandoned=arguments.abandoned)
    for (kind, end), count in sorted(ends.items()):
        print(f"{kind:8} {end:14} {count}")
    return any(end.isupper() for _, end in ends)


if __name__ == "__main__":
    sys.exit(main())
