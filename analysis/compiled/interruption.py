"""Ending a long computation before its time: between its compiled loops it looks whether it is still wanted.

A burst of tens of thousands of ZOIs takes many seconds; the longest of its loops takes one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_unwanted: ContextVar[Callable[[], bool]] = ContextVar("unwanted", default=lambda: False)


class Abandoned(KeyboardInterrupt):
    """The computation was ended by its caller; no failure of what was computed."""


@contextmanager
def abandoned_when(unwanted: Callable[[], bool]) -> Iterator[None]:
    """Computations of this thread end with ``Abandoned`` within the context, once ``unwanted`` gives True."""
    token = _unwanted.set(unwanted)
    try:
        yield
    finally:
        _unwanted.reset(token)


def go_on() -> None:
    """Return where the computation is still wanted; raises Abandoned where it is not."""
    if _unwanted.get()():
        raise Abandoned
