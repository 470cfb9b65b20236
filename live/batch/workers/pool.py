"""Worker processes of this machine, one task at a time each; one that dies is replaced and its task done again."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Sequence

from live.batch.work import Row, Task, failed
from live.batch.workers.hands import Hand, Hands, Told

log = logging.getLogger(__name__)
MOST_DEATHS = 3

Done = Callable[[Task, Row], Sequence[Task]]
"""Of a task that is done; gives those that can be done now."""


class Pool:
    """``workers`` processes at work on ``tasks``; ``told`` and ``done`` are called from threads.

    A task whose worker died three times is a failed row; those of other workers go on untouched. The
    processes come from ``hands``; whoever made that closes it.
    """

    def __init__(self, tasks: Sequence[Task], workers: int, told: Told, done: Done, hands: Hands) -> None:
        self._hands = hands
        self._waiting, self._deaths = deque(tasks), dict.fromkeys((task.title for task in tasks), 0)
        self._told, self._done = told, done
        self._stopped = threading.Event()
        self._workers: set[Hand] = set()
        self._lock = threading.Lock()
        n = min(workers, len(tasks))
        self._threads = [threading.Thread(target=self._serve, name="worker", daemon=True) for _ in range(n)]
        for thread in self._threads:
            thread.start()

    def wait(self, seconds: float) -> bool:
        """Whether all is done within ``seconds``."""
        for thread in self._threads:
            thread.join(seconds / len(self._threads))
        return not any(thread.is_alive() for thread in self._threads)

    def close(self) -> None:
        """End all workers, in the middle of a task too."""
        self._stopped.set()
        with self._lock:
            for worker in self._workers:
                worker.kill()
        for thread in self._threads:
            thread.join()

    def _serve(self) -> None:
        worker: Hand | None = None
        try:
            while (task := self._next()) is not None:
                worker = worker or self._new()
                row = worker.perform(task, self._told) if worker is not None else None
                if row is None:
                    self._end(worker)
                    worker, row = None, self._after_death(task)
                if row is not None:
                    self._add(self._done(task, row))
        finally:
            self._end(worker)

    def _next(self) -> Task | None:
        with self._lock:
            return self._waiting.popleft() if self._waiting and not self._stopped.is_set() else None

    def _add(self, tasks: Sequence[Task]) -> None:
        with self._lock:
            self._deaths |= dict.fromkeys((task.title for task in tasks), 0)
            self._waiting.extendleft(tasks)

    def _new(self) -> Hand | None:
        """None where no process can be started."""
        try:
            worker = self._hands.take()
        except OSError as error:
            log.error("no worker could be started: %s", error)
            return None
        with self._lock:
            self._workers.add(worker)
        if self._stopped.is_set():
            worker.kill()
        return worker

    def _end(self, worker: Hand | None) -> None:
        if worker is None:
            return
        worker.end()
        with self._lock:
            self._workers.discard(worker)

    def _after_death(self, task: Task) -> Row | None:
        """Once more, as the last of all; None then."""
        if self._stopped.is_set():
            return None
        self._deaths[task.title] += 1
        if self._deaths[task.title] < MOST_DEATHS:
            with self._lock:
                self._waiting.append(task)
            return None
        words = f"its worker died {MOST_DEATHS} times; is there memory enough for --workers?"
        return failed(task.title, task.source, words, 1)
