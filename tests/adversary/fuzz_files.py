"""Changes the structure of session and strain files in many ways and checks what reading them does.

``python -m tests.adversary.fuzz_files session|strain [--seconds 600] [--seed 0]`` prints how often each end
was reached, and every case that did not end in words with exit code 4 or in the right numbers.
"""

from __future__ import annotations

import argparse
import logging
import math
import random
import shutil
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acquire.errors import DataError, PhasedicError
from acquire.session import Session, recover
from live.cli import main as phasedic
from live.replay.opening import session_config, session_source
from live.replay.source import ReplayRequest
from live.results import Strain
from tests.adversary.structure import change, make_fifo
from tests.live.replay.test_replay import RECORDED

LONGEST_S = 30.0  # of one case; what takes longer hangs
Numbers = dict[str, Any]


def crc(array: Any) -> int:
    return zlib.crc32(array.tobytes())


def look_at_session(path: Path) -> Numbers:
    """All that a replay reads of a session, up to the kernel: numbers by what they belong to."""
    numbers: Numbers = {}
    with Session.open(path) as session:
        for frame in session.frames():
            numbers[f"frame {frame.index}"] = (frame.t, crc(frame.image))
        for sample in session.load_samples():
            numbers[f"load {sample.t}"] = (repr(sample.force), sample.raw)
        session.events(), session.frame_counts, session.clock_pairs
        for as_measured in (True, False):
            request = ReplayRequest(str(path), None, {}, as_measured)
            config = session_config(session, request, {}, path)
            material = session_source(session, request, config, path)
            for burst in material.bursts:
                key = f"burst {getattr(burst, 'first_index', '-')} {getattr(burst, 'n', '-')}"
                mean = getattr(burst, "mean", None)
                numbers[key] = (
                    None if mean is None else (burst.t, repr(material.loads.force_at(burst.t)), crc(mean))
                )
    return numbers


def look_at_recovered(path: Path) -> Numbers:
    """What is in the copy that ``recover`` makes."""
    copy = path.with_suffix(".copy.h5")
    try:
        recover(path, copy)
        with Session.open(copy) as session:
            session.load_samples(), session.events(), session.frame_counts, session.clock_pairs
            return {f"frame {frame.index}": (frame.t, crc(frame.image)) for frame in session.frames()}
    finally:
        copy.unlink(missing_ok=True)


def look_at_strain(path: Path) -> Numbers:
    """All that a map or a report reads of the results."""
    numbers: Numbers = {}
    with Strain.open(path) as strain:
        for name in strain.names if strain.n else ():
            numbers |= {f"{name} {row}": crc(strain.maps(name, row)) for row in range(strain.n)}
        for name, column in strain.values.items():
            numbers |= {f"column {name} {row}": repr(value) for row, value in enumerate(column.tolist())}
    return numbers


@dataclass(eq=False)
class Fuzz:
    """One whole file, and what is done with changed copies of it.

    Attributes
    ----------
    ends : Counter of str
        How often each end was reached.
    bad : list of str
        Cases that ended otherwise than they must.
    """

    whole: Path
    folder: Path
    looks: tuple[Callable[[Path], Numbers], ...]
    ends: Counter[str] = field(default_factory=Counter)
    bad: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.fifo = make_fifo(self.folder / "fifo")
        self.elsewhere = Path(shutil.copy(self.whole, self.folder / "elsewhere.h5"))
        self.right = [look(self.whole) for look in self.looks]

    def run(self, seeds: Iterator[int], until: float) -> None:
        """Cases until ``until`` (``time.monotonic``)."""
        while time.monotonic() < until:
            self.case(next(seeds))

    def case(self, seed: int) -> None:
        """One changed copy, looked at in every way."""
        path = self.folder / "case.h5"
        shutil.copy(self.whole, path)
        try:
            what, touched = change(path, random.Random(seed), self.elsewhere, self.fifo)
        except (OSError, RuntimeError, ValueError, TypeError, LookupError, OverflowError, AttributeError):
            self.ends["could not be made"] += 1  # HDF5 itself refuses to write it
            return
        for look, right in zip(self.looks, self.right, strict=True):
            began = time.monotonic()
            end = _outcome(look, path, None if touched else right)
            if time.monotonic() - began > LONGEST_S:
                end = "HANGS"
            self.ends[end.partition(":")[0]] += 1
            if end[0].isupper():
                self.bad.append(f"seed {seed}, {what}, {look.__name__}: {end}")


def _outcome(look: Callable[[Path], Numbers], path: Path, right: Numbers | None) -> str:
    try:
        found = look(path)
    except DataError as error:
        return "refused" if str(error).isprintable() else f"ESCAPES: {error}"
    except PhasedicError as error:
        return f"CODE {error.exit_code}: {error}"
    except BaseException as error:
        return f"TRACEBACK: {error!r}"
    if right is None:
        return "read, with other numbers"
    wrong = [key for key, value in found.items() if right.get(key) != value]
    return f"WRONG: {wrong[:3]}" if wrong else "right" if len(found) == len(right) else "a part, right"


def made_strain(folder: Path) -> Path:
    """The results of a replay."""
    out = folder / "out"
    if phasedic(["replay", str(RECORDED / "session.h5"), "--out", str(out), "--no-view", "--no-rrd"]) != 0:
        raise RuntimeError("the session of the tests does not replay")
    return out / "strain.h5"


def session_fuzz(folder: Path) -> Fuzz:
    return Fuzz(RECORDED / "session.h5", folder, (look_at_session, look_at_recovered))


def strain_fuzz(folder: Path) -> Fuzz:
    return Fuzz(made_strain(folder), folder, (look_at_strain,))


def main() -> int:
    """Fuzz for a while and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["session", "strain"])
    parser.add_argument("--seconds", type=float, default=math.inf)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cases", type=int, default=10**9)
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    with tempfile.TemporaryDirectory() as folder:
        fuzz = (session_fuzz if arguments.what == "session" else strain_fuzz)(Path(folder))
        until = time.monotonic() + arguments.seconds
        for seed in range(arguments.seed, arguments.seed + arguments.cases):
            if time.monotonic() > until:
                break
            told = len(fuzz.bad)
            fuzz.case(seed)
            for line in fuzz.bad[told:]:
                print(line, flush=True)
    for end, count in sorted(fuzz.ends.items()):
        print(f"{end:24} {count}")
    return bool(fuzz.bad)


if __name__ == "__main__":
    sys.exit(main())
