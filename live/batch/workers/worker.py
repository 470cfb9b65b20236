"""The side of a worker: tasks as lines of JSON on standard input, progress and rows on standard output.

It ends with its caller: the end of standard input, in the middle of a task too, ends the process.
"""

from __future__ import annotations

import dataclasses
import json
import logging
import os
import queue
import signal
import sys
import threading
from typing import TextIO

from acquire.held_back import let_through
from analysis import PICTURE_KINDS, not_compiled
from live.batch.work import Progress, Task, perform


def main() -> int:
    """Do what comes, until nothing comes any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller hears it, and ends us
    let_through(signal.SIGINT)
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


def _tell(answers: TextIO, progress: Progress) -> None:
    _put(answers, {"progress": dataclasses.asdict(progress)})


def _put(answers: TextIO, message: object) -> None:
    answers.write(json.dumps(message) + "\n")
    answers.flush()
