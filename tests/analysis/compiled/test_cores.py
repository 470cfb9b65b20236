"""The threads of a loop are not on the core of the one that called it."""

from __future__ import annotations

import os
import time
from typing import Any

import numba
import numpy as np
import pytest

from analysis.compiled import cores
from analysis.compiled.cores import caller, keep_apart
from analysis.compiled.layer import threading_layer

PARTS = 64


@numba.njit(parallel=True)
def where(threads: Any, found: Any) -> Any:
    """Thread and core of each part of a loop, and of its caller."""
    calling = caller()
    for part in numba.prange(PARTS):
        keep_apart(calling)
        threads[part], found[part] = cores._thread(), cores._core()
    return calling


@pytest.fixture(autouse=True)
def _caller_works() -> None:
    if threading_layer() == "workqueue":
        pytest.skip("the caller of a loop only waits here (test_layer.py)")


def _run() -> tuple[Any, np.ndarray, np.ndarray]:
    threads, found = np.zeros(PARTS, np.int64), np.zeros(PARTS, np.int64)
    return where(threads, found), threads, found


@pytest.mark.skipif(not cores.LINUX, reason="threads are told apart on Linux only")
def test_the_threads_of_a_loop_leave_the_core_of_its_caller() -> None:
    allowed = os.sched_getaffinity(0)
    for _ in range(20):
        (thread, mask, taken), threads, found = _run()
        (core,) = np.flatnonzero(taken)
        assert core in allowed
        assert taken[core] == thread
        assert {n for n in range(1024) if int(mask[n // 64]) >> n % 64 & 1} == allowed
        others = threads != thread
        if len(allowed) > 1:
            assert (found[others] != core).all()
            assert others.any() or numba.get_num_threads() == 1
        time.sleep(0.005)  # long enough for threads to fall asleep
    assert os.sched_getaffinity(0) == allowed, "the caller may go where it could"


@pytest.mark.skipif(not cores.LINUX, reason="threads are told apart on Linux only")
def test_on_one_core_they_stay() -> None:
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        (_, _, taken), _, found = _run()
        assert np.flatnonzero(taken).tolist() == [min(allowed)]
        assert set(found) <= allowed
    finally:
        os.sched_setaffinity(0, allowed)
