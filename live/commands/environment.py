"""Environment variables: what numba and reproducible builds cannot use is refused, and where loops are kept."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

from acquire.errors import ConfigError
from acquire.system import can_write, limit_memory_pools, private_folder

log = logging.getLogger(__name__)

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
                "{name}={value} is not possible; give a whole number from {least}, or unset the variable",
                name,
                value,
                least,
            )
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        raise ConfigError(
            "NUMBA_DISABLE_JIT is set: without compiled loops nothing can be measured; unset the variable"
        )
    keep_loops()
    if given := [f"{name}={os.environ[name]}" for name in _LAYERS if name in os.environ]:
        _check_threading_layer(" ".join(given))


def keep_loops() -> None:
    """Keep compiled loops below the temporary folder where numba finds no folder for them: read-only, without a home.

    Child processes get it with the environment.
    """
    given, home = os.environ.get("NUMBA_CACHE_DIR"), Path("~").expanduser()
    own = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") if sys.platform == "linux" else home
    beside = Path(__file__).parents[2] / "analysis/compiled/__pycache__"
    if any(can_write(place) for place in ([Path(given)] if given else []) + [beside, own / "numba"]):
        return
    try:
        folder = private_folder("phasedic-loops")
    except OSError as error:
        raise ConfigError(
            "no folder can be written for compiled loops ({why}); set NUMBA_CACHE_DIR to one that can", error
        ) from error
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    log.warning(
        "compiled loops are kept in %s, since neither the installation nor %s can be written; set NUMBA_CACHE_DIR to a"
        " folder that lasts", folder, own,
    )  # fmt: skip


def _check_threading_layer(given: str) -> None:
    """Start numba's threads: it raises where it cannot load the layer that the environment names."""
    from analysis import threading_library

    try:
        threading_library()
    except (ValueError, ImportError) as error:
        why = str(error).splitlines()[0].rstrip(".")
        raise ConfigError(
            "{given} is not possible ({why}); give omp or workqueue, or unset it", given, why
        ) from error
