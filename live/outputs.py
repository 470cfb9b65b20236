"""What is done with each measurement, live or in a replay: results, view, history, screen.

A trouble in one of them stops that one alone, loudly.
"""

from __future__ import annotations

import datetime
import logging
import platform
import queue
import threading
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.events import EventKind
from acquire.frame import Frame
from live.card import StatusCard
from live.config import Config
from live.history import History, Instant
from live.journal import Journal
from live.ledger import Ledger
from live.measurement import Measurement
from live.results import Results
from live.status import Screen
from live.view import RerunView, spawn_viewer

log = logging.getLogger(__name__)
WAITING = 64  # measurements
FILES = ("session.h5", "mask.png", "strain.h5", "strain.csv", "view.rrd", "config.json")
_PACKAGES = ("phasedic", "numpy", "scipy", "numba", "opencv-python-headless", "h5py", "rerun-sdk", "pyserial")


def versions() -> dict[str, str]:
    """Versions of ourselves, of Python and of what we stand on."""
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


class Outputs:
    """Passes each measurement on to those who want it; results are written by a thread of their own.

    A disk with bad moments holds up the measurement only when ``WAITING`` measurements wait for it,
    and then nothing is lost: bursts are skipped, and counted, as with any slow measurement.
    """

    def __init__(
        self,
        results: Results | None,
        view: RerunView | None,
        journal: Journal,
        card: StatusCard,
        ledger: Ledger,
    ) -> None:
        self._view, self._journal = view, journal
        self._card, self._ledger = card, ledger
        self.history = History()
        self.failed = False
        self._waiting: queue.Queue[Measurement | None] = queue.Queue(WAITING)
        self._writer = threading.Thread(target=self._write_all, args=(results,), name="results", daemon=True)
        self._writer.start()

    def add(self, measurement: Measurement) -> Instant:
        """Take one measurement."""
        if not self.failed:
            self._waiting.put(measurement)
        if self._view is not None:
            self._view.show(measurement)
        instant = self.history.add(measurement)
        if self._view is not None and (card := self._card.due(self.history, self._ledger)):
            self._view.status(card)
        return instant

    def picture(self, frame: Frame) -> None:
        """Offer a frame to the view, which takes a few a second."""
        if self._view is not None:
            self._view.picture(frame)

    def load(self, t: float, force: float) -> None:
        """Offer a load sample to the view."""
        if self._view is not None:
            self._view.load(t, force)

    @property
    def view(self) -> RerunView | None:
        """The view, where there is one."""
        return self._view

    def close(self) -> None:
        """Write what waits and what is held back, and close."""
        self._waiting.put(None)
        self._writer.join()
        if self._view is not None:
            self._view.close(5.0)
            if self._view.failed:
                self._journal.tell(EventKind.VIEW, "view", self._view.failed, "warning")

    def _write_all(self, results: Results | None) -> None:
        while (measurement := self._waiting.get()) is not None:
            if results is not None and not self.failed:
                self._guarded(results.add, measurement)
        if results is not None:
            self._guarded(results.close)

    def _guarded(self, step: Callable[..., None], *arguments: Measurement) -> None:
        """One step of the results; the first that fails ends them, loudly, and nothing else."""
        try:
            step(*arguments)
            return
        except PhasedicError as error:
            text = f"the results stop here, all else goes on: {error}"
        except Exception as error:
            log.exception("the results failed")
            text = f"the results stop here by a defect, all else goes on: {error!r}"
        if not self.failed:
            self.failed = True
            self._journal.tell(EventKind.MEASUREMENT, "results", text, "error")


def open_view(outputs: Outputs, config: Config, screen: Screen) -> None:
    """Open the viewer where there is a display; else say how to look."""
    view = outputs.view
    if view is None:
        return
    opened = config.view.spawn and view.port is not None and spawn_viewer(view.port) is not None
    if opened:
        screen.say("the viewer opens in a window of its own")
        return
    screen.say("no viewer is opened here (no display); it runs without, and this shows it:")
    for line in view.address.splitlines():
        screen.say(f"  {line}")


def usable(error: ValueError, what: str) -> PhasedicError:
    """An error of the numerics as one with an exit code: no pattern is the data's, the rest is usage."""
    kind = DataError if type(error).__name__ == "PatternError" else ConfigError
    return kind(f"{what}: {error}")
