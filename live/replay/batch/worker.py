"""The side of a worker: tasks as lines of JSON on standard input, progress and rows on standard output.

It ends with its caller: the end of standard input, in the middle of a task too, ends the process.

What runs on the workers of a cluster: what they are, whether they see our files, the compiling, and a task.

``python -m live.replay.batch.worker``: one worker of ``pool``.
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

from acquire.signal_mask import unblock_signals
from analysis import PICTURE_KINDS, not_compiled
from live.replay.batch.keys import deciding_versions
from live.replay.batch.task import Task, TaskProgress, perform


def main() -> int:
    """Do what comes, until nothing comes any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller hears it, and ends us
    unblock_signals(signal.SIGINT)
    logging.basicConfig(level=logging.ERROR, format="%(levelname)s %(name)s: %(message)s")
    answers = _answers()
    tasks: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    _put(answers, {"compiled": not not_compiled(PICTURE_KINDS)})  # loads numba, while the caller plans
    while True:
        row = perform(Task.from_json(tasks.get()), lambda progress: _tell(answers, progress))
        _put(answers, {"row": dict(row.values)})


def _answers() -> TextIO:
    """Standard output for the answers alone: what libraries print there goes to standard error."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers


def _listen(tasks: queue.Queue[str]) -> None:
    for line in sys.stdin:
        tasks.put(line)
    os.kill(os.getpid(), signal.SIGTERM)


def _tell(answers: TextIO, progress: TaskProgress) -> None:
    _put(answers, {"progress": dataclasses.asdict(progress)})


def _put(answers: TextIO, message: object) -> None:
    answers.write(json.dumps(message) + "\n")
    answers.flush()


ONE_THREAD = (
    "NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM",
)  # fmt: skip
NEEDED = ONE_THREAD[:3]  # of those, what a worker that others have started must have
_TELL_EVERY_S = 2.0


def about(token: str, dask_worker: Any = None) -> dict[str, Any]:
    """Of the worker this runs on: host, versions, threads, tasks at once, and whether the file ``token`` is there."""
    return {
        "slots": dask_worker.state.nthreads if dask_worker else 1,
        "host": platform.node(),
        "versions": deciding_versions(),
        "threads": {name: os.environ.get(name, "") for name in NEEDED},
        "sees": Path(token).exists(),
    }


def compile_there() -> float:
    """Have everything compiled on the machine this runs on; the seconds that took."""
    from analysis import PICTURE_KINDS
    from live.setup.compiling import compile_ahead

    return compile_ahead(PICTURE_KINDS, phase=True)


def perform_there(line: str, folder: str, topic: str) -> dict[str, Any]:
    """Do the task ``line`` (JSON) as if begun in ``folder``; its progress goes to ``topic``, its row comes back."""
    task = Task.from_json(line)
    with contextlib.chdir(folder):
        return dict(perform(task, _telling(task, topic)).values)


def _telling(task: Task, topic: str) -> Callable[[TaskProgress], None]:
    from distributed import get_worker

    worker, told = get_worker(), 0.0

    def tell(progress: TaskProgress) -> None:
        nonlocal told
        if time.monotonic() - told < _TELL_EVERY_S:
            return
        told = time.monotonic()
        try:
            message = [task.title, progress.done, progress.expected, progress.zois]
            worker.loop.add_callback(worker.log_event, topic, message)
        except Exception as error:  # nobody's progress is worth a task
            logging.getLogger(__name__).debug("progress could not be told: %s", error)

    return tell


if __name__ == "__main__":
    sys.exit(main())
