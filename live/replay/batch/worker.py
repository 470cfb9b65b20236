"""Workers of a batch: processes of this machine, and the functions that run on a worker of a Dask cluster.

``python -m live.replay.batch.worker`` reads tasks as lines of JSON on standard input and writes progress and rows
to standard output. It ends with its caller: the end of standard input ends the process, also during a task. Each has
one thread for the numerics (the libraries read that setting on import). A fork of a process that has loaded all
libraries was tried: it is not faster, since as many processes as cores load in parallel.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import logging
import os
import platform
import queue
import signal
import subprocess
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, TextIO

from acquire.system import blocked_signals, python_command, python_environment, unblock_signals
from acquire.text import Message
from analysis import PICTURE_KINDS, not_compiled
from live.replay.batch.row import BatchRow, failed
from live.replay.batch.task import Task, TaskProgress, perform
from live.replay.batch.test_list import deciding_versions

ONE_THREAD = (
    "NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM",
)  # fmt: skip
NEEDED = ONE_THREAD[:3]  # those that a worker of a cluster needs
_PROGRESS_EVERY_S = 2.0
# Settings of glibc: memory that one task has freed goes back to the system before the next one.
_LEAN = {
    "MALLOC_ARENA_MAX": "1", "MALLOC_MMAP_THRESHOLD_": "6000000", "MALLOC_TRIM_THRESHOLD_": "20000000",
}  # fmt: skip
_END_TIMEOUT_S = 5.0
MAX_DEATHS = 3
log = logging.getLogger(__name__)
OnProgress = Callable[[Task, TaskProgress], object]


def main() -> int:
    """Perform the tasks from standard input until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller gets it too, and ends this process
    unblock_signals(signal.SIGINT)
    logging.basicConfig(level=logging.ERROR, format="%(levelname)s %(name)s: %(message)s")
    answers = _answers()
    tasks: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    _put(answers, {"compiled": not not_compiled(PICTURE_KINDS)})  # loads numba, while the caller plans
    while True:
        row = perform(Task.from_json(tasks.get()), lambda progress: _put_progress(answers, progress))
        _put(answers, {"row": row.to_json()})


