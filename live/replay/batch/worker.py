"""A batch worker: a process of ``worker_processes``, and the functions that run on a worker of a Dask cluster.

``python -m live.replay.batch.worker`` reads tasks as lines of JSON on standard input and writes progress and rows
to standard output. It ends with its caller: the end of standard input ends the process, also during a task.
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
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from acquire.system import unblock_signals
from analysis import PICTURE_KINDS, not_compiled
from live.replay.batch.keys import deciding_versions
from live.replay.batch.task import Task, TaskProgress, perform


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
        _put(answers, {"row": dict(row.values)})


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


ONE_THREAD = (
    "NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM",
)  # fmt: skip
NEEDED = ONE_THREAD[:3]  # those that a worker of a cluster needs
_PROGRESS_EVERY_S = 2.0


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
        return dict(perform(task, _progress_to(task, topic)).values)


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


if __name__ == "__main__":
    sys.exit(main())
