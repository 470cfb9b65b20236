"""Environment variables: those of numba and of reproducible builds that are not possible are refused first."""

from __future__ import annotations

import os

from acquire.errors import ConfigError
from acquire.system import limit_memory_pools

_LEAST = {"NUMBA_NUM_THREADS": 1, "SOURCE_DATE_EPOCH": 0}
"""Whole numbers in the environment for which numba ends the program where they are none."""
_LAYERS = ("NUMBA_THREADING_LAYER", "NUMBA_THREADING_LAYER_PRIORITY")


def limit_resources() -> None:
    """Give OpenBLAS one thread and memory few pools, unless the environment says else; called before numpy is loaded.

    The matrices are small: a second thread mostly spins, and keeps the camera and the recording from their cores.
    Preparing a reference of 5 megapixels took 10 s beside busy programs and takes 4; alone 1.0 and 1.1, with a tenth
    less of processor time (2 cores, November 2026).
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    limit_memory_pools()


def check_environment() -> None:
    """Refuse what numba would end the program for, or raise while it measures; raises ConfigError."""
    for name, least in _LEAST.items():
        value = os.environ.get(name, "1")
        if not (value.isascii() and value.isdecimal() and int(value) >= least):
            raise ConfigError(
                f"{name}={value} is not possible; give a whole number from {least}, or unset the variable"
            )
    if given := [f"{name}={os.environ[name]}" for name in _LAYERS if name in os.environ]:
        _check_threading_layer(" ".join(given))


def _check_threading_layer(given: str) -> None:
    """Start numba's threads: it raises where it cannot load the layer that the environment names."""
    from analysis import threading_library

    try:
        threading_library()
    except (ValueError, ImportError) as error:
        why = str(error).splitlines()[0].rstrip(".")
        raise ConfigError(f"{given} is not possible ({why}); give omp or workqueue, or unset it") from error
