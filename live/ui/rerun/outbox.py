"""What is sent next: the small things all and at once, of fields and pictures the newest, a few a second.

What has come for the view and was not yet sent; everything bounded, what goes is counted.

Filled by the threads of the test with one append each, emptied by the view's own. Rows are kept
all, of fields and pictures the newest.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

from live.pipeline.history import Thinned
from live.pipeline.snapshot import Snapshot
from live.ui.rerun.messages import (
    Row,
    ViewSetup,
    ViewTarget,
    events_message,
    field_message,
    figures_message,
    picture_message,
    rows_message,
    setup_message,
)
from live.ui.rerun.wire import Kind, Message

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from analysis.field import StrainField

MAX_ROWS, MAX_EVENTS = 20_000, 1000
HISTORY_ROWS = {Kind.MEANS: 5000, Kind.LOADS: 10_000, Kind.POINTS: 800}
"""What is kept of each to be told again."""


class Pending:
    """What waits to be sent.

    Attributes
    ----------
    rows : mapping of Kind to deque of Row
    events : deque of Event
    field : (t, StrainField) or None
    picture : Frame or None
    status : str or None
        Markdown.
    figures : Snapshot or None
    dropped : int
        Rows and events that were too many.
    """

    def __init__(self) -> None:
        self.rows: dict[Kind, deque[Row]] = {kind: deque() for kind in HISTORY_ROWS}
        self.events: deque[Event] = deque()
        self.field: tuple[float, StrainField] | None = None
        self.picture: Frame | None = None
        self.status: str | None = None
        self.figures: Snapshot | None = None
        self.dropped = 0

    def row(self, kind: Kind, row: Row) -> None:
        """Keep a row; of too many the oldest goes."""
        self._keep(self.rows[kind], row, MAX_ROWS)

    def event(self, event: Event) -> None:
        """Keep an event; of too many the oldest goes."""
        self._keep(self.events, event, MAX_EVENTS)

    def _keep(self, waiting: deque[Any], item: Any, limit: int) -> None:
        if len(waiting) >= limit:
            waiting.popleft()
            self.dropped += 1
        waiting.append(item)


def drained(waiting: deque[Any]) -> list[Any]:
    """All of it, which is then gone from there; another thread may append meanwhile."""
    return [waiting.popleft() for _ in range(len(waiting))]


class PastMessages:
    """What a process that is started anew must be told: rows thinned, the last events and the status.

    Attributes
    ----------
    rows : mapping of Kind to Thinned
    events : deque of Event
    status : str or None
    """

    def __init__(self) -> None:
        self.rows: dict[Kind, Thinned[Row]] = {kind: Thinned(limit) for kind, limit in HISTORY_ROWS.items()}
        self.events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self.status: str | None = None


MessageSource = Callable[[], Iterable[Message]]
FIELD_HZ = 10.0
MAX_BYTES_S = 60e6
"""Of fields, and of pictures; very large ones are sent less often."""


class Outbox:
    """Makes messages of what waits, and keeps what a process that is started anew must be told.

    Parameters
    ----------
    setup : ViewSetup
    pending : Pending
    story : callable
        Gives what else there is to tell, message by message and from the beginning, as fast as it is taken.

    Attributes
    ----------
    sent : dict of Kind to int
        Fields and pictures.
    """

    def __init__(self, setup: ViewSetup, pending: Pending, playback: MessageSource = lambda: ()) -> None:
        self._setup, self._pending, self._past = setup, pending, PastMessages()
        self._playback = playback
        self._first: Iterator[Message] = iter(())
        self._due_t = {Kind.FIELD: -math.inf, Kind.PICTURE: -math.inf}
        self._ending = False
        self.sent = dict.fromkeys(self._due_t, 0)

    def begin(self, target: ViewTarget) -> None:
        """A process was started: it must be told everything."""
        self._first = self._all(target)

    def end(self) -> None:
        """Nothing comes any more: when all is sent, say so."""
        self._ending = True

    def _all(self, target: ViewTarget) -> Iterator[Message]:
        yield setup_message(self._setup, target)
        for kind, rows in self._past.rows.items():
            yield rows_message(kind, rows.items())
        yield events_message(list(self._past.events))
        if self._past.status is not None:
            yield Message(Kind.STATUS, {"markdown": self._past.status})
        yield from self._playback()

    def next(self, now: float) -> Message | None:
        """What is to be sent at ``now`` (s, monotonic); None: nothing for the moment."""
        return next(self._first, None) or self._small() or self._large(now) or self._last()

    def _small(self) -> Message | None:
        pending, past = self._pending, self._past
        for kind, waiting in pending.rows.items():
            if waiting:
                rows = drained(waiting)
                for row in rows:
                    past.rows[kind].append(row)
                return rows_message(kind, rows)
        if pending.events:
            events = drained(pending.events)
            past.events.extend(events)
            return events_message(events)
        if pending.status is not None:
            past.status, pending.status = pending.status, None
            return Message(Kind.STATUS, {"markdown": past.status})
        if pending.figures is not None:
            figures, pending.figures = pending.figures, None
            return figures_message(figures)
        return None

    def _large(self, now: float) -> Message | None:
        pending = self._pending
        if pending.field is not None and self._is_due(Kind.FIELD, now):
            (t, field), pending.field = pending.field, None
            return self._paced(field_message(t, field), now, FIELD_HZ)
        if pending.picture is not None and self._is_due(Kind.PICTURE, now):
            frame, pending.picture = pending.picture, None
            return self._paced(picture_message(frame), now, self._setup.picture_hz)
        return None

    def _is_due(self, kind: Kind, now: float) -> bool:
        return now >= self._due_t[kind] or self._ending

    def _paced(self, message: Message, now: float, rate: float) -> Message:
        size = sum(array.nbytes for array in message.arrays.values())
        period = max(1 / rate, size / MAX_BYTES_S)
        self._due_t[message.kind] = max(self._due_t[message.kind] + period, now + period / 2)
        self.sent[message.kind] += 1
        return message

    def _last(self) -> Message | None:
        if not self._ending:
            return None
        # Said once to each process.
        self._ending = False
        return Message(Kind.END)
