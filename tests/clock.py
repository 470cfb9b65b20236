"""A clock for what is paced by one."""

from __future__ import annotations


class Clock:
    """A clock that a test moves by hand."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s
