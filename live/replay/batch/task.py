"""One test of a campaign: replayed into a hidden folder, which takes its name when everything is in it."""

from __future__ import annotations

import dataclasses
import json
import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from acquire.errors import PhasedicError
from acquire.printable import printable
from live.pipeline.screen import Screen
from live.replay.batch import workdir as places
from live.replay.batch.row import BatchRow, failed, row_of, row_of_chunk
from live.replay.parts import measure_part
from live.replay.replay import replay
from live.replay.source import ReplayRequest
from live.results.summary import summary_lines

if TYPE_CHECKING:
    from live.pipeline.measurement import TimeStep

log = logging.getLogger(__name__)
DONE, SAID, FIELDS = "batch.json", "replay.txt", "fields"
_TELL_EVERY_S = 0.25


@dataclass(frozen=True, slots=True)
class Task:
    """What a worker is told; plain values, fit for JSON.

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
        So many of them are thrown away.
    chunks : sequence of str
        This task joins what lies in these folders, done chunks of all of it.
    of : str
        The test that this task is a chunk of.
    key : str
        Of all that the results depend on (``keys``).
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
        """What ``to_json`` gave."""
        return cls(**json.loads(line))

    @property
    def title(self) -> str:
        """Its name among all tasks."""
        return f"{self.of}#{self.name}" if self.of else self.name

    @property
    def folder(self) -> Path:
        """Where its results lie once they are whole."""
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
            parts=[Path(chunk) / FIELDS for chunk in self.chunks],
            settled=self.folder,
        )


@dataclass(frozen=True, slots=True)
class TaskProgress:
    """How far a task is: instants done, of how many (None: not known), and ZOIs measured."""

    done: int
    expected: int | None
    zois: int


Tell = Callable[[TaskProgress], object]


class _Telling(Screen):
    """Keeps the sentences of a replay in a file, and tells its progress."""

    def __init__(self, stream: TextIO, tell: Tell) -> None:
        self._stream, self._tell, self._told, self._zois = stream, tell, 0.0, 0
        self.last = TaskProgress(0, None, 0)

    def say(self, text: str = "") -> None:
        """A line of the file."""
        print(printable(text), file=self._stream, flush=True)

    def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
        """Told to whoever waits, four times a second."""
        self._zois += i.n_zoi
        self.last = TaskProgress(done, expected, self._zois)
        if time.monotonic() - self._told >= _TELL_EVERY_S:
            self._told = time.monotonic()
            self._tell(self.last)


def _nobody(progress: TaskProgress) -> None:
    """Nobody waits for it."""


def row_done(task: Task) -> BatchRow | None:
    """The row of a task that is whole and was done with the same key; None where it is to be done."""
    try:
        stored = json.loads((task.folder / DONE).read_text(encoding="utf-8"))
        return BatchRow.of(stored["row"]) if stored["key"] == task.key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def perform(task: Task, tell: Tell = _nobody) -> BatchRow:
    """Do ``task``, unless it is done; what goes wrong is a row with its error.

    The same on a worker of this machine and of a cluster. Whatever ends the process leaves a hidden folder
    alone, which never counts as done.
    """
    if (row := row_done(task)) is not None:
        return row
    part = places.part_of(task.folder)
    places.sweep(task.folder.parent, task.name)
    try:
        places.make(part)
        row = _measured(task, part, tell) if task.numbers else _replayed(task, part, tell)
        (part / DONE).write_text(json.dumps({"key": task.key, "row": row.values}, indent=1), encoding="utf-8")
        places.settle(part, task.folder)
        return row
    except PhasedicError as error:
        return _not_done(task, part, str(error), error.exit_code)
    except OSError as error:
        words = f"{error.filename or task.folder}: cannot be written ({error.strerror or error}); make room"
        return _not_done(task, part, words, 4)
    except Exception as error:
        log.exception("a defect of phasedic; please report it with this traceback")
        return _not_done(task, part, f"a defect of phasedic: {type(error).__name__}: {error}", 1)


def _not_done(task: Task, part: Path, words: str, code: int) -> BatchRow:
    """Another caller may have been faster; else it has failed."""
    places.remove(part)
    return row_done(task) or failed(task.title, task.source, words, code)


def _replayed(task: Task, part: Path, tell: Tell) -> BatchRow:
    with (part / SAID).open("w", encoding="utf-8") as file:
        screen, began = _Telling(file, tell), time.monotonic()
        done = replay(task.request(part), screen, threading.Event())
        for line in [*summary_lines(done.run_state, done.config.specimen), *done.lines]:
            screen.say(line)
    tell(screen.last)
    before = sum(_seconds(Path(chunk)) for chunk in task.chunks)
    return row_of(task.name, task.source, done, before + time.monotonic() - began)


def _seconds(chunk: Path) -> float:
    return float(json.loads((chunk / DONE).read_text(encoding="utf-8"))["row"]["seconds"])


def _measured(task: Task, part: Path, tell: Tell) -> BatchRow:
    """A chunk."""
    began = time.monotonic()
    with (part / SAID).open("w", encoding="utf-8") as said, (part / FIELDS).open("wb") as file:
        screen = _Telling(said, tell)
        as_the_whole = measure_part(task.request(part), file, task.run_in, screen)
    tell(screen.last)
    return row_of_chunk(task.title, task.source, as_the_whole, time.monotonic() - began)
