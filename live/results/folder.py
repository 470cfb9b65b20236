"""The folder of a run, and the versions of the programs that made it."""

from __future__ import annotations

import datetime
import logging
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from acquire.errors import ConfigError
from acquire.printable import printable

log = logging.getLogger(__name__)


FILES = ("session.h5", "mask.png", "strain.h5", "strain.csv", "view.rrd", "config.json")


_PACKAGES = ("phasedic", "numpy", "scipy", "numba", "opencv-python-headless", "h5py", "rerun-sdk", "pyserial")


def versions() -> dict[str, str]:
    """Versions of ourselves, of Python and of what we stand on, what the last digits belong to, and the threads."""
    from analysis import numerics, threading_library

    return installed() | numerics() | {"threads": threading_library()}


def installed() -> dict[str, str]:
    """Versions of ourselves, of Python and of what we stand on; loads nothing."""
    found = {
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


def other_digits(then: Mapping[str, Any]) -> list[str]:
    """What was otherwise when something with the versions ``then`` was measured, where its last digits hang on it."""
    now = versions()
    differ = [name for name in _DIGITS if name in then and str(then[name]) != now[name]]
    return [f"{name} {printable(str(then[name]))[:40]} (here {now[name]})" for name in differ]


def make_folder(wanted: str | None, now: datetime.datetime) -> Path:
    """The folder of a run: ``wanted``, or a new one in ``runs`` named by the UTC time.

    Raises
    ------
    ConfigError
        It holds a run already (nothing is ever overwritten), or cannot be made.
    """
    folder = Path(wanted) if wanted else _unused(Path("runs") / now.strftime("%Y%m%dT%H%M%SZ"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be made ({error.strerror}); choose another --out") from None
    taken = [name for name in FILES if (folder / name).exists()]
    if taken:
        raise ConfigError(f"{folder} already holds {taken[0]}; nothing is overwritten, choose another --out")
    return folder


def _unused(folder: Path) -> Path:
    tries = [folder, *(folder.with_name(f"{folder.name}-{n}") for n in range(2, 1000))]
    return next(f for f in tries if not f.exists())
