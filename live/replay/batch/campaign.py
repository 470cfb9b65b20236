"""A campaign: workers replay the missing tests, and one table has the results of all.

The table is ``summary.csv``, and ``summary.parquet`` with pyarrow; each is written completely or not at all.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acquire.errors import EXIT_INTERRUPTED, LOSS, ConfigError, DataError, PhasedicError
from acquire.text import Message
from acquire.text.message import counted
from live.config.loading import load_config
from live.config.new_files import made_folder, replaced_file
from live.pipeline.consumer import Screen
from live.replay.batch.cluster import Cluster, check_scheduler
from live.replay.batch.row import COLUMNS, BatchRow, Value, failed
from live.replay.batch.scheduler import BatchProgress, ChunkPlan, Scheduler, cut, perform_all, sweep_chunks
from live.replay.batch.task import Task, row_done, sweep, sweep_done
from live.replay.batch.test_list import BatchJob, key_of, longest_first
from live.replay.batch.worker import Pool, WorkerProcesses
from live.replay.pictures import reference_file
from live.setup.compiling import compile_ahead

_POLL_S = 0.1


def write_summary(rows: Sequence[BatchRow], out: Path) -> list[Path]:
    """Write the table, in place of that of an earlier call; Parquet only where pyarrow is installed.

    Raises
    ------
    DataError
        A file cannot be written; the earlier one stays.
    """
    made = {"summary.csv": as_csv(rows)}
    if (table := as_parquet(rows)) is not None:
        made["summary.parquet"] = table
    for name, content in made.items():
        with replaced_file(out / name) as part:
            part.write_bytes(content)
    return [out / name for name in made]


def as_csv(rows: Sequence[BatchRow]) -> bytes:
    """A heading, and a line for each test; unknown values are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(row.values[name]) for name in COLUMNS] for row in rows)
    return text.getvalue().encode("utf-8", "backslashreplace")


