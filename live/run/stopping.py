"""The wish to end a test: said once, from anywhere, heard by everybody."""

from __future__ import annotations

import threading
from collections.abc import Callable


class Stop:
    """Asked from any thread or signal handler; the first reason counts.

    Attributes
    ----------
    reason : str
        Empty until it was asked.
    """

    def __init__(self) -> None:
        self.reason = ""
        self._asked = threading.Event()
        self._hearers: list[Callable[[], None]] = []

    def ask(self, reason: str) -> None:
        """End the test cleanly, soon."""
        self.reason = self.reason or reason
        self._asked.set()
        for hear in list(self._hearers):
            hear()

    def then(self, hear: Callable[[], None]) -> None:
        """Call ``hear``, which must stand being called twice, when it is asked; at once where it has been."""
        self._hearers.append(hear)
        if self._asked.is_set():
            hear()

    @property
    def asked(self) -> bool:
        """Whether somebody has asked."""
        return self._asked.is_set()
