"""How the inner loops are compiled: once per machine, kept in numba's cache, announced.

numba keeps compiled code beside this package where that folder can be written, else in the
user's cache folder; NUMBA_CACHE_DIR overrides both. Importing this module imports numba, so the
rest of the package does that only when a kernel is made.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba

log = logging.getLogger("analysis")

_PACKAGE = Path(__file__).parents[1]
# Sums may be reordered for the vector unit, but NaN and infinity keep their meaning.
FAST = {"contract", "reassoc", "nsz", "arcp", "afn"}


def inlined(function: Callable[..., Any]) -> Any:
    """A helper that becomes part of the loops that call it."""
    return numba.njit(function, error_model="numpy", fastmath=FAST, inline="always")


def helper(function: Callable[..., Any]) -> Any:
    """A function called from compiled loops; small or inlined by the compiler as it sees fit."""
    return _stamped(numba.njit(function, error_model="numpy", fastmath=FAST, cache=True, nogil=True))


def parallel(function: Callable[..., Any]) -> Any:
    """A loop over ZOIs or rows, shared among the threads; each item is done by one of them."""
    options = {"error_model": "numpy", "fastmath": FAST, "cache": True, "nogil": True, "parallel": True}
    return _stamped(numba.njit(function, **options))


def _stamped(dispatcher: Any) -> Any:
    """The same, compiled anew when any of the compiled modules has changed.

    numba itself looks only at the file of the function, and would run the old code of its helpers.
    """
    try:
        dispatcher._cache._cache_file._source_stamp = _stamp()
    except AttributeError:  # numba's own affair: an installed package changes all its files at once
        log.debug("the stamp of numba's cache could not be set")
    return dispatcher


@lru_cache(maxsize=1)
def _stamp() -> tuple[tuple[str, float, int], ...]:
    """Name, time and size of every module of this package with compiled code."""
    modules = (m for m in sorted(_PACKAGE.rglob("*.py")) if "analysis.compiled" in m.read_text("utf-8"))
    ours = (*modules, *sorted(Path(__file__).parent.glob("*.py")))
    return tuple((m.relative_to(_PACKAGE).as_posix(), m.stat().st_mtime, m.stat().st_size) for m in ours)


def is_cached(function: Any) -> bool:
    """Whether a dispatcher has compiled code in this process or on disk."""
    if function.signatures:
        return True
    try:
        return bool(function._cache._cache_file._load_index())
    except (AttributeError, OSError):  # numba's own affair: only the announcement depends on it
        return False
