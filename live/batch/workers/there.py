"""What runs on the workers of a cluster: what they are, whether they see our files, the compiling, and a task."""

from __future__ import annotations

import contextlib
import logging
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from live.batch.work import Progress, Task, deciding_versions, perform

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
    from live.setup import compile_ahead

    return compile_ahead(PICTURE_KINDS, phase=True)


def perform_there(line: str, folder: str, topic: str) -> dict[str, Any]:
    """Do the task ``line`` (JSON) as if begun in ``folder``; its progress goes to ``topic``, its row comes back."""
    task = Task.from_json(line)
    with contextlib.chdir(folder):
        return dict(perform(task, _telling(task, topic)).values)


def _telling(task: Task, topic: str) -> Callable[[Progress], None]:
    from distributed import get_worker

    worker, told = get_worker(), 0.0

    def tell(progress: Progress) -> None:
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
