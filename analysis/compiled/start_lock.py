"""The lock under which numba starts its threads: one that leaves nothing behind.

numba asks for a lock of Python's default way to start processes. Since Python 3.14 that is a named semaphore,
and Python starts a process to see to it, which complains on standard error whenever ours is ended by a signal:
so do the workers of a batch, always. The lock of the default until then has no name once it is made.
"""

from __future__ import annotations

import contextlib
import multiprocessing
from typing import Any

_NAME = "_backend_init_process_lock"


def give_start_lock(threads: Any) -> None:
    """Give ``threads`` (``numba.np.ufunc.parallel``) the nameless lock, where it has none yet and there is one."""
    if getattr(threads, _NAME, threads) is not None:
        return
    with contextlib.suppress(
        ValueError, OSError
    ):  # no fork on this system, or no semaphores: numba sees to it
        setattr(threads, _NAME, multiprocessing.get_context("fork").RLock())
