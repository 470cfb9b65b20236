"""The folder of a run, and the versions of the programs that made it."""

from __future__ import annotations

import contextlib
import datetime
import os
import platform
import traceback
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from acquire.errors import ConfigError
from acquire.events import Event, EventKind
from acquire.frame import Burst
from acquire.text import Message
from acquire.text.message import printable
from live import VERSION
from live.config.new_files import free_name, made_folder
from live.pipeline.measure import NewReference
from live.pipeline.run_state import RunState

FILES = (
    "session.h5",
    "mask.png",
    "strain.h5",
    "strain.csv",
    "cycles.csv",
    "view.rrd",
    "config.json",
    "figures.json",
)
_PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "h5py", "rerun-sdk", "pyserial")

LOG = "errors.log"
"""In the folder of the run: the traceback of each burst that failed."""
MAX_TRACEBACKS = 100

_DIGITS = ("numba", "numpy", "machine", "processor", "vectors", "loops")


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
            found[name] = Message("not installed")
    return found


def differing_versions(then: Mapping[str, Any]) -> list[str]:
    """What differs from the versions ``then`` of an earlier measurement and changes the last digits, in words."""
    now = versions()
    differ = [name for name in _DIGITS if name in then and str(then[name]) != now[name]]
    return [
        Message("{name} {printable} (here {now})", name, printable(str(then[name]))[:40], now[name])
        for name in differ
    ]


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
        why = Message("Permission denied") if there.is_dir() else Message("Not a directory")
        raise ConfigError("{folder}: cannot be made ({why}); choose another --out", folder, why)
    if wanted:
        _check_free(folder)


def _check_free(folder: Path) -> None:
    existing = [name for name in FILES if (folder / name).exists()]
    if existing:
        raise ConfigError(
            "{folder} already holds {existing}; nothing is overwritten, choose another --out",
            folder,
            existing[0],
        )


def make_folder(wanted: str | None, now: datetime.datetime) -> Path:
    """The folder of a run: ``wanted``, or a new one in ``runs`` named by the UTC time.

    Raises
    ------
    ConfigError
        It holds a run already (files are never overwritten), or cannot be made.
    """
    runs = Path("runs")
    own = free_name(now.strftime("%Y%m%dT%H%M%SZ"), lambda name: (runs / name).exists())
    folder = made_folder(Path(wanted) if wanted else runs / own)
    _check_free(folder)
    return folder


class BurstFailures:
    """Accounts for the bursts of one run that failed; ``measure`` calls it.

    Parameters
    ----------
    run_state : RunState
        Its frame counts take their frames as ``failed``; each gives an event.
    folder : Path
        Of the run; takes ``LOG``.

    Attributes
    ----------
    count : int
        Bursts that failed so far.
    """

    def __init__(self, run_state: RunState, folder: Path) -> None:
        self._run_state, self._path = run_state, folder / LOG
        self.count = 0

    def __call__(self, number: int, item: Burst | NewReference, error: Exception) -> None:
        """Take burst ``number`` (from 0), or a new reference before it, and what was raised."""
        self.count += 1
        burst, what = (
            (item, Message("burst {number}", number + 1))
            if isinstance(item, Burst)
            else (item.burst, Message("the new reference"))
        )
        frames = Message("frames {first_index} to {last_index}", burst.first_index, burst.last_index)
        text = Message(
            "{what} ({frames}) could not be measured, the next one is: {name}: {error}; {name2} has the details",
            what,
            frames,
            type(error).__name__,
            error,
            self._path.name,
        )
        if self.count <= MAX_TRACEBACKS:
            trace = "".join(traceback.format_exception(error))
            with (
                contextlib.suppress(OSError),
                self._path.open("a", encoding="utf-8", errors="replace") as file,
            ):
                file.write(f"{what} ({frames}), {burst.t:.3f} s\n{trace}\n")
        if isinstance(item, Burst):
            self._run_state.frame_counts.add(failed=burst.n)
        data = {"first": burst.first_index, "last": burst.last_index, "n": burst.n, "number": number}
        event = Event(burst.t, EventKind.MEASUREMENT, "measurement", text, "error", data)
        self._run_state.event_log.record(event)
