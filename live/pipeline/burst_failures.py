"""A burst that cannot be measured costs that burst: it is counted and named, and the next one is measured."""

from __future__ import annotations

import contextlib
import traceback
from pathlib import Path

from acquire.events import Event, EventKind
from acquire.frame import Burst
from live.pipeline.measure import NewReference
from live.pipeline.run_state import RunState

LOG = "errors.log"
"""In the folder of the run: the traceback of each burst that failed."""
MAX_TRACEBACKS = 100


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
            (item, f"burst {number + 1}") if isinstance(item, Burst) else (item.burst, "the new reference")
        )
        frames = f"frames {burst.first_index} to {burst.last_index}"
        text = (
            f"{what} ({frames}) could not be measured, the next one is: {type(error).__name__}: {error};"
            f" {self._path.name} has the details"
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