def _answers() -> TextIO:
    """Standard output for the answers only: output of libraries goes to standard error."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers


def _listen(tasks: queue.Queue[str]) -> None:
    for line in sys.stdin:
        tasks.put(line)
    os.kill(os.getpid(), signal.SIGTERM)


def _put_progress(answers: TextIO, progress: TaskProgress) -> None:
    _put(answers, {"progress": dataclasses.asdict(progress)})


def _put(answers: TextIO, message: object) -> None:
    answers.write(json.dumps(message) + "\n")
    answers.flush()


def describe_worker(token: str, dask_worker: Any = None) -> dict[str, Any]:
    """The worker this runs on: host, versions, threads, tasks at once, and whether the file ``token`` exists there."""
    return {
        "slots": dask_worker.state.nthreads if dask_worker else 1,
        "host": platform.node(),
        "versions": deciding_versions(),
        "threads": {name: os.environ.get(name, "") for name in NEEDED},
        "has_token": Path(token).exists(),
    }


def compile_on_worker() -> float:
    """Compile everything on the machine this runs on; the time, s."""
    from analysis import PICTURE_KINDS
    from live.setup.compiling import compile_ahead

    return compile_ahead(PICTURE_KINDS, phase=True)


def perform_on_worker(line: str, folder: str, topic: str) -> dict[str, Any]:
    """Perform the task ``line`` (JSON) in ``folder`` and return its row; progress goes to ``topic``."""
    task = Task.from_json(line)
    with contextlib.chdir(folder):
        return perform(task, _progress_to(task, topic)).to_json()


def _progress_to(task: Task, topic: str) -> Callable[[TaskProgress], None]:
    from distributed import get_worker

    worker, sent = get_worker(), 0.0

    def send(progress: TaskProgress) -> None:
        nonlocal sent
        if time.monotonic() - sent < _PROGRESS_EVERY_S:
            return
        sent = time.monotonic()
        try:
            message = [task.title, progress.done, progress.expected, progress.zois]
            worker.loop.add_callback(worker.log_event, topic, message)
        except Exception as error:  # an error of the progress must not end a task
            logging.getLogger(__name__).debug("progress could not be sent: %s", error)

    return send


class WorkerProcesses:
    """``count`` processes that load their libraries while the caller plans the tasks."""

    def __init__(self, count: int) -> None:
        self._idle = deque(WorkerProcess() for _ in range(count))

    def are_ready(self) -> bool:
        """Whether all loops are compiled on this machine; waits for the answer of a worker.

        Raises
        ------
        OSError
            No process can be started.
        """
        if not self._idle:
            self._idle.append(WorkerProcess())
        return self._idle[0].is_ready()

    def take(self) -> WorkerProcess:
        """An idle process, or a new one.

        Raises
        ------
        OSError
            No process can be started.
        """
        try:
            return self._idle.popleft()
        except IndexError:
            return WorkerProcess()

    def give_back(self, worker: WorkerProcess) -> None:
        """Keep a process that has performed its task."""
        self._idle.append(worker)

    def close(self) -> None:
        """End the idle processes."""
        while self._idle:
            worker = self._idle.popleft()
            worker.kill()
            worker.end()


class WorkerProcess:
    """One process; raises OSError where it cannot be started."""

    def __init__(self) -> None:
        with blocked_signals(signal.SIGINT):
            self._process = subprocess.Popen(
                python_command("live.replay.batch.worker"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                errors="backslashreplace",
                env=_LEAN | python_environment() | dict.fromkeys(ONE_THREAD, "1"),
                text=True,
                encoding="utf-8",
            )
        self.pid, self._said = self._process.pid, deque[str](maxlen=1)
        self._listener = threading.Thread(target=self._pass_on, daemon=True)
        self._listener.start()

    def _pass_on(self) -> None:
        for line in self._process.stderr or ():
            self._said.extend([line.strip()] * bool(line.strip()))
            sys.stderr.write(line)

    def why(self) -> str:
        """How it ended, after ``end``: its last words, or the signal."""
        killed = f"signal {-self._process.returncode}" if self._process.returncode < 0 else ""
        return "; ".join([*self._said, *filter(None, [killed])]) or f"exit code {self._process.returncode}"

    def is_ready(self) -> bool:
        """Its first message: whether all loops are compiled; False where it died before."""
        assert self._process.stdout is not None
        try:
            return bool(json.loads(self._process.stdout.readline()).get("compiled"))
        except (OSError, ValueError):
            return False

    def perform(self, task: Task, on_progress: OnProgress) -> BatchRow | None:
        """The row of ``task``; None where the process died over it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(task.to_json() + "\n")
            self._process.stdin.flush()
            for line in self._process.stdout:
                message = json.loads(line)
                if "row" in message:
                    return BatchRow.of(message["row"])
                if "progress" in message:
                    on_progress(task, TaskProgress(**message["progress"]))
        except (OSError, ValueError):  # a process that is killed may write half a line
            pass
        return None

    def kill(self) -> None:
        """Kill it now."""
        self._process.kill()

    def end(self) -> None:
        """Close its streams, which ends it, and wait for that."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._process.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listener.join(_END_TIMEOUT_S)
        if self._process.stderr is not None and not self._listener.is_alive():
            self._process.stderr.close()


class Pool:
    """Performs tasks with ``workers`` processes; ``on_progress`` is called from threads.

    A task whose worker died three times gives a failed row; other tasks are not affected. Where the first three workers
    die before one has measured anything, all tasks fail. The processes come from ``processes``, closed by the caller.

    Attributes
    ----------
    at_once : int
        Tasks that are worth submitting at once.
    """

    def __init__(self, workers: int, on_progress: OnProgress, processes: WorkerProcesses) -> None:
        self.at_once, self._on_progress, self._processes = workers, on_progress, processes
        self._threads = ThreadPoolExecutor(workers, "worker")
        self._deaths: Counter[str] = Counter()
        self._first_deaths: int | None = 0  # None once a worker has measured something
        self._hopeless = ""
        self._busy: set[WorkerProcess] = set()
        self._closed = False
        self._lock = threading.Lock()

    def submit(self, task: Task) -> Future[BatchRow | None]:
        """Perform ``task``; no row where its worker died, and it may be submitted again."""
        return self._threads.submit(self._perform, task)

    def check(self, quiet_s: float) -> None:
        """Processes of this machine are there or not: ``submit`` finds out."""

    def close(self) -> None:
        """End all workers, also during a task."""
        with self._lock:
            self._closed = True
            for worker in self._busy:
                worker.kill()
        self._threads.shutdown(cancel_futures=True)

    def _perform(self, task: Task) -> BatchRow | None:
        if self._hopeless:
            return failed(task.title, task.source, self._hopeless, 1)
        try:
            worker = self._processes.take()
        except OSError as error:
            log.error(Message("no worker could be started: {error}", error))
            return self._after_death(task, "it cannot be started")
        with self._lock:
            self._busy.add(worker)
            if self._closed:
                worker.kill()
        row = worker.perform(task, self._progressed)
        with self._lock:
            self._busy.discard(worker)
        if row is None:
            worker.end()
            return self._after_death(task, worker.why())
        self._first_deaths = None
        self._processes.give_back(worker)
        return row

    def _progressed(self, task: Task, progress: TaskProgress) -> None:
        self._first_deaths = None
        self._on_progress(task, progress)

    def _after_death(self, task: Task, why: str) -> BatchRow | None:
        """None where the task may be tried again; a failed row after ``MAX_DEATHS``."""
        with self._lock:
            self._deaths[task.title] += 1
            if self._first_deaths is not None:
                self._first_deaths += 1
                if self._first_deaths >= MAX_DEATHS:
                    self._hopeless = Message(
                        "no worker can work here, {n} died at once: {why}", MAX_DEATHS, why[:80]
                    )
            if self._deaths[task.title] < MAX_DEATHS:
                return None
        words = Message(
            "its worker died {n} times ({why}); is there memory enough for --workers?", MAX_DEATHS, why[:80]
        )
        return failed(task.title, task.source, words, 1)


if __name__ == "__main__":
    sys.exit(main())
