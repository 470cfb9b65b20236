"""The staging folder of a task: ``.NAME.HOST.PID.part``, renamed to the folder of its results when it is complete.

A staging folder of a process that has ended is stale. Processes of other machines cannot be checked; their folders
are removed when the task is complete.
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
from acquire.system import is_running

_SUFFIX = ".part"


@dataclass(frozen=True, slots=True)
class StagingDir:
    """A staging folder, of a process that may have ended."""

    path: Path
    name: str
    host: str
    pid: int

    @property
    def is_stale(self) -> bool:
        """Whether it is of a process of this machine that has ended."""
        return self.host == _host() and not is_running(self.pid)


def staging_dir(folder: Path) -> Path:
    """The staging folder of this process for ``folder``."""
    return folder.with_name(f".{folder.name}.{_host()}.{os.getpid()}{_SUFFIX}")


def make(staging: Path) -> None:
    """Make the folder empty, without files of an earlier process with the same number."""
    remove(staging)
    staging.mkdir(parents=True)


def publish(staging: Path, folder: Path) -> None:
    """Rename ``staging`` to ``folder``; raises DataError where that exists by now."""
    try:
        staging.rename(folder)
    except OSError as error:
        raise DataError(
            "{folder}: the folder of the results cannot be renamed to this ({why}); nothing is overwritten",
            folder,
            error,
        ) from error


def staging_dirs(out: Path) -> Iterator[StagingDir]:
    """All staging folders in ``out``."""
    for path in sorted(out.glob(f".*{_SUFFIX}")):
        words = path.name[1:].removesuffix(_SUFFIX).rsplit(".", 2)
        if len(words) == 3 and words[2].isdecimal() and path.is_dir():
            yield StagingDir(path, words[0], words[1], int(words[2]))


def sweep(out: Path, name: str | None = None) -> int:
    """Remove stale staging folders, of one task or of all; how many there were."""
    stale = [part for part in staging_dirs(out) if part.is_stale and name in (None, part.name)]
    for part in stale:
        remove(part.path)
    return len(stale)


def sweep_done(out: Path, names: set[str]) -> None:
    """Remove the staging folders of complete tasks, except those of running processes of this machine."""
    for part in staging_dirs(out):
        if part.name in names and (part.host != _host() or part.is_stale):
            remove(part.path)


def remove(staging: Path) -> None:
    """Remove a folder where it exists."""
    with contextlib.suppress(OSError):
        shutil.rmtree(staging)


def _host() -> str:
    return platform.node().replace(".", "-") or "host"
