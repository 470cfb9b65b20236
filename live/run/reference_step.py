"""Taking the reference: a still specimen, checked for motion, its force and noise written down."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from acquire.events import Event, EventKind
from acquire.frame import Burst
from live.measure import Reference, motion_between, prepare
from live.run.feed import Feed
from live.run.setting import Setting
from live.tell import Books

if TYPE_CHECKING:
    from analysis import PhaseKernel

TRIES = 3


class ReferenceStep:
    """Takes references until one is still.

    Parameters
    ----------
    setting : Setting
    books : Books
    feed : Feed
    """

    def __init__(self, setting: Setting, books: Books, feed: Feed) -> None:
        self._setting, self._books, self._feed = setting, books, feed

    def take(self) -> tuple[PhaseKernel, float | None] | None:
        """A kernel and the noise of one frame, GL; None where the run ended before a reference was complete.

        Raises
        ------
        DataError
            There is no pattern.
        ConfigError
            The grid does not fit.
        """
        reference = self._feed.next_reference()
        if reference is None:
            text = f"the camera ended before the reference was complete ({self._books.ledger.grabbed} frames)"
            self._books.journal.tell(EventKind.MEASUREMENT, "reference", text, "error")
            return None
        for attempt in range(1, TRIES + 1):
            kernel, noise_GL = self._kernel(reference)
            moved = (
                motion_between(kernel, *reference.halves, self._setting.correct) if reference.halves else 0.0
            )
            if not moved > self._setting.config.measure.reference_shift_px:
                break
            again = self._another(moved) if attempt < TRIES else None
            if again is None:
                text = f"the reference moved by {moved:.3f} px; keep the specimen still when strains must be absolute"
                self._books.journal.tell(EventKind.MEASUREMENT, "reference", text, "warning")
                break
            self._books.ledger.add(reference=-reference.burst.n, left_out=reference.burst.n)
            reference = again
        self._tell(reference.burst, moved)
        return kernel, noise_GL

    def _kernel(self, reference: Reference) -> tuple[PhaseKernel, float | None]:
        s = self._setting
        what = f"the reference from {s.config.camera.address}"
        return prepare(reference.burst, s.grid, s.settings, s.config.measure.noise_GL, s.correct, what)

    def _another(self, moved: float) -> Reference | None:
        text = f"the picture moved by {moved:.3f} px during the reference burst; taking another"
        self._books.journal.tell(EventKind.MEASUREMENT, "reference", text, "warning")
        return self._feed.another_reference()

    def _tell(self, burst: Burst, moved: float) -> None:
        force, n = self._books.loads.mean(burst.t - burst.duration / 2, burst.t + burst.duration / 2)
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
        self._books.journal.record(Event(burst.t, EventKind.REFERENCE, "measurement", text, "info", data))


def _plain(value: float) -> float | None:
    return value if math.isfinite(value) else None
