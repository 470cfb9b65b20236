"""The folder of a run, and the versions of the programs that made it."""

from __future__ import annotations

import datetime
import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from acquire.errors import ConfigError
from acquire.printable import printable
from live import VERSION

FILES = ("session.h5", "mask.png", "strain.h5", "strain.csv", "view.rrd", "config.json", "figures.json")
_PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "h5py", "rerun-sdk", "pyserial")


def versions() -> dict[str, str]:
    """Versions of phasedic, Python and the libraries, what the last digits depend on, and the threading library."""
    from analysis import numerics, threading_library

    return installed_versions() | numerics() | {"threads": threading_library()}


def installed_versions() -> dict[str, str]:
    """Versions of phasedic, of Python and of the libraries; imports nothing heavy."""
    found = {
        "phasedic": VERSION,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "system": platform.platform(),
    }
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


_DIGITS = ("numba", "numpy", "machine", "processor", "vectors", "loops")


def differing_versions(then: Mapping[str, Any]) -> list[str]:
    """What differs from the versions ``then`` of an earlier measurement and changes the last digits, in words."""
    now = versions()
    differ = [name for name in _DIGITS if name in then and str(then[name]) != now[name]]
    return [f"{name} {printable(str(then[name]))[:40]} (here {now[name]})" for name in differ]


def check_folder(wanted: str | None) -> None:
    """Refuse a folder before anything is opened for it.

    Raises
    ------
    ConfigError
        It holds a run already (files are never overwritten), or nothing can be written there.
    """
    folder = Path(wanted) if wanted else Path("runs")
    there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not (there.is_dir() and os.access(there, os.W_OK | os.X_OK)):
        why = "Permission denied" if there.is_dir() else "Not a directory"
        raise ConfigError(f"{folder}: cannot be made ({why}); choose another --out")
    if wanted:
        _check_free(folder)


def _check_free(folder: Path) -> None:
    existing = [name for name in FILES if (folder / name).exists()]
    if existing:
        raise ConfigError(
            f"{folder} already holds {existing[0]}; nothing is overwritten, choose another --out"
        )


def make_folder(wanted: str | None, now: datetime.datetime) -> Path:
    """The folder of a run: ``wanted``, or a new one in ``runs`` named by the UTC time.

    Raises
    ------
    ConfigError
        It holds a run already (files are never overwritten), or cannot be made.
    """
    folder = Path(wanted) if wanted else _unused(Path("runs") / now.strftime("%Y%m%dT%H%M%SZ"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be made ({error.strerror}); choose another --out") from None
    _check_free(folder)
    return folder


def _unused(folder: Path) -> Path:
    tries = [folder, *(folder.with_name(f"{folder.name}-{n}") for n in range(2, 1000))]
    return next(f for f in tries if not f.exists())
