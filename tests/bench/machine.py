"""What this machine can do: memory bandwidth and multiply-add rate, by plain loops in the same run."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
from numba import njit, prange

from analysis.compiled.vectors import LANES, fused, spread, total


def describe() -> str:
    model = "unknown processor"
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        model = names[0].partition(":")[2].strip() if names else model
    return (
        f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}, "
        f"numpy {np.__version__}, numba {numba.__version__}"
    )


@njit(parallel=True, fastmath=True, cache=True)
def _triad(a, b, c):
    for i in prange(a.size):
        a[i] = b[i] + np.float32(1.5) * c[i]


@njit(parallel=True, cache=True)
def _multiply_add(out, repeats):
    """Ten independent chains of v = v x + y in whole vectors: nothing waits, nothing is loaded."""
    for r in prange(out.shape[0]):
        x = spread(np.float32(0.999))
        y = spread(np.float32(0.001))
        # Ten different values, or the compiler would keep one chain for all.
        a, b, c = spread(np.float32(0.1)), spread(np.float32(0.2)), spread(np.float32(0.3))
        d, e, f = spread(np.float32(0.4)), spread(np.float32(0.5)), spread(np.float32(0.6))
        g, h, i, j = (
            spread(np.float32(0.7)),
            spread(np.float32(0.8)),
            spread(np.float32(0.9)),
            spread(np.float32(0.0)),
        )
        for _ in range(repeats):
            a = fused(a, x, y)
            b = fused(b, x, y)
            c = fused(c, x, y)
            d = fused(d, x, y)
            e = fused(e, x, y)
            f = fused(f, x, y)
            g = fused(g, x, y)
            h = fused(h, x, y)
            i = fused(i, x, y)
            j = fused(j, x, y)
        out[r] = total(a + b + c + d + e + (f + g + h + i + j))


def best(function, *arguments, repeats: int = 5) -> float:
    """Shortest of several wall times, s, after one run that is not counted."""
    function(*arguments)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function(*arguments)
        times.append(time.perf_counter() - start)
    return min(times)


def processor_s(function: Callable[[], object], repeats: int = 5) -> float:
    """Processor time of one call, s, all threads together: the mean of ``repeats``."""
    start = time.process_time()
    for _ in range(repeats):
        function()
    return (time.process_time() - start) / repeats


def bandwidth() -> float:
    """Bytes a second of a = b + s c on arrays beyond the caches."""
    n = 1 << 25
    arrays = [np.ones(n, np.float32) for _ in range(3)]
    return 3 * 4 * n / best(_triad, *arrays, repeats=3)


def arithmetic() -> float:
    """Floating-point operations a second of multiply-adds between registers: what no real loop reaches."""
    out = np.zeros(8, np.float32)
    repeats = 1_000_000
    return out.size * repeats * 20 * LANES / best(_multiply_add, out, repeats, repeats=4)
