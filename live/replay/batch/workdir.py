"""Where a task works: ``.NAME.HOST.PID.part``, beside the folder that it becomes when it is whole.

A part of a process that has ended is stale. Of another machine nobody here knows; its parts are swept once the
task is whole.
"""

from __future__ import annotations

import contextlib
import os
import platform
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from acquire.errors import DataError

_SUFFIX = ".part"


@dataclass(frozen=True, slots=True)
class StagingDir:
    """A folder in which somebody works, or worked."""

    path: Path
    name: str
    host: str
    pid: int

    @property
    def is_stale(self) -> bool:
        """Whether a process of this machine made it that has ended."""
        return self.host == _host() and not _lives(self.pid)


def part_of(folder: Path) -> Path:
    """Where this process makes ``folder``."""
    return folder.with_name(f".{folder.name}.{_host()}.{os.getpid()}{_SUFFIX}")


def make(part: Path) -> None:
    """An empty folder; of an earlier process of the same number nothing is left."""
    remove(part)
    part.mkdir(parents=True)


def settle(part: Path, folder: Path) -> None:
    """Let ``part`` take its name; raises DataError where somebody has it by now."""
    try:
        part.rename(folder)
    except OSError as error:
        raise DataError(
            f"{folder}: the results cannot take their name ({error.strerror}); nothing is overwritten"
        ) from error


def parts(out: Path) -> Iterator[StagingDir]:
    """All that lie in ``out``."""
    for path in sorted(out.glob(f".*{_SUFFIX}")):
        words = path.name[1:].removesuffix(_SUFFIX).rsplit(".", 2)
        if len(words) == 3 and words[2].isdecimal() and path.is_dir():
            yield StagingDir(path, words[0], words[1], int(words[2]))


def sweep(out: Path, name: str | None = None) -> int:
    """Remove stale parts, of one task or of all; how many there were."""
    stale = [part for part in parts(out) if part.is_stale and name in (None, part.name)]
    for part in stale:
        remove(part.path)
    return len(stale)


def sweep_whole(out: Path, names: set[str]) -> None:
    """Remove what is left of tasks that are whole, whoever made it; a process that lives here keeps its own."""
    for part in parts(out):
        if part.name in names and (part.host != _host() or part.is_stale):
            remove(part.path)


def remove(part: Path) -> None:
    """Remove a part where it is there."""
    with contextlib.suppress(OSError):
        shutil.rmtree(part)


def _host() -> str:
    return platform.node().replace(".", "-") or "host"


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return not _is_zombie(pid)


def _is_zombie(pid: int) -> bool:
    """An orphan that nobody has reaped does nothing any more; where there is no /proc nobody can tell."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2]
    except OSError:
        return False
    return state.split()[:1] == ["Z"]
