"""What is sent next: the small things all and at once, of fields and pictures the newest, a few a second."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

from live.view.exchange.messages import (
    Where,
    events_message,
    field_message,
    figures_message,
    picture_message,
    rows_message,
    setup_message,
)
from live.view.exchange.setup import ViewSetup
from live.view.exchange.wire import Kind, Message
from live.view.waiting import Past, Waiting, taken

Story = Callable[[], Iterable[Message]]
FIELD_HZ = 10.0
MOST_BYTES_S = 60e6
"""Of fields, and of pictures; very large ones are sent less often."""


class Supply:
    """Makes messages of what waits, and keeps what a process that is started anew must be told.

    Parameters
    ----------
    setup : ViewSetup
    waiting : Waiting
    story : callable
        Gives what else there is to tell, message by message and from the beginning, as fast as it is taken.

    Attributes
    ----------
    sent : dict of Kind to int
        Fields and pictures.
    """

    def __init__(self, setup: ViewSetup, waiting: Waiting, story: Story = lambda: ()) -> None:
        self._setup, self._waiting, self._past = setup, waiting, Past()
        self._story = story
        self._first: Iterator[Message] = iter(())
        self._due_t = {Kind.FIELD: -math.inf, Kind.PICTURE: -math.inf}
        self._ending = False
        self.sent = dict.fromkeys(self._due_t, 0)

    def begin(self, where: Where) -> None:
        """A process was started: it must be told everything."""
        self._first = self._all(where)

    def end(self) -> None:
        """Nothing comes any more: when all is sent, say so."""
        self._ending = True

    def _all(self, where: Where) -> Iterator[Message]:
        yield setup_message(self._setup, where)
        for kind, rows in self._past.rows.items():
            yield rows_message(kind, rows.items())
        yield events_message(list(self._past.events))
        if self._past.status is not None:
            yield Message(Kind.STATUS, {"markdown": self._past.status})
        yield from self._story()

    def next(self, now: float) -> Message | None:
        """What is to be sent at ``now`` (s, monotonic); None: nothing for the moment."""
        return next(self._first, None) or self._small() or self._large(now) or self._last()

    def _small(self) -> Message | None:
        waiting, past = self._waiting, self._past
        for kind, kept in waiting.rows.items():
            if kept:
                rows = taken(kept)
                for row in rows:
                    past.rows[kind].append(row)
                return rows_message(kind, rows)
        if waiting.events:
            events = taken(waiting.events)
            past.events.extend(events)
            return events_message(events)
        if waiting.status is not None:
            past.status, waiting.status = waiting.status, None
            return Message(Kind.STATUS, {"markdown": past.status})
        if waiting.figures is not None:
            figures, waiting.figures = waiting.figures, None
            return figures_message(figures)
        return None

    def _large(self, now: float) -> Message | None:
        waiting = self._waiting
        if waiting.field is not None and self._is_due(Kind.FIELD, now):
            (t, field), waiting.field = waiting.field, None
            return self._paced(field_message(t, field), now, FIELD_HZ)
        if waiting.picture is not None and self._is_due(Kind.PICTURE, now):
            frame, waiting.picture = waiting.picture, None
            return self._paced(picture_message(frame), now, self._setup.picture_hz)
        return None

    def _is_due(self, kind: Kind, now: float) -> bool:
        return now >= self._due_t[kind] or self._ending

    def _paced(self, message: Message, now: float, rate: float) -> Message:
        size = sum(array.nbytes for array in message.arrays.values())
        period = max(1 / rate, size / MOST_BYTES_S)
        self._due_t[message.kind] = max(self._due_t[message.kind] + period, now + period / 2)
        self.sent[message.kind] += 1
        return message

    def _last(self) -> Message | None:
        if not self._ending:
            return None
        # Said once to each process.
        self._ending = False
        return Message(Kind.END)
