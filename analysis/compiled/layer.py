"""Which of numba's threading layers runs the loops, and whether the thread that calls a loop works on it too.

With OpenMP and TBB the caller is one of the threads. With numba's own workqueue, which is all there is where neither
of them is installed, it only waits: its core is free for the threads of the loop.

The lock under which numba starts its threads: one that leaves nothing behind.

numba asks for a lock of Python's default way to start processes. Since Python 3.14 that is a named semaphore,
and Python starts a process to see to it, which complains on standard error whenever ours is ended by a signal:
so do the workers of a batch, always. The lock of the default until then has no name once it is made.
"""

from __future__ import annotations

import contextlib
import multiprocessing
from typing import Any

import numba
import numpy as np
from llvmlite import binding, ir
from numba.core import types
from numba.extending import intrinsic

_INT = ir.IntType(32)
_NAME = "phasedic_caller_works"
_WORKS = np.ones(1, np.int32)
# Compiled code is kept for the next process, where the layer may be another one: it reads this by its name.
binding.add_symbol(_NAME, _WORKS.ctypes.data)


def threading_layer() -> str:
    """Start the threads, where they are not, and name the layer: "omp", "tbb" or "workqueue"."""
    numba.get_num_threads()
    layer: str = numba.threading_layer()
    _WORKS[0] = layer != "workqueue"
    return layer


@intrinsic
def caller_works(_typing: Any) -> Any:
    """In a loop: whether the thread that calls it works on it, 1 or 0; once ``threading_layer`` was asked."""

    def generate(_context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        value = builder.module.globals.get(_NAME) or ir.GlobalVariable(builder.module, _INT, _NAME)
        return builder.load(value)

    return types.int32(), generate


_NAME_START_LOCK = "_backend_init_process_lock"


def give_start_lock(threads: Any) -> None:
    """Give ``threads`` (``numba.np.ufunc.parallel``) the nameless lock, where it has none yet and there is one."""
    if getattr(threads, _NAME_START_LOCK, threads) is not None:
        return
    with contextlib.suppress(
        ValueError, OSError
    ):  # no fork on this system, or no semaphores: numba sees to it
        setattr(threads, _NAME_START_LOCK, multiprocessing.get_context("fork").RLock())
