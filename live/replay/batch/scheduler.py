"""The order of the tasks of a campaign, and its progress: a long session is cut into chunks, which a last task joins.

The kernel of a chunk starts without the bursts before it; the difference decays within some time steps, the run-in,
which is measured before the chunk and not kept. The results of chunks are in ``.NAME.KEY.chunks`` until the test is
complete. A test is measured whole where a reference is renewed in one of its chunks.
"""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.clock import Clock
from acquire.errors import DEFECT, PhasedicError
from acquire.text import Amount, Message, about, counts, joined
from acquire.text.message import duration
from live.pipeline.consumer import Screen
from live.replay.batch.cluster import Cluster
from live.replay.batch.row import RENEWED, BatchRow, failed
from live.replay.batch.task import Task, TaskProgress, remove, staging_dirs
from live.replay.batch.test_list import is_session, key_of_chunk
from live.replay.batch.worker import Pool
from live.replay.opening import open_source

RUN_IN = 20  # time steps; after them 0.0004 sigma is left of a first difference of 0.011
MIN_CHUNK = 100  # time steps of a chunk, so that the run-in costs a fifth at most
_SUFFIX = ".chunks"


@dataclass(frozen=True, slots=True)
class ChunkPlan:
    """The chunks of a test; without any it is measured whole, and ``why`` is the reason where it is not too short."""

    chunks: tuple[Task, ...] = ()
    why: str = ""


def cut(task: Task) -> ChunkPlan:
    """Chunks of about ``task.chunk_s`` of at least ``MIN_CHUNK`` time steps, each with its run-in."""
    assert task.chunk_s is not None
    if not is_session(task.source):
        return ChunkPlan(why="pictures are not cut")
    try:
        with open_source(task.request(task.folder)) as (source, _):
            times = source.times
    except PhasedicError:
        return ChunkPlan()  # the replay reports the error
    if times is None:  # --as-measured, which the command refuses beside --chunk
        return ChunkPlan()
    edges = [0, *_edges(times, task.chunk_s), len(times)]
    pairs = list(itertools.pairwise(edges))
    return ChunkPlan(tuple(_chunk(task, k, a, b) for k, (a, b) in enumerate(pairs)) if len(pairs) > 1 else ())


