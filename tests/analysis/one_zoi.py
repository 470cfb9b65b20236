"""The verdict on one ZOI of an even pattern, by value."""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.field import Status
from analysis.fit.kernel_args import CONVERGED, OutArgs, PooledError, ReferenceArgs, VerdictArgs
from analysis.fit.verdict import judge

PIXELS, SIGNAL, EXPECTED, UNIT = 200.0, 1e4, 4.0, 1e-6
FORGIVING = 1.05 + 4 * np.sqrt(2 / PIXELS)
"""What noise alone may leave over EXPECTED: 5 %, and 4 standard deviations of a variance of so many pixels, more."""


def verdict(
    left: float = EXPECTED, *, expected: float = EXPECTED, gain: float = 1.0, bending: float = 0.0,
    state: int = CONVERGED, iterations: int = 3, values: np.ndarray | None = None, common: PooledError | None = None,
    known: bool = True, noise: tuple[float, float] = (1.0, 1.0), limit: float = 0.05, **of_reference: Any,
) -> Status:  # fmt: skip
    """Of a ZOI that leaves ``left`` GL^2; ``of_reference`` are other values than those of an even pattern."""
    found, one = OutArgs.starting(np.zeros((1, 6)) if values is None else values), np.ones(1)
    found.left[:], found.bending[:], found.nuisance[:] = left, bending, (gain, 0, 0)
    found.state[:], found.iterations[:] = state, iterations
    even = ReferenceArgs(
        SIGNAL * one, PIXELS * one, np.full((1, 2), UNIT), 1e-3 * one, np.ones(2), 1.0, 1.0, 1e3 * one, 0.5
    )
    args = even._replace(**{name: np.asarray(value) for name, value in of_reference.items()})
    rule, out = VerdictArgs(known, np.array(noise), 5.0, limit, 4.0, 6.0), np.zeros(1, np.uint8)
    judge(found, found.left, expected * one, common or PooledError.none(1), args, rule, out)
    return Status(int(out[0]))
