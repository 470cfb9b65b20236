"""numba's threading layer: its name, whether the caller of a loop works on it, and the lock it starts under.

With OpenMP and TBB the caller is one of the threads. With numba's own workqueue, the only layer where neither
of them is installed, it waits: its core is free for the threads of the loop.

numba starts its threads under a lock of Python's default way to start processes. Since Python 3.14 that is a
named semaphore, and Python starts a process to remove it, which complains on standard error whenever ours is
ended by a signal, as the workers of a batch always are. The lock of the former default has no name once it is made.
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
_START_LOCK = "_backend_init_process_lock"
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
    """In a loop: whether the thread that calls it works on it, 1 or 0; after a call of ``threading_layer``."""

    def generate(_context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        value = builder.module.globals.get(_NAME) or ir.GlobalVariable(builder.module, _INT, _NAME)
        return builder.load(value)

    return types.int32(), generate


def give_start_lock(threads: Any) -> None:
    """Give ``threads`` (``numba.np.ufunc.parallel``) the nameless lock, where it has none yet and there is one."""
    if getattr(threads, _START_LOCK, threads) is not None:
        return
    # Without fork or semaphores on this system: numba makes its own.
    with contextlib.suppress(ValueError, OSError):
        setattr(threads, _START_LOCK, multiprocessing.get_context("fork").RLock())
