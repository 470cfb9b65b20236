"""What follows what in a campaign: chunks, then what joins them; a test whole where its chunks cannot stand for it."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence

from live.batch.cutting import Cut, joined
from live.batch.standing import Standing
from live.batch.work import RENEWED, Progress, Row, Task, failed
from live.measure import Screen


class Course:
    """Told of every task that is done, from any thread.

    Parameters
    ----------
    tasks : sequence of Task
        One a test.
    cuts : mapping of name to Cut
        The tests that are cut.
    rows : dict of name to Row
        Filled as tests come to their end.
    standing : Standing
    screen : Screen
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        cuts: Mapping[str, Cut],
        rows: dict[str, Row],
        standing: Standing,
        screen: Screen,
    ) -> None:
        self._tests = {task.name: task for task in tasks}
        self._cuts = {name: found for name, found in cuts.items() if found.chunks}
        self._left = {name: {chunk.name for chunk in found.chunks} for name, found in self._cuts.items()}
        self._rows, self._standing, self._screen = rows, standing, screen
        self._lock = threading.Lock()

    def first(self) -> list[Task]:
        """What can be done at once."""
        found: list[Task] = []
        for name, task in self._tests.items():
            pieces = self._cuts[name].chunks if name in self._cuts else (task,)
            for piece in pieces:
                self._standing.expect(piece.title, 1 / len(pieces))
            found += pieces
        return found

    def told(self, task: Task, progress: Progress) -> None:
        """How far a task is."""
        if not task.chunks:  # its chunks have told all that
            self._standing.told(task.title, progress)

    def done(self, task: Task, row: Row) -> Sequence[Task]:
        """It has come to its end; what can be done now."""
        self._standing.done(task.title)
        if task.of:
            with self._lock:
                return self._chunk_done(task, row)
        self._end(task.name, row)
        return ()

    def _end(self, name: str, row: Row) -> None:
        self._rows[name] = row
        self._standing.ended()
        if not row.is_well:
            self._screen.say(row.words)

    def _chunk_done(self, task: Task, row: Row) -> Sequence[Task]:
        name = task.of
        if name not in self._left:
            return ()  # it has failed, or is done whole
        if row.values["outcome"] == RENEWED:
            return self._whole(name)
        if not row.is_done:
            del self._left[name]
            code = int(row.values["exit_code"] or 1)
            self._end(name, failed(name, task.source, str(row.values["error"]), code))
            return ()
        self._left[name].discard(task.name)
        return () if self._left[name] else [joined(self._tests[name], self._cuts[name])]

    def _whole(self, name: str) -> Sequence[Task]:
        del self._left[name]
        self._screen.say(f"{name}: a reference was renewed in it; it is not cut, but done whole")
        for chunk in self._cuts[name].chunks:
            self._standing.expect(chunk.title, 0)
        self._standing.expect(name)
        return [self._tests[name]]
