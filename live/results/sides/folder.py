"""The folder of a test with two cameras, which holds one of each side, and the clocks of two runs."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from acquire.errors import DataError
from live.config.sides import FIELDS, SIDES
from live.results.run_folder import SESSION, STRAIN, RunFolder

CLOCKS_AGREE_S = 2.0  # the clock of the day may have been set in between


def sides_in(folder: Path) -> tuple[str, str] | None:
    """The names of both cameras, where ``folder`` is that of a test with two; else None."""
    return None if (folder / STRAIN).exists() else _with_both(folder, STRAIN)


def recorded_sides_in(folder: Path) -> tuple[str, str] | None:
    """The names of both cameras, where ``folder`` has the recordings of both; else None."""
    return _with_both(folder, SESSION)


def _with_both(folder: Path, file: str) -> tuple[str, str] | None:
    return next(
        (names for names in (SIDES, FIELDS) if all((folder / n / file).is_file() for n in names)), None
    )


def shift_s(front: RunFolder, back: RunFolder) -> float:
    """What to add to times of the back for times of the front, s; 0 where one run made both.

    Raises
    ------
    DataError
        A recording is missing, or they are of different machines: the two clocks of each disagree.
    """
    for run in (front, back):
        if run.session is None and front.strain.start_utc == back.strain.start_utc:
            return 0.0
        if run.session is None:
            raise DataError(f"{run.path}: no recording, whose clock is needed; give the folders of two runs")
    by_machine = back.start_monotonic - front.start_monotonic
    begun = (datetime.fromisoformat(run.strain.start_utc) for run in (back, front))
    by_day = (next(begun) - next(begun)).total_seconds()
    if abs(by_machine - by_day) > CLOCKS_AGREE_S:
        raise DataError(
            f"{front.path} and {back.path}: their clocks are {abs(by_machine - by_day):.0f} s apart; record both on one"
            " machine, without a restart in between"
        )
    return by_machine
