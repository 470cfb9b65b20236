"""Taking the reference: a still specimen, checked for motion, its force and noise written down."""

from __future__ import annotations

import itertools
import math

from acquire.events import Event, EventKind
from acquire.frame import Burst
from live.measure import Reference, motion_between
from live.run.feed import Feed
from live.run.setting import Setting
from live.setup import PreparedKernel
from live.tell import Books

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

    def take(self) -> PreparedKernel | None:
        """The kernel on it; None where the run ended before there was a reference.

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
        what = f"the reference from {self._setting.config.camera.address}"
        for attempt in itertools.count(1):
            ready = self._setting.plan.on(reference.burst, what)
            moved = _moved(ready, reference)
            if moved <= self._setting.config.measure.reference_shift_px:
                break
            again = self._another(moved, attempt)
            if again is None and math.isnan(moved):
                text = "no reference could be measured; keep the specimen still, look at light and focus"
                self._books.journal.tell(EventKind.MEASUREMENT, "reference", text, "error")
                return None
            if again is None:
                text = f"the reference moved by {moved:.3f} px; keep the specimen still when strains must be absolute"
                self._books.journal.tell(EventKind.MEASUREMENT, "reference", text, "warning")
                break
            self._books.ledger.add(reference=-reference.burst.n, left_out=reference.burst.n)
            reference = again
        self._tell(reference.burst, moved)
        return ready

    def _another(self, moved: float, attempt: int) -> Reference | None:
        """The next one; None where the run ends, or where a reference that moved has to do.

        With one that cannot be measured nothing can be: until there is a better one, it is tried again.
        """
        if attempt >= TRIES and not math.isnan(moved):
            return None
        what = f"the picture moved by {moved:.3f} px during the reference burst"
        if math.isnan(moved):
            what = "the reference burst cannot be measured (fast motion, glare, no focus?)"
        if attempt < TRIES:
            self._books.journal.tell(EventKind.MEASUREMENT, "reference", f"{what}; taking another", "warning")
        elif attempt == TRIES:
            text = f"{what}; tried again until the picture is still"
            self._books.journal.tell(EventKind.MEASUREMENT, "reference", text, "error")
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


def _moved(ready: PreparedKernel, reference: Reference) -> float:
    """How far it moved within the burst, px; NaN where it cannot be measured, which is not still."""
    if reference.halves is None:
        return 0.0
    return motion_between(ready.kernel, *reference.halves, ready.plan.correct)


def _plain(value: float) -> float | None:
    return value if math.isfinite(value) else None
