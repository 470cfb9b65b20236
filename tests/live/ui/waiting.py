"""Waits for a condition that another thread or process makes true."""

from __future__ import annotations

import time
from collections.abc import Callable

LONG_S = 120.0
"""Limit for anything that normally takes a moment; the machine may be busy."""


def until(condition: Callable[[], object], timeout_s: float = LONG_S) -> None:
    """Wait until ``condition`` holds; fail after ``timeout_s``."""
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, f"not true within {timeout_s:g} s"
        time.sleep(0.02)
