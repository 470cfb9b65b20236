"""The compiled loops of the renderer and the sensor. Imported when a pattern is first rendered.

No package of ours is used here: the simulated truth shares no code with what measures it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.compiled_loops import njit

GOLDEN = 0x9E3779B97F4A7C15  # step of SplitMix64


@njit(cache=True, error_model="numpy", inline="always")
def _exp(a: Any) -> Any:
    """exp of a in [-25, 0] in float32 to 3e-6 of itself (1e-2 of it below -15); vectorises.

    exp(a) = exp(a / 32)^32: the polynomial only meets small arguments.
    """
    q = a * np.float32(1 / 32)
    p = np.float32(1) + q * (
        np.float32(1)
        + q * (np.float32(0.5) + q * (np.float32(1 / 6) + q * (np.float32(1 / 24) + q * np.float32(1 / 120))))
    )
    p *= p
    p *= p
    p *= p
    p *= p
    return p * p


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc"})
def splat(
    canvas: NDArray[np.float32],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    amplitude: NDArray[np.float32],
    a: NDArray[np.float32],
    b: NDArray[np.float32],
    c: NDArray[np.float32],
    reach: float,
    columns: int,
) -> None:
    """Add ``amplitude exp(-(a dx^2 + 2 b dx dy + c dy^2) / 2)`` at each (x, y) of the canvas.

    The two axes separate but for exp(-b dx dy), which shear alone makes differ from 1 and which a
    polynomial of fourth degree gives to 1e-6 of the amplitude for shear up to 0.05.
    """
    height, width = canvas.shape
    rows = int(2 * reach) + 2
    dx = np.empty(columns, np.float32)
    ex = np.empty(columns, np.float32)
    half, sixth, part = np.float32(0.5), np.float32(1 / 6), np.float32(1 / 24)
    one = np.float32(1)
    for i in range(x.size):
        left, top = math.floor(x[i] - reach), math.floor(y[i] - reach)
        if not (left >= 0 and top >= 0 and left + columns <= width and top + rows <= height):
            continue
        x0, y0 = int(left), int(top)
        fx, fy = np.float32(x0 - x[i]), np.float32(y0 - y[i])
        for k in range(columns):
            dx[k] = fx + np.float32(k)
            ex[k] = _exp(-half * a[i] * dx[k] * dx[k])
        for j in range(rows):
            dy = fy + np.float32(j)
            ey = amplitude[i] * _exp(-half * c[i] * dy * dy)
            row = canvas[y0 + j, x0 : x0 + columns]
            if b[i] == 0:
                for k in range(columns):
                    row[k] += ey * ex[k]
                continue
            shear = -b[i] * dy
            for k in range(columns):
                z = shear * dx[k]
                row[k] += ey * ex[k] * (one + z * (one + z * (half + z * (sixth + z * part))))


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    first: NDArray[np.int64],
    bx: NDArray[np.float64],
    by: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    origin: float,
    bin_size: float,
    bins: tuple[int, int],
    radius: float,
    reach: float,
) -> NDArray[np.float64]:
    """Sum of all blobs within ``reach`` of each (x, y), in double precision.

    Blobs are sorted into square bins of side ``bin_size`` >= reach; bin (r, c) holds blobs
    ``first[r * bins[1] + c]`` up to the next entry.
    """
    out = np.zeros(x.size)
    scale = -0.5 / (radius * radius)
    for p in range(x.size):
        column = math.floor((x[p] - origin) / bin_size)
        row = math.floor((y[p] - origin) / bin_size)
        total = 0.0
        for r in range(max(row - 1, 0), min(row + 2, bins[0])):
            for c in range(max(column - 1, 0), min(column + 2, bins[1])):
                cell = r * bins[1] + c
                for k in range(first[cell], first[cell + 1]):
                    dx, dy = x[p] - bx[k], y[p] - by[k]
                    square = dx * dx + dy * dy
                    if square <= reach * reach:
                        total += amplitude[k] * math.exp(scale * square)
        out[p] = total
    return out


@njit(cache=True, error_model="numpy", inline="always")
def _mixed(state: Any) -> Any:
    """The output function of SplitMix64 (Steele, Lea and Flood 2014, doi 10.1145/2660193.2660195)."""
    z = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True, nogil=True, error_model="numpy")
def expose(
    light: NDArray[np.float32],
    state: np.uint64,
    quantiles: NDArray[np.float32],
    fixed: NDArray[np.float32],
    scale: float,
    offset: float,
    gain: float,
    read_variance: float,
    top: float,
    out: NDArray[Any],
) -> None:
    """Counts of one exposure: signal, shot and read noise, fixed pattern, rounded and saturated.

    Flat arrays; grey levels but for ``light`` (part of full scale). Each pixel takes 16 bits of the
    SplitMix64 sequence from ``state`` on, which pick its noise from the 65536 ``quantiles`` of the
    normal distribution.
    """
    s, o, k, r = np.float32(scale), np.float32(offset), np.float32(gain), np.float32(read_variance)
    limit, half, nothing = np.float32(top), np.float32(0.5), np.float32(0)
    step, low = np.uint64(GOLDEN), np.uint64(0xFFFF)
    for first in range(0, light.size, 4):
        state += step
        bits = _mixed(state)
        for i in range(first, min(first + 4, light.size)):
            signal = max(light[i], nothing) * s
            noise = quantiles[bits & low] * math.sqrt(k * signal + r)
            bits >>= np.uint64(16)
            out[i] = min(max(np.floor(signal + o + fixed[i] + noise + half), nothing), limit)
