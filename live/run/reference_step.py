"""Taking the reference: a still specimen, checked for motion, its force and noise written down."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquire.events import Event, EventKind
from acquire.frame import Burst
from acquire.load_cell import LoadLog
from live.measure import Correction, Reference, motion_between, prepare, usable
from live.run.feed import Feed
from live.run.grabber import Grabber
from live.setup import Config
from live.tell import Journal, Ledger

if TYPE_CHECKING:
    from analysis import KernelSettings, PhaseKernel, ZoiGrid

TRIES = 3


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceStep:
    """Takes references until one is still.

    Attributes
    ----------
    feed, grabber, journal, ledger, loads, config
        Of the run.
    grid : ZoiGrid
    settings : KernelSettings
    correct : callable
        Takes the fixed pattern of the sensor out of a burst.
    """

    feed: Feed
    grabber: Grabber
    journal: Journal
    ledger: Ledger
    loads: LoadLog
    config: Config
    grid: ZoiGrid
    settings: KernelSettings
    correct: Correction

    def take(self) -> tuple[PhaseKernel, float | None] | None:
        """A kernel and the noise of one frame, GL; None where the run ended before a reference was complete.

        Raises
        ------
        DataError
            There is no pattern.
        ConfigError
            The grid does not fit.
        """
        reference = self.feed.next_reference()
        if reference is None:
            text = f"the camera ended before the reference was complete ({self.ledger.grabbed} frames)"
            self.journal.tell(EventKind.MEASUREMENT, "reference", text, "error")
            return None
        for attempt in range(1, TRIES + 1):
            kernel, noise_GL = self._kernel(reference)
            moved = motion_between(kernel, *reference.halves, self.correct) if reference.halves else 0.0
            if not moved > self.config.measure.reference_shift_px:
                break
            again = self._another(moved) if attempt < TRIES else None
            if again is None:
                text = f"the reference moved by {moved:.3f} px; keep the specimen still when strains must be absolute"
                self.journal.tell(EventKind.MEASUREMENT, "reference", text, "warning")
                break
            self.ledger.add(reference=-reference.burst.n, left_out=reference.burst.n)
            reference = again
        self._tell(reference.burst, moved)
        return kernel, noise_GL

    def _kernel(self, reference: Reference) -> tuple[PhaseKernel, float | None]:
        stated = self.config.measure.noise_GL
        try:
            return prepare(reference.burst, self.grid, self.settings, stated, self.correct)
        except ValueError as error:
            raise usable(error, f"the reference from {self.config.camera.address}") from error

    def _another(self, moved: float) -> Reference | None:
        text = f"the picture moved by {moved:.3f} px during the reference burst; taking another"
        self.journal.tell(EventKind.MEASUREMENT, "reference", text, "warning")
        self.grabber.take_reference()
        return self.feed.next_reference()

    def _tell(self, burst: Burst, moved: float) -> None:
        force, n = self.loads.mean(burst.t - burst.duration / 2, burst.t + burst.duration / 2)
        data = {
            "first": burst.first_index,
            "last": burst.last_index,
            "n": burst.n,
            "noise_GL": _plain(burst.noise),
            "force_N": _plain(force),
            "shift_px": _plain(moved),
        }
        noise = f", noise of one {burst.noise:.2f} GL, motion {moved:.4f} px" if burst.n > 1 else ""
        text = f"reference: {burst.n} frames{noise}" + (f", force {force:.2f} N" if n else "")
        self.journal.record(Event(burst.t, EventKind.REFERENCE, "measurement", text, "info", data))


def _plain(value: float) -> float | None:
    return value if math.isfinite(value) else None
