"""What this machine can do: memory bandwidth and multiply-add rate, by plain loops in the same run."""

from __future__ import annotations

import os
import platform
import time
from pathlib import Path

import numba
import numpy as np
from numba import njit, prange


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


@njit(parallel=True, fastmath=True, cache=True)
def _multiply_add(rows, out, repeats):
    for r in prange(rows.shape[0]):
        row = rows[r]
        to = out[r]
        for _ in range(repeats):
            for k in range(row.size):
                x = row[k]
                y = x * x + np.float32(0.1)
                y = y * x + np.float32(0.2)
                y = y * x + np.float32(0.3)
                y = y * x + np.float32(0.4)
                y = y * x + np.float32(0.5)
                y = y * x + np.float32(0.6)
                y = y * x + np.float32(0.7)
                y = y * x + np.float32(0.8)
                y = y * x + np.float32(0.9)
                y = y * x + np.float32(0.11)
                y = y * x + np.float32(0.12)
                y = y * x + np.float32(0.13)
                y = y * x + np.float32(0.14)
                y = y * x + np.float32(0.15)
                y = y * x + np.float32(0.16)
                to[k] += y * x + np.float32(0.17)


def best(function, *arguments, repeats: int = 5) -> float:
    """Shortest of several wall times, s, after one run that is not counted."""
    function(*arguments)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function(*arguments)
        times.append(time.perf_counter() - start)
    return min(times)


def bandwidth() -> float:
    """Bytes a second of a = b + s c on arrays beyond the caches."""
    n = 1 << 25
    arrays = [np.ones(n, np.float32) for _ in range(3)]
    return 3 * 4 * n / best(_triad, *arrays, repeats=3)


def arithmetic() -> float:
    """Floating-point operations a second of a polynomial over arrays within the first cache."""
    rows = np.full((8, 1024), 0.5, np.float32)
    out = np.zeros_like(rows)
    repeats = 2000
    return rows.size * repeats * 33 / best(_multiply_add, rows, out, repeats, repeats=4)
