"""One test of a campaign: replayed into a staging folder, which is renamed when it is complete.

The staging folder is ``.NAME.HOST.PID.part``. One of a process that has ended is stale. Processes of other machines
cannot be checked; their folders are removed when the task is complete.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import logging
import os
import platform
import shutil
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from acquire.errors import DataError, PhasedicError
from acquire.system import is_running
from acquire.text import Message
from acquire.text.message import changed, printable
from live.pipeline.consumer import Screen
from live.replay.batch.row import BatchRow, failed, row_of, row_of_chunk
from live.replay.parts import measure_part
from live.replay.replay import replay
from live.replay.source import ReplayRequest
from live.results.summary import summary_lines

if TYPE_CHECKING:
    from live.pipeline.measurement import TimeStep

_SUFFIX = ".part"

log = logging.getLogger(__name__)
ROW_FILE, LOG_FILE, FIELDS_FILE = "batch.json", "replay.txt", "fields"
_PROGRESS_EVERY_S = 0.25


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


@dataclass(frozen=True, slots=True)
class Task:
    """A task for a worker; plain values for JSON.

    Attributes
    ----------
    name, out : str
        The results go to the folder ``name`` in ``out``.
    source : str
    config, reference, forces : str or None
        Files.
    start_s, end_s : float or None, s
    as_measured : bool
    overrides : mapping of "section.key" to value
    chunk_s : float or None, s
        A long session is cut into chunks of this length.
    numbers : pair of int or None
        This task is a chunk: the bursts from the first number up to the second are measured.
    run_in : int
        Number of them that are measured first and not kept.
    chunks : sequence of str
        This task joins the chunks in these folders.
    of : str
        The test that this task is a chunk of.
    key : str
        Hash of all that the results depend on (``test_list``).
    """

    name: str
    out: str
    source: str
    config: str | None = None
    reference: str | None = None
    forces: str | None = None
    start_s: float | None = None
    end_s: float | None = None
    as_measured: bool = False
    overrides: Mapping[str, Any] = field(default_factory=dict)
    chunk_s: float | None = None
    numbers: tuple[int, int] | None = None
    run_in: int = 0
    chunks: Sequence[str] = ()
    of: str = ""
    key: str = ""

    def to_json(self) -> str:
        """In one line."""
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, line: str) -> Task:
        """The task of ``to_json``."""
        return cls(**json.loads(line))

    @property
    def title(self) -> str:
        """Its unique name among all tasks."""
        return f"{self.of}#{self.name}" if self.of else self.name

    @property
    def folder(self) -> Path:
        """The folder of its complete results."""
        return Path(self.out) / self.name

    def request(self, folder: Path) -> ReplayRequest:
        """The replay, into ``folder``; without a view."""
        always = {"view.enabled": False, "view.rrd": False, "output.dir": str(folder)}
        return ReplayRequest(
            source=self.source,
            as_measured=self.as_measured,
            start_s=self.start_s,
            end_s=self.end_s,
            reference=self.reference,
            config_file=Path(self.config) if self.config else None,
            overrides={**self.overrides, **always},
            forces=Path(self.forces) if self.forces else None,
            numbers=range(*self.numbers) if self.numbers else None,
            parts=[Path(chunk) / FIELDS_FILE for chunk in self.chunks],
            final_folder=self.folder,
        )


@dataclass(frozen=True, slots=True)
class TaskProgress:
    """Progress of a task: time steps done, of how many (None: not known), and ZOIs measured."""

    done: int
    expected: int | None
    zois: int


OnProgress = Callable[[TaskProgress], object]


class _LogScreen(Screen):
    """Writes the lines of a replay to a file, and reports its progress."""

    def __init__(self, stream: TextIO, on_progress: OnProgress) -> None:
        self._stream, self._on_progress, self._reported_t, self._zois = stream, on_progress, 0.0, 0
        self.last = TaskProgress(0, None, 0)

    def print(self, text: str = "") -> None:
        """Write a line of the file."""
        print(printable(text), file=self._stream, flush=True)

    def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
        """Report the progress, four times a second."""
        self._zois += i.n_zoi
        self.last = TaskProgress(done, expected, self._zois)
        if time.monotonic() - self._reported_t >= _PROGRESS_EVERY_S:
            self._reported_t = time.monotonic()
            self._on_progress(self.last)


def _no_progress(progress: TaskProgress) -> None:
    """The callback where no progress is needed."""


def row_done(task: Task) -> BatchRow | None:
    """The row of a complete task with the same key; None where it is to be done."""
    try:
        stored = json.loads((task.folder / ROW_FILE).read_text(encoding="utf-8"))
        return BatchRow.of(stored["row"]) if stored["key"] == task.key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def perform(task: Task, on_progress: OnProgress = _no_progress) -> BatchRow:
    """Perform ``task``, unless it is done; an error gives a row with its text.

    The same on a worker of this machine and of a cluster. A process that is ended leaves a staging folder, which
    never counts as done.
    """
    if (row := row_done(task)) is not None:
        return row
    staging = staging_dir(task.folder)
    sweep(task.folder.parent, task.name)
    try:
        make(staging)
        row = _measured(task, staging, on_progress) if task.numbers else _replayed(task, staging, on_progress)
        row = BatchRow.of({**row.values, "error": _as_published(task, staging, row.values["error"])})
        (staging / ROW_FILE).write_text(
            json.dumps({"key": task.key, "row": row.to_json()}, indent=1), encoding="utf-8"
        )
        publish(staging, task.folder)
        return row
    except PhasedicError as error:
        return _not_done(task, staging, error.text, error.exit_code)
    except OSError as error:
        words = Message("{path}: cannot be written ({why}); make room", error.filename or task.folder, error)
        return _not_done(task, staging, words, 4)
    except Exception as error:
        log.exception("a defect of phasedic; please report it with this traceback")
        words = Message("a defect of phasedic: {kind}: {error}", type(error).__name__, error)
        return _not_done(task, staging, words, 1)


def _not_done(task: Task, staging: Path, words: str, code: int) -> BatchRow:
    """The row of another caller that was faster; else that of a failure."""
    remove(staging)
    return row_done(task) or failed(task.title, task.source, _as_published(task, staging, words), code)


def _as_published(task: Task, staging: Path, words: object) -> str:
    """An error with the path of the results in place of that of the staging folder."""
    return changed(words, lambda part: part.replace(str(staging), str(task.folder)))


def _replayed(task: Task, staging: Path, on_progress: OnProgress) -> BatchRow:
    with (staging / LOG_FILE).open("w", encoding="utf-8", errors="backslashreplace") as file:
        screen, began = _LogScreen(file, on_progress), time.monotonic()
        done = replay(task.request(staging), screen, threading.Event())
        for line in [*summary_lines(done.run_state, done.test), *done.lines]:
            screen.print(line)
    on_progress(screen.last)
    before = sum(_seconds(Path(chunk)) for chunk in task.chunks)
    return row_of(task.name, task.source, done, before + time.monotonic() - began)


def _seconds(chunk: Path) -> float:
    return float(json.loads((chunk / ROW_FILE).read_text(encoding="utf-8"))["row"]["seconds"])


def _measured(task: Task, staging: Path, on_progress: OnProgress) -> BatchRow:
    """Measure a chunk."""
    began = time.monotonic()
    with (
        (staging / LOG_FILE).open("w", encoding="utf-8", errors="backslashreplace") as log_file,
        (staging / FIELDS_FILE).open("wb") as file,
    ):
        screen = _LogScreen(log_file, on_progress)
        as_the_whole = measure_part(task.request(staging), file, task.run_in, screen)
    on_progress(screen.last)
    return row_of_chunk(task.title, task.source, as_the_whole, time.monotonic() - began)
