"""Whether the tests notice: each mutant of ``mutants.toml`` in a copy of the code, against tests of its own.

    python -m tests.mutants [TEXT ...] [--jobs 2] [--tests FOLDER]

A mutant is one wrong thing: in ``file`` the text ``old``, which stands there once, becomes ``new``. It is caught
when its ``tests`` fail. They have to pass without it, and this is tried first. A copy has its own cache of compiled
loops, so that a mutant is compiled and nothing of it is left. Exit code 0: at least ``ENOUGH`` of them are caught;
1: fewer; 2: the list does not fit the code.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_name("mutants.toml")
COPIED = (
    "acquire",
    "analysis",
    "hw_mocks",
    "live",
    "phasedic",
    "tests",
    "examples",
    "docs",
    "pyproject.toml",
    "README.md",
)
ENOUGH = 0.9
LONGEST_S = 900.0
"""After so long a mutant counts as caught: it does not end."""
PASSED, FAILED = 0, 1  # exit codes of pytest


class ListError(Exception):
    """The list does not fit the code; the text is for a person."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One wrong thing.

    Attributes
    ----------
    what : str
        In words.
    file, old, new : str
        ``old`` stands once in ``file``.
    tests : tuple of str
        Arguments of pytest: folders, files or single tests.
    """

    what: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def fault(self) -> str:
        """Why it does not fit the code; empty where it does."""
        path, places = ROOT / self.file, [ROOT / one.partition("::")[0] for one in self.tests]
        if not path.is_file():
            return f"there is no {self.file}"
        if missing := [str(place.relative_to(ROOT)) for place in places if not place.exists()]:
            return f"there is no {missing[0]}"
        count = path.read_text(encoding="utf-8").count(self.old)
        if count != 1:
            return f"{self.old!r} stands {count} times in {self.file}, not once"
        return "it changes nothing" if self.old == self.new else ""

    def apply(self, folder: Path) -> None:
        """Write it into the copy of the code in ``folder``."""
        path = folder / self.file
        text, later = path.read_text(encoding="utf-8"), path.stat().st_mtime + 2
        path.write_text(text.replace(self.old, self.new), encoding="utf-8")
        # What Python has compiled of a file is taken for one of the same size and the same second.
        os.utime(path, (later, later))


@dataclass(frozen=True, slots=True)
class Trial:
    """A mutant and its tests: the exit code of pytest (None: it did not end), its output, and the time, s."""

    mutant: Mutant
    code: int | None
    output: str
    seconds: float

    @property
    def verdict(self) -> str:
        """In one word."""
        if self.code in (FAILED, None):
            return "caught"
        return "SURVIVED" if self.code == PASSED else "BROKEN"


def read_list(path: Path, words: Sequence[str] = (), folder: str = "") -> list[Mutant]:
    """The mutants whose words or files have one of ``words``; tests all in ``folder`` where it is given.

    Raises
    ------
    ListError
        One does not fit the code, or none is left.
    """
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]
    mutants = [Mutant(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries]
    faults = [f"{mutant.what}: {fault}" for mutant in mutants if (fault := mutant.fault())]
    if faults:
        raise ListError("\n".join([*faults, f"mend {path.name}: the code has changed under these mutants"]))
    chosen = [m for m in mutants if not words or any(w in f"{m.what} {m.file}" for w in words)]
    if not chosen:
        raise ListError(f"no mutant has {' or '.join(words)} in its words or file")
    return [Mutant(m.what, m.file, m.old, m.new, (folder,)) if folder else m for m in chosen]


def copy_code(to: Path, source: Path) -> Path:
    """A copy of the code, with the times of its files: what is compiled beside them stays valid."""
    to.mkdir()
    for name in COPIED:
        if (source / name).is_dir():
            shutil.copytree(source / name, to / name, ignore=shutil.ignore_patterns(".pytest_cache"))
        elif (source / name).exists():
            shutil.copy2(source / name, to / name)
    return to


def run_tests(folder: Path, tests: Sequence[str]) -> tuple[int | None, str]:
    """The exit code of pytest in a copy of the code (None: stopped after LONGEST_S), and its output."""
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(folder)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "no:cacheprovider",
        "--timeout",
        "200",
        "-m",
        "not timed",  # several run at once
        *tests,
    ]
    command += ["--basetemp", str(folder / "made")]
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired as over:
        return None, str(over.stdout)
    return done.returncode, done.stdout + done.stderr


def try_one(mutant: Mutant, clean: Path, folder: Path) -> Trial:
    """Apply a mutant in ``folder``, a new copy of ``clean``, and run its tests."""
    began = time.monotonic()
    try:
        mutant.apply(copy_code(folder, clean))
        code, output = run_tests(folder, mutant.tests)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return Trial(mutant, code, output, time.monotonic() - began)


def trials(mutants: Sequence[Mutant], clean: Path, jobs: int) -> Iterator[Trial]:
    """Each mutant tried, in order, ``jobs`` at a time."""
    with ThreadPoolExecutor(jobs) as pool:
        numbered = [(m, clean, clean.with_name(f"mutant{k}")) for k, m in enumerate(mutants)]
        yield from pool.map(lambda one: try_one(*one), numbered)


def summary(done: Sequence[Trial]) -> str:
    """How many are caught, and what the others are."""
    left = [trial for trial in done if trial.verdict != "caught"]
    lines = [f"{trial.verdict}: {trial.mutant.what} ({trial.mutant.file})" for trial in left]
    lines += [trial.output[-2000:] for trial in left if trial.verdict == "BROKEN"]
    share = 1 - len(left) / len(done)
    return "\n".join([*lines, f"{len(done) - len(left)} of {len(done)} mutants are caught ({share:.0%})"])


def main(words: Sequence[str] | None = None) -> int:
    """Try them all; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutants", description=str(__doc__).partition("\n")[0]
    )
    parser.add_argument("text", nargs="*", help="only mutants with this in their words or file")
    parser.add_argument("--jobs", type=int, default=2, help="mutants at a time")
    parser.add_argument("--tests", default="", help="folder of tests to be run for each, in place of its own")
    given = parser.parse_args(words)
    try:
        mutants = read_list(LIST, given.text, given.tests)
    except ListError as error:
        print(error, file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="mutants") as room:
        clean = copy_code(Path(room) / "clean", ROOT)
        code, output = run_tests(clean, sorted({one for mutant in mutants for one in mutant.tests}))
        if code != PASSED:
            print(f"{output[-4000:]}\nthe tests fail without any mutant; mend them first", file=sys.stderr)
            return 2
        shutil.rmtree(clean / "made", ignore_errors=True)
        done = []
        for trial in trials(mutants, clean, given.jobs):
            print(f"{trial.verdict:8} {trial.seconds:4.0f} s  {trial.mutant.what}", flush=True)
            done.append(trial)
    print(summary(done))
    return 0 if sum(trial.verdict == "caught" for trial in done) >= ENOUGH * len(done) else 1


if __name__ == "__main__":
    sys.exit(main())
