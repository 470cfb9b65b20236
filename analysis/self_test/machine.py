"""Whether this machine measures a known pattern right, and what it measures with."""

from __future__ import annotations

import importlib.metadata
from functools import lru_cache
from typing import Any

import numpy as np

from analysis.self_test.algebra import wrong_algebra
from analysis.self_test.known import Measure, Way, errors_of, limits


class MachineError(RuntimeError):
    """This machine computes wrong numbers: nothing may be measured on it."""


def check(measure: Measure, way: Way) -> None:
    """Solve known problems and measure a known pattern, once a process and way of measuring; a few ms.

    What passed is not tested again; what failed is, and fails again.

    Raises
    ------
    MachineError
        Something is out of limits. The message says what, and names the libraries.
    """
    _check_algebra()
    _check_measuring(measure, way.tested)


@lru_cache(maxsize=1)
def _check_algebra() -> None:
    wrong = wrong_algebra()
    if wrong:
        raise MachineError(f"{wrong} gives a wrong result on this machine; {_what_to_do()}")


@lru_cache(maxsize=256)
def _check_measuring(measure: Measure, way: Way) -> None:
    wrong = wrong_measuring(measure, way)
    if wrong:
        raise MachineError(
            f"this machine does not measure a known pattern right (self-test with ZOIs of {way.size} px: {wrong}); "
            f"{_what_to_do()}"
        )


def wrong_measuring(measure: Measure, way: Way) -> str:
    """What is wrong with the measuring of a known pattern; empty where nothing is."""
    try:
        with np.errstate(all="ignore"):  # whatever comes of a wrong library is looked at below
            found = errors_of(measure, way)
    except (ValueError, ArithmeticError, IndexError) as error:
        return f"{type(error).__name__}: {error}"
    allowed = limits(way)
    if found.refused:
        return f"{found.refused} of 4 ZOIs have no value"
    if found.length <= allowed.length and found.slope <= allowed.slope:
        return ""
    return (
        f"displacements {found.length:.4f} px off, limit {allowed.length:g}, "
        f"strains {found.slope * 1e6:.0f} um/m off, limit {allowed.slope * 1e6:.0f}"
    )


def _what_to_do() -> str:
    return (
        f"nothing is measured with {libraries()}; install other versions of these, or use another machine "
        "(under an emulator: another emulated processor)"
    )


def libraries() -> str:
    """The libraries that results depend on and their versions, in words."""
    from analysis.compiled.vectors import PROCESSOR

    names = [f"numpy {np.__version__} ({_linear_algebra()})"]
    names += [f"{name} {importlib.metadata.version(name)}" for name in ("scipy", "numba", "llvmlite")]
    return f"{', '.join(names)} on the processor {PROCESSOR}"


def _linear_algebra() -> str:
    """BLAS and LAPACK as numpy was built with them."""
    built: dict[str, Any] = dict(np.show_config(mode="dicts"))
    parts = built.get("Build Dependencies", {})
    found = [parts.get(kind, {}) for kind in ("blas", "lapack")]
    names = dict.fromkeys(f"{one.get('name', 'unknown')} {one.get('version', '')}".strip() for one in found)
    return f"BLAS and LAPACK: {', '.join(names)}"