def as_parquet(rows: Sequence[BatchRow]) -> bytes | None:
    """The table as Parquet with types; None without pyarrow."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return None
    kinds = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
    sink = io.BytesIO()
    parquet.write_table(pyarrow.Table.from_pylist([dict(row.values) for row in rows], schema), sink)
    return sink.getvalue()


def _cell(value: Value) -> Any:
    """The value as a cell that no spreadsheet reads as a formula."""
    return value.lstrip("=+-@\t ") if isinstance(value, str) else "" if value is None else value


@dataclass(frozen=True, slots=True)
class CampaignRequest:
    """The settings of a campaign.

    Attributes
    ----------
    tests : sequence of BatchJob
    out : Path
        Holds a folder for each test.
    workers : int
    config : str or None
        A configuration for all; that of a test replaces it.
    overrides : mapping of "section.key" to value
        For all; those of a test take precedence.
    start_s, end_s : float or None, s
    as_measured : bool
    chunk_s : float or None, s
        Cut longer sessions into chunks of about this length.
    reference : str or None
        Name or file of the reference of all; that of a test replaces it.
    scheduler : str or None
        Address of a Dask cluster, used instead of ``workers`` processes of this machine.
    """

    tests: Sequence[BatchJob]
    out: Path
    workers: int
    config: str | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)
    start_s: float | None = None
    end_s: float | None = None
    as_measured: bool = False
    chunk_s: float | None = None
    scheduler: str | None = None
    reference: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """The result of a campaign.

    Attributes
    ----------
    rows : tuple of BatchRow
        In the order of the tests.
    new : int
        Tests that were replayed now.
    files : tuple of Path
        The tables.
    exit_code : int
    """

    rows: tuple[BatchRow, ...]
    new: int
    files: tuple[Path, ...]
    exit_code: int


def run_campaign(wanted: CampaignRequest, screen: Screen, stopping: threading.Event) -> Campaign:
    """Replay the missing tests; setting ``stopping`` ends it early, without a table.

    Raises
    ------
    ConfigError
        The settings are not possible, or a folder holds results of other settings.
    DataError
        The table cannot be written.
    """
    load_config(Path(wanted.config) if wanted.config else None, wanted.overrides)
    if wanted.scheduler is not None:
        check_scheduler(wanted.scheduler)
    made_folder(wanted.out)
    with closing(_processes(wanted)) as processes:
        rows, tasks = _planned(wanted)
        _sweep(wanted.out, rows, tasks)
        ready = len(wanted.tests) - len(tasks)
        screen.print(
            Message(
                "{tests}: {ready} done before, {left} to replay into {folder}",
                *(counted(len(wanted.tests), "test"), ready, len(tasks), wanted.out),
            )
        )
        if tasks:
            _work(wanted, longest_first(tasks), rows, screen, stopping, processes)
    _sweep(wanted.out, rows, tasks)
    if stopping.is_set():
        return Campaign(tuple(rows.values()), len(tasks), (), EXIT_INTERRUPTED)
    found = tuple(rows[test.name] for test in wanted.tests)
    files = write_summary(found, wanted.out)
    code = 0 if all(row.is_well for row in found) else LOSS
    return Campaign(found, len(tasks), tuple(files), code)


def _processes(wanted: CampaignRequest) -> WorkerProcesses:
    """Processes for the tests without a folder: they load while this one plans."""
    missing = sum(not (wanted.out / test.name).exists() for test in wanted.tests)
    try:
        return WorkerProcesses(0 if wanted.scheduler else min(wanted.workers, missing))
    except OSError as error:
        raise _no_process(error) from error


def _no_process(error: OSError) -> DataError:
    return DataError("no process can be started on this machine ({why}); end other programs", error)


def _sweep(out: Path, rows: Mapping[str, BatchRow], tasks: Sequence[Task]) -> None:
    """Remove staging folders and chunks that no process works on and no test needs."""
    done = {name for name, row in rows.items() if row.is_done}
    sweep(out)
    sweep_done(out, done)
    sweep_chunks(out, done, {task.name: task for task in tasks})


def _planned(wanted: CampaignRequest) -> tuple[dict[str, BatchRow], list[Task]]:
    """The rows of complete tests, and the tasks for the others."""
    rows: dict[str, BatchRow] = {}
    tasks: list[Task] = []
    for test in wanted.tests:
        task = _task(wanted, test)
        try:
            task = dataclasses.replace(task, key=key_of(task))
        except PhasedicError as error:
            rows[task.name] = failed(task.name, task.source, error.text, error.exit_code)
            continue
        if (row := row_done(task)) is not None:
            rows[task.name] = row
        else:
            tasks.append(task)
    taken = [str(task.folder) for task in tasks if task.folder.exists()]
    if taken:
        more = Message(" and {n} more", len(taken) - 1) if len(taken) > 1 else ""
        raise ConfigError(
            "{folder}{more}: holds results of other settings, another recording or another version; nothing is"
            " overwritten, choose another --out",
            taken[0],
            more,
        )
    return rows, tasks


def _task(wanted: CampaignRequest, test: BatchJob) -> Task:
    return Task(
        name=test.name,
        out=str(wanted.out.absolute()),
        source=test.source,
        config=_absolute(test.config or wanted.config),
        reference=_absolute(reference_file(test.source, test.reference or wanted.reference)),
        forces=_absolute(test.forces),
        start_s=wanted.start_s,
        end_s=wanted.end_s,
        as_measured=wanted.as_measured,
        chunk_s=wanted.chunk_s,
        overrides={**wanted.overrides, **test.overrides},
    )


def _absolute(path: str | None) -> str | None:
    return None if path is None else str(Path(path).absolute())


def _work(
    wanted: CampaignRequest,
    tasks: Sequence[Task],
    rows: dict[str, BatchRow],
    screen: Screen,
    stopping: threading.Event,
    processes: WorkerProcesses,
) -> None:
    progress = BatchProgress(len(tasks), time.monotonic)
    scheduler = Scheduler(tasks, _cuts(tasks, screen), rows, progress, screen)
    workers: Pool | Cluster
    if wanted.scheduler is None:
        _compile(processes, screen, stopping)
        workers = Pool(wanted.workers, scheduler.on_progress, processes)
    else:
        workers = Cluster(wanted.scheduler, wanted.out.absolute(), scheduler.on_progress, screen)
    with closing(workers):
        for _ in perform_all(scheduler, workers, _POLL_S):
            if stopping.is_set():
                break
            screen.status(progress.words())
    screen.print(progress.words())


def _compile(processes: WorkerProcesses, screen: Screen, stopping: threading.Event) -> None:
    """Compile what is missing, before workers need it."""
    try:
        ready = processes.are_ready()
    except OSError as error:
        raise _no_process(error) from error
    if not ready:
        from analysis import PICTURE_KINDS

        compile_ahead(PICTURE_KINDS, phase=True, screen=screen, stopping=stopping)


def _cuts(tasks: Sequence[Task], screen: Screen) -> dict[str, ChunkPlan]:
    """The chunks of the tests to be cut; a line on the screen for each that cannot be cut."""
    found = {task.name: cut(task) for task in tasks if task.chunk_s is not None}
    for name, one in found.items():
        if one.why:
            screen.print(Message("{name}: done whole: {why}", name, one.why))
    return found
