"""Sends messages to all open pages: of each kind the newest, so that a page that does not read delays nothing."""

from __future__ import annotations

import json
import math
import threading
from typing import Any

from acquire.text import Amount, Message

MAX_PAGES = 8
"""Pages that may be open at one time."""


def plain(value: Any) -> Any:
    """A value as JSON can hold it; NaN and infinity become None, messages and quantities stay data."""
    if isinstance(value, Message | Amount):
        return plain(value.to_json())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.item() if hasattr(value, "item") else value


def json_bytes(value: Any) -> bytes:
    """JSON in one line."""
    return json.dumps(plain(value), allow_nan=False, separators=(",", ":")).encode()


class PageStream:
    """The messages that wait for one page: one of each kind.

    A kind is a word that the page hears; a name after it, as in "run back", keeps the messages of a camera apart.
    """

    def __init__(self) -> None:
        self._waiting: dict[str, bytes] = {}
        self._changed = threading.Condition()
        self._closed = False

    def put(self, kind: str, message: bytes) -> None:
        """Replace the waiting message of this kind; never waits for the page."""
        with self._changed:
            self._waiting[kind] = message
            self._changed.notify()

    def close(self) -> None:
        """Accept no more messages; those that wait can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def take(self, timeout_s: float) -> dict[str, bytes] | None:
        """All waiting messages, none after ``timeout_s``; None once it is closed and empty."""
        with self._changed:
            if not self._waiting and not self._closed:
                self._changed.wait(timeout_s)
            taken, self._waiting = self._waiting, {}
            return None if self._closed and not taken else taken


class Broadcaster:
    """Passes messages to all subscribers; a new one first gets the newest of each kind."""

    def __init__(self) -> None:
        self._subscribers: set[PageStream] = set()
        self._newest: dict[str, bytes] = {}
        self._lock = threading.Lock()
        self._closed = False

    @property
    def open_pages(self) -> int:
        """Number of open pages."""
        return len(self._subscribers)

    def publish(self, kind: str, value: Any) -> None:
        """Send a message to every page."""
        message = json_bytes(value)
        with self._lock:
            self._newest[kind] = message
            for subscriber in self._subscribers:
                subscriber.put(kind, message)

    def open(self) -> PageStream | None:
        """A new subscriber; None where ``MAX_PAGES`` are open, or after ``close``."""
        with self._lock:
            if self._closed or len(self._subscribers) >= MAX_PAGES:
                return None
            subscriber = PageStream()
            for kind, message in self._newest.items():
                subscriber.put(kind, message)
            self._subscribers.add(subscriber)
            return subscriber

    def remove(self, subscriber: PageStream) -> None:
        """Remove a page that was closed."""
        with self._lock:
            self._subscribers.discard(subscriber)

    def close(self) -> None:
        """Close all subscribers."""
        with self._lock:
            self._closed = True
            for subscriber in self._subscribers:
                subscriber.close()
