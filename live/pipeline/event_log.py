"""The event log: every event goes once to the log, the screen, the session and the view.

A listener that is added later (the session is opened after the devices) gets the past events too, except
the one event for each burst, and those that came again and again (``Repeats``): they would fill the memory.

``Repeats`` counts these and keeps them once.
"""

from __future__ import annotations

import dataclasses
import logging
import re
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from acquire.events import Event, EventKind, EventSink, Level, RateLimiter, named
from acquire.text import Amount, Message, about
from acquire.text.message import brief, without_name

AS_THEY_COME = 3
"""So many events alike are kept one by one; of those that follow the newest alone, with their number."""
MAX_KINDS = 1000
_COUNTED = {
    EventKind.ALARM, EventKind.LOST, EventKind.DEVICE, EventKind.RECORDER, EventKind.MEASUREMENT, EventKind.VIEW,
}  # fmt: skip
"""Not commands, references and the operator's words, each of which stands for itself."""
_NUMBER = re.compile(r"(?<![\w.])\d[\d.,\u202f]*(?!\w)")  # not that of a name: a3.png and a4.png are two

Likeness = tuple[str, ...]


def likeness(event: Event) -> Likeness:
    """What events that are counted together have in common: all but the numbers in their texts."""
    return (event.kind.value, event.source, event.level, _NUMBER.sub("#", event.text))


class Repeats:
    """Events in the order of the newest of each kind; what is kept is bounded, however many come."""

    def __init__(self) -> None:
        self._kept: dict[int, tuple[Event, int]] = {}
        self._seen: dict[Likeness, tuple[int, int]] = {}
        self._number = 0

    def add(self, event: Event) -> int:
        """Keep an event; how many of its like there are with it."""
        self._number += 1
        count = 1
        if event.kind in _COUNTED:
            alike = likeness(event)
            if len(self._seen) >= MAX_KINDS and alike not in self._seen:
                alike = alike[:3]
            count, last = self._seen.get(alike, (0, 0))
            count += 1
            if count > AS_THEY_COME + 1:
                del self._kept[last]
            self._seen[alike] = (count, self._number)
        self._kept[self._number] = (event, count if count > AS_THEY_COME else 1)
        return count

    def __iter__(self) -> Iterator[tuple[Event, int]]:
        """Each event that is kept, and how many there were: 1, or all of its like up to this, the newest."""
        return iter(list(self._kept.values()))


log = logging.getLogger(__name__)
_LEVELS = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}
SHOWN_EVERY_S = 60.0
_SESSION_ONLY = {EventKind.MEASURED}  # one for each burst: not for a person


def counted_text(text: str, count: int) -> str:
    """The text of an event with the number of its like; the plain text of one that is alone."""
    return Message("{text} ({count} times)", text, Amount("count", count)) if count > 1 else text


def sentence(event: Event, names: Mapping[str, str] | None = None) -> str:
    """Source and text: a device by its name in ``names``, else by its address without settings, and only once."""
    source, text = brief(event.source), without_name(brief(event.text), brief(event.source))
    return about((names or {}).get(event.source) or named(source), text)


class EventLog:
    """Collects events from any thread and passes them to its listeners.

    Attributes
    ----------
    origin : float, s
        Subtracted from the stamps of devices and of ``emit``; not 0 where the pictures have nominal
        times from 0, so that events and pictures share one time.
    names : dict of str to str
        Names of devices on the screen, by their addresses.
    """

    def __init__(self) -> None:
        self.origin = 0.0
        self.names: dict[str, str] = {}
        self._events, self._levels = Repeats(), Counter[Level]()
        self._shown: dict[Likeness, RateLimiter] = {}
        self._listeners: list[EventSink] = []
        self._lock = threading.RLock()

    def __call__(self, event: Event) -> None:
        """Take an event stamped by this machine's clock; makes the log an ``EventSink``."""
        self.record(dataclasses.replace(event, t=event.t - self.origin) if self.origin else event)

    def record(self, event: Event) -> None:
        """Take an event stamped with the time of a frame."""
        with self._lock:
            count = 0
            if event.kind not in _SESSION_ONLY:
                count = self._events.add(event)
                self._levels[event.level] += 1
            listeners = list(self._listeners)
        if count:
            self._log(event, count)
        for listener in listeners:
            listener(event)

    def _log(self, event: Event, count: int) -> None:
        """Each of the first of its like; of those that follow one a minute, with their number."""
        level, words = _LEVELS[event.level], sentence(event, self.names)
        if count > AS_THEY_COME:
            words = counted_text(words, count)
            if not self._shown.setdefault(likeness(event), RateLimiter(SHOWN_EVERY_S)).due(event.t):
                level = logging.DEBUG
        log.log(level, words)

    def emit(
        self,
        kind: EventKind,
        source: str,
        text: str,
        level: Level = "info",
        data: Mapping[str, Any] | None = None,
    ) -> None:
        """Make an event with the present time, and take it."""
        self(Event(time.monotonic(), kind, source, text, level, data or {}))

    def add_listener(self, listener: EventSink) -> None:
        """Pass all past and future events to ``listener``."""
        with self._lock:
            self._listeners.append(listener)
            past = self.events()
        for event in past:
            listener(event)

    def events(self, *levels: Level) -> list[Event]:
        """The events so far, of the given levels (of all where none is given); of repeated ones a few."""
        with self._lock:
            return [e for e, _ in self._events if not levels or e.level in levels]

    def count(self, level: Level) -> int:
        """How many events of this level there were, each repeated one counted."""
        with self._lock:
            return self._levels[level]