def _edges(times: NDArray[np.float64], seconds: float) -> Iterator[int]:
    """Numbers of the first bursts of the chunks after the first one."""
    begun = 0
    for number in (np.flatnonzero(np.diff((times - times[:1]) // seconds)) + 1).tolist():
        if number - begun >= MIN_CHUNK and len(times) - number >= MIN_CHUNK:
            begun = number
            yield number


def _chunk(task: Task, number: int, first: int, stop: int) -> Task:
    begin = max(0, first - RUN_IN)
    chunk = dataclasses.replace(
        task,
        name=f"{number:04d}",
        of=task.name,
        out=str(_chunk_folder(task)),
        numbers=(begin, stop),
        run_in=first - begin,
    )
    return dataclasses.replace(chunk, key=key_of_chunk(chunk))


def join_task(task: Task, found: ChunkPlan) -> Task:
    """The task that joins the results of all chunks."""
    return dataclasses.replace(task, chunks=[str(chunk.folder) for chunk in found.chunks])


def _chunk_folder(task: Task) -> Path:
    return Path(task.out) / f".{task.name}.{task.key[:12]}{_SUFFIX}"


def sweep_chunks(out: Path, done: set[str], missing: Mapping[str, Task]) -> None:
    """Remove the chunks of ``done`` tests, and those of ``missing`` tests with other settings; none in use."""
    for path in sorted(out.glob(f".*{_SUFFIX}")):
        name = path.name[1:].removesuffix(_SUFFIX).rpartition(".")[0]
        outdated = name in done or (name in missing and path != _chunk_folder(missing[name]))
        if outdated and all(part.is_stale for part in staging_dirs(path)):
            remove(path)


class BatchProgress:
    """Joins the progress of all tasks; ``update`` is called from any thread.

    Parameters
    ----------
    tests : int
        Number of tests to replay.
    now : callable giving s
    """

    def __init__(self, tests: int, now: Clock) -> None:
        self._tests, self._now, self._began = tests, now, now()
        self._ended = 0
        self._shares: dict[str, float] = {}
        self._last: dict[str, TaskProgress] = {}
        self._done: set[str] = set()

    def expect(self, title: str, share: float = 1.0) -> None:
        """Add the task ``title``, which is that share of a test."""
        self._shares[title] = share

    def update(self, title: str, progress: TaskProgress) -> None:
        """Note the progress of that task."""
        self._last[title] = progress

    def done(self, title: str) -> None:
        """Note the end of that task."""
        self._done.add(title)

    def ended(self) -> None:
        """Note the end of a test."""
        self._ended += 1

    def words(self) -> str:
        """Tests, time steps, ZOIs per second and the remaining time, in a line."""
        took, last = self._now() - self._began, list(self._last.values())
        time_steps, zois = sum(progress.done for progress in last), sum(progress.zois for progress in last)
        share = sum(share * self._part(title) for title, share in self._shares.items()) / self._tests
        left = Message("{time} left", duration(took * (1 - share) / share)) if 0 < share < 1 else ""
        rate = Message("{rate} ZOI/s", Amount("count", zois / took)) if took > 0 else ""
        tests = Message("{done} of {tests} tests", *counts(self._ended, self._tests))
        return joined("  ", (tests, Message("{n} instants", *counts(time_steps)), rate, left))

    def _part(self, title: str) -> float:
        """The share of a task that is done."""
        last = self._last.get(title)
        if title in self._done or last is None or not last.expected:
            return float(title in self._done)
        return min(1.0, last.done / last.expected)


class Scheduler:
    """Gives the tasks that can be done next; ``on_progress`` is called from any thread.

    Parameters
    ----------
    tasks : sequence of Task
        One for each test.
    cuts : mapping of name to ChunkPlan
        The tests that are cut.
    rows : dict of name to BatchRow
        Filled as tests end.
    progress : BatchProgress
    screen : Screen
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        cuts: Mapping[str, ChunkPlan],
        rows: dict[str, BatchRow],
        progress: BatchProgress,
        screen: Screen,
    ) -> None:
        self._tests = {task.name: task for task in tasks}
        self._cuts = {name: found for name, found in cuts.items() if found.chunks}
        self._left = {name: {chunk.name for chunk in found.chunks} for name, found in self._cuts.items()}
        self._rows, self._progress, self._screen = rows, progress, screen

    def first(self) -> list[Task]:
        """The tasks to begin with."""
        found: list[Task] = []
        for name, task in self._tests.items():
            pieces = self._cuts[name].chunks if name in self._cuts else (task,)
            for piece in pieces:
                self._progress.expect(piece.title, 1 / len(pieces))
            found += pieces
        return found

    def on_progress(self, task: Task, progress: TaskProgress) -> None:
        """Note the progress of a task."""
        if not task.chunks:  # its chunks have reported it
            self._progress.update(task.title, progress)

    def on_done(self, task: Task, row: BatchRow) -> Sequence[Task]:
        """Note the end of a task; the tasks that can be done now."""
        self._progress.done(task.title)
        if task.of:
            return self._chunk_done(task, row)
        self._end(task.name, row)
        return ()

    def _end(self, name: str, row: BatchRow) -> None:
        self._rows[name] = row
        self._progress.ended()
        if not row.is_well:
            self._screen.print(row.words)

    def _chunk_done(self, task: Task, row: BatchRow) -> Sequence[Task]:
        name = task.of
        if name not in self._left:
            return ()  # the test has failed, or is measured whole
        if row.values["outcome"] == RENEWED:
            return self._whole(name)
        if not row.is_done:
            del self._left[name]
            code = int(row.values["exit_code"] or DEFECT)
            self._end(name, failed(name, task.source, row.values["error"], code))
            return ()
        self._left[name].discard(task.name)
        return () if self._left[name] else [join_task(self._tests[name], self._cuts[name])]

    def _whole(self, name: str) -> Sequence[Task]:
        del self._left[name]
        text = Message("a reference was renewed in it; it is not cut, but measured whole")
        self._screen.print(about(name, text))
        for chunk in self._cuts[name].chunks:
            self._progress.expect(chunk.title, 0)
        self._progress.expect(name)
        return [self._tests[name]]


def perform_all(scheduler: Scheduler, workers: Pool | Cluster, poll_s: float) -> Iterator[None]:
    """Perform all tasks with ``workers``; yields each ``poll_s``, and where a task has ended.

    What follows a task comes before all that waits, a task whose worker died after it.

    Raises
    ------
    DataError
        The workers are out of reach.
    """
    waiting, running = deque(scheduler.first()), dict[Future[BatchRow | None], Task]()
    while waiting or running:
        while waiting and len(running) < workers.at_once:
            task = waiting.popleft()
            running[workers.submit(task)] = task
        ended, _ = wait(running, poll_s, FIRST_COMPLETED)
        if not running:  # the scheduler of the cluster is away
            time.sleep(poll_s)
        for future in ended:
            task, row = running.pop(future), future.result()
            if row is None:
                waiting.append(task)
            else:
                waiting.extendleft(scheduler.on_done(task, row))
        workers.check(0.0 if ended else poll_s)
        yield
