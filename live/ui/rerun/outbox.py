"""What is sent to the process of the view: rows and events all and at once, the newest field and picture at a rate.

The threads of the test append to ``Pending``; the thread of the view empties it through ``Outbox``. Everything is
bounded; what is dropped is counted.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from live.pipeline.queues import Thinned
from live.pipeline.snapshot import Snapshot
from live.ui.rerun import messages
from live.ui.rerun.wire import Kind, Parcel

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from analysis.field import StrainField
    from live.pipeline.timed.course import Floats

MAX_ROWS, MAX_EVENTS = 20_000, 1000
HISTORY_ROWS = {Kind.MEANS: 5000, Kind.LOADS: 10_000, Kind.POINTS: 800}
"""Rows kept of each kind for a restarted process."""

FIELD_HZ = 10.0
MAX_BYTES_S = 60e6
"""Of fields, and of pictures, each; very large ones are sent less often."""

MessageSource = Callable[[], Iterable[Parcel]]


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
    whole : mapping of str to (R, C) array
        Maps of the whole test so far.
    dropped : int
        Rows and events dropped because too many waited.
    """

    def __init__(self) -> None:
        self.rows: dict[Kind, deque[messages.Row]] = {kind: deque() for kind in HISTORY_ROWS}
        self.events: deque[Event] = deque()
        self.field: tuple[float, StrainField] | None = None
        self.picture: Frame | None = None
        self.status: str | None = None
        self.figures: Snapshot | None = None
        self.whole: Mapping[str, Floats] = {}
        self.dropped = 0

    def row(self, kind: Kind, row: messages.Row) -> None:
        """Keep a row; the oldest is dropped where too many wait."""
        self._keep(self.rows[kind], row, MAX_ROWS)

    def event(self, event: Event) -> None:
        """Keep an event; the oldest is dropped where too many wait."""
        self._keep(self.events, event, MAX_EVENTS)

    def _keep(self, waiting: deque[Any], item: Any, limit: int) -> None:
        if len(waiting) >= limit:
            waiting.popleft()
            self.dropped += 1
        waiting.append(item)


def drained(waiting: deque[Any]) -> list[Any]:
    """Remove and return all items; another thread may append meanwhile."""
    return [waiting.popleft() for _ in range(len(waiting))]


class PastMessages:
    """What a restarted process gets: thinned rows, the last events and the status.

    Attributes
    ----------
    rows : mapping of Kind to Thinned
    events : deque of Event
    status : str or None
    whole : mapping of str to (R, C) array
    """

    def __init__(self) -> None:
        self.rows: dict[Kind, Thinned[messages.Row]] = {
            kind: Thinned(limit) for kind, limit in HISTORY_ROWS.items()
        }
        self.events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self.status: str | None = None
        self.whole: Mapping[str, Floats] = {}


class Outbox:
    """Makes messages of what waits, and keeps what a restarted process gets.

    Parameters
    ----------
    setup : ViewSetup
    pending : Pending
    playback : callable
        Gives further messages for each new process, from the beginning, one at a time.

    Attributes
    ----------
    sent : dict of Kind to int
        Numbers of fields and pictures sent.
    """

    def __init__(
        self, setup: messages.ViewSetup, pending: Pending, playback: MessageSource = lambda: ()
    ) -> None:
        self._setup, self._pending, self._past = setup, pending, PastMessages()
        self._playback = playback
        self._first: Iterator[Parcel] = iter(())
        self._due_t = {Kind.FIELD: -math.inf, Kind.PICTURE: -math.inf}
        self._ending = False
        self.sent = dict.fromkeys(self._due_t, 0)

    def begin(self, target: messages.ViewTarget) -> None:
        """A process was started: send everything."""
        self._first = self._all(target)

    def end(self) -> None:
        """Send END after what waits."""
        self._ending = True

    def _all(self, target: messages.ViewTarget) -> Iterator[Parcel]:
        yield messages.setup_message(self._setup, target)
        for kind, rows in self._past.rows.items():
            yield messages.rows_message(kind, rows.items())
        yield messages.events_message(list(self._past.events))
        if self._past.status is not None:
            yield Parcel(Kind.STATUS, {"markdown": self._past.status})
        if self._past.whole:
            yield Parcel(Kind.WHOLE, {}, {**self._past.whole})
        yield from self._playback()

    def next(self, now: float) -> Parcel | None:
        """The message due at ``now`` (s, monotonic); None: nothing yet."""
        return next(self._first, None) or self._small() or self._large(now) or self._last()

    def _small(self) -> Parcel | None:
        pending, past = self._pending, self._past
        for kind, waiting in pending.rows.items():
            if waiting:
                rows = drained(waiting)
                for row in rows:
                    past.rows[kind].append(row)
                return messages.rows_message(kind, rows)
        if pending.events:
            events = drained(pending.events)
            past.events.extend(events)
            return messages.events_message(events)
        if pending.status is not None:
            past.status, pending.status = pending.status, None
            return Parcel(Kind.STATUS, {"markdown": past.status})
        if pending.whole:
            past.whole, pending.whole = pending.whole, {}
            return Parcel(Kind.WHOLE, {}, {**past.whole})
        if pending.figures is not None:
            figures, pending.figures = pending.figures, None
            return messages.figures_message(figures)
        return None

    def _large(self, now: float) -> Parcel | None:
        pending = self._pending
        if pending.field is not None and self._is_due(Kind.FIELD, now):
            (t, field), pending.field = pending.field, None
            return self._paced(messages.field_message(t, field), now, FIELD_HZ)
        if pending.picture is not None and self._is_due(Kind.PICTURE, now):
            frame, pending.picture = pending.picture, None
            return self._paced(messages.picture_message(frame), now, self._setup.picture_hz)
        return None

    def _is_due(self, kind: Kind, now: float) -> bool:
        return now >= self._due_t[kind] or self._ending

    def _paced(self, message: Parcel, now: float, rate: float) -> Parcel:
        size = sum(array.nbytes for array in message.arrays.values())
        period = max(1 / rate, size / MAX_BYTES_S)
        self._due_t[message.kind] = max(self._due_t[message.kind] + period, now + period / 2)
        self.sent[message.kind] += 1
        return message

    def _last(self) -> Parcel | None:
        if not self._ending:
            return None
        # Once for each process.
        self._ending = False
        return Parcel(Kind.END)
