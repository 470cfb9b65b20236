"""The folder of a test with several cameras, which holds one of each, and the clocks of two runs."""

from __future__ import annotations

import itertools
from datetime import datetime
from pathlib import Path

from acquire.errors import DataError
from live.config.cameras import FIELDS, SIDES
from live.results.run_folder import SESSION, STRAIN, RunFolder

CLOCKS_AGREE_S = 2.0  # the clock of the day may have been set in between


def cameras_in(folder: Path) -> tuple[str, ...]:
    """The names of the cameras, where ``folder`` is that of a test with several; else none."""
    return () if (folder / STRAIN).exists() else _with(folder, STRAIN)


def recorded_cameras_in(folder: Path) -> tuple[str, ...]:
    """The names of the cameras, where ``folder`` has the recordings of several; else none."""
    return _with(folder, SESSION)


def _with(folder: Path, file: str) -> tuple[str, ...]:
    if all((folder / name / file).is_file() for name in SIDES):
        return SIDES
    found = tuple(itertools.takewhile(lambda name: (folder / name / file).is_file(), FIELDS))
    return found if len(found) > 1 else ()


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
            raise DataError(
                "{path}: no recording, whose clock is needed; give the folders of two runs", run.path
            )
    by_machine = back.start_monotonic - front.start_monotonic
    begun = (datetime.fromisoformat(run.strain.start_utc) for run in (back, front))
    by_day = (next(begun) - next(begun)).total_seconds()
    if abs(by_machine - by_day) > CLOCKS_AGREE_S:
        raise DataError(
            "{front} and {back}: their clocks are {apart:.0f} s apart; record both on one machine, without a restart"
            " in between",
            front.path,
            back.path,
            abs(by_machine - by_day),
        )
    return by_machine
