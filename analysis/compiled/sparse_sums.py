"""Sums over the ZOIs of many gauges, and the variances of such sums over ZOIs that overlap."""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.compiled.loops import helper


@helper
def row_sums(first: Any, at: Any, weights: Any, maps: Any, out: Any) -> None:
    """Sparse rows, from ``first[m]`` to ``first[m + 1]``, times maps (K, N), written to ``out`` (M, K)."""
    for m in range(len(out)):
        for k in range(len(maps)):
            values, total = maps[k], 0.0
            for i in range(first[m], first[m + 1]):
                total += weights[i] * values[at[i]]
            out[m, k] = total


@helper
def overlapping(
    first: Any, at: Any, shares: Any, pairs: Any, factors: Any, kinds: Any, overlaps: Any, columns: int,
    covariance: Any, out: Any,
) -> None:  # fmt: skip
    """Variances (G,) of sums over overlapping ZOIs: sigma_i sigma_j rho(lag_ij), over all pairs of those of a sum.

    sigma is a share, with its sign, times the root of three of the ``covariance`` (21, N), ``pairs`` (G, 3), by
    ``factors`` (G, 3); rho are the ``overlaps`` (4, Y, X) of one of its ``kinds`` (G,), of ZOIs so many rows and
    columns apart.
    """
    noise = np.zeros(covariance.shape[1])
    rows, down, across = len(noise) // columns, overlaps.shape[1], overlaps.shape[2]
    for g in range(len(out)):
        total, rho = 0.0, overlaps[kinds[g]]
        for i in range(first[g], first[g + 1]):
            variance = 0.0
            for k in range(3):
                variance += factors[g, k] * covariance[pairs[g, k], at[i]]
            noise[at[i]] = shares[i] * np.sqrt(0.0 if variance < 0 else variance)
        for i in range(first[g], first[g + 1]):
            y, x = at[i] // columns, at[i] % columns
            for row in range(max(y - down + 1, 0), min(y + down, rows)):
                for column in range(max(x - across + 1, 0), min(x + across, columns)):
                    there = noise[row * columns + column]
                    total += noise[at[i]] * rho[abs(row - y), abs(column - x)] * there
        for i in range(first[g], first[g + 1]):
            noise[at[i]] = 0.0
        out[g] = total
