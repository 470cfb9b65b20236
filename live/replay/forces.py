"""Forces from a file for a replay, by the time of the test, the name of a picture, or one row a picture.

``live.replay.export_file`` reads the file; here its forces are put at the pictures.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections.abc import Mapping, Set
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.clock import ClockPair
from acquire.errors import ConfigError, DataError
from acquire.files.picture import MAX_BYTES, check_regular
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from acquire.text import Amount, Message, about, counts
from acquire.text.message import counted
from live.config.sections import LoadConfig
from live.replay.export_file import Export, read_export

_MOST_SHOWN = 20_000  # samples for the display
_SHARE = 0.5  # of names without a picture, or pictures without a force, from which the forces are in doubt
_UNIX_S = 1e8
_DIGIT = re.compile(r"\d")

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedForces:
    """Forces at times of the source.

    Attributes
    ----------
    times, forces : (N,) float64, s and N
        NaN where a picture has none.
    by_picture : bool
        Each is that of one picture, so that nothing is between them.
    remarks : tuple of str
    doubts : tuple of str
        Remarks on what makes the result incomplete.
    """

    times: Array
    forces: Array
    by_picture: bool
    remarks: tuple[str, ...]
    doubts: tuple[str, ...] = ()

    def log(self, load: LoadConfig) -> LoadLog:
        """A closed log; a gap is at least three median steps of a table with times."""
        steps = np.diff(self.times)
        usual = math.inf if self.by_picture else 3 * float(np.median(steps)) if len(steps) else 0.0
        log = LoadLog(max(load.max_gap_s, usual), load.lag_s, by_name=self.by_picture)
        log.extend(self.times, self.forces)
        log.close()
        return log

    def samples(self) -> tuple[LoadSample, ...]:
        """The forces as samples of a load cell for the display, evenly thinned."""
        chosen = np.unique(np.linspace(0, len(self.times) - 1, min(len(self.times), _MOST_SHOWN)).astype(int))
        return tuple(LoadSample(float(self.times[k]), float(self.forces[k])) for k in chosen)

    def at_pictures(self, where: str, load: LoadConfig, times: Array | None) -> PlacedForces:
        """The same, with a remark on how many pictures have a force.

        Parameters
        ----------
        times : (P,) float64 or None, s
            Of the pictures; None where they are not known before they are read.

        Raises
        ------
        DataError
            None of them has a force.
        """
        if times is None or not len(times):
            return self
        log = self.log(load)
        known = sum(math.isfinite(log.force_at(t)) for t in times.tolist())
        words = Message("{n} of {all} pictures have a force", *counts(known, len(times)))
        if not known:
            start = float(times[0])
            own, theirs = (
                Message("{low:.6g} to {high:.6g} s", x[0] - start, x[-1] - start) for x in (self.times, times)
            )
            raise DataError(
                "{where}: no picture has a force: its times are {own} from the first picture, the pictures' {theirs};"
                " mend them, or give fps=, stamps= or --load-unit N,ms",
                where,
                own,
                theirs,
            )
        if known > (1 - _SHARE) * len(times):
            return dataclasses.replace(self, remarks=(words, *self.remarks))
        return dataclasses.replace(self, doubts=(about(where, words), *self.doubts))


@dataclass(frozen=True, slots=True, eq=False)
class ForceTable:
    """The content of the file at ``path``."""

    path: Path
    export: Export

    def placed(
        self, pictures: Mapping[str, float] | None, start: ClockPair, *, recorded: bool
    ) -> PlacedForces:
        """The forces at the times of a source.

        Parameters
        ----------
        pictures : mapping of name to s, or None
            Times of the pictures by name, in their order; None where the source has no names.
        start : ClockPair
            Zero of the times of the file.
        recorded : bool
            The clock of ``start`` is that of the recording; otherwise nobody knows when the pictures were taken.

        Raises
        ------
        DataError
            No name is that of a picture, a picture is named twice, or the number of rows is not that of the pictures.
        ConfigError
            There are names or one row a picture, and the source has no names; or times of the day for a recording.
        """
        e = self.export
        if e.times is not None:
            return self._at_times(e.times, pictures, start, recorded=recorded)
        if pictures is None:
            raise ConfigError(
                "{path}: has a row for each picture, but this source has times alone; give a column time_s, or its"
                " name: --load-column FORCE,TIME",
                self.path,
            )
        if e.names:
            return self._by_name(pictures)
        if len(e.forces) != len(pictures):
            raise DataError(
                "{path}: has no times and no names, and {rows} rows for {pictures} pictures; give a column time_s"
                " or file, or name it: --load-column FORCE,TIME",
                *(self.path, Amount("count", len(e.forces)), Amount("count", len(pictures))),
            )
        remark = Message("no times and no names: row k is taken as the force of picture k")
        return PlacedForces(np.array(list(pictures.values())), e.forces, True, (remark, *e.remarks))

    def _at_times(
        self, times: Array, pictures: Mapping[str, float] | None, start: ClockPair, *, recorded: bool
    ) -> PlacedForces:
        e, origin, remarks = self.export, start.monotonic, self.export.remarks
        first = min(pictures.values(), default=origin) if pictures else origin
        if e.clock == "unix" and recorded:
            origin -= start.utc.timestamp()
        elif e.clock and recorded:
            raise ConfigError(
                "{path}: has times of the day, the recording has Unix times; give these, or seconds from its start:"
                " time_s",
                self.path,
            )
        elif e.clock and not (e.clock == "unix" and first > _UNIX_S):
            origin = first - float(times[0])
            remarks = (
                Message("the pictures have no such times: the first row is taken as the first picture"),
                *remarks,
            )
        return PlacedForces(times + origin, e.forces, False, remarks)

    def _by_name(self, pictures: Mapping[str, float]) -> PlacedForces:
        names = [Path(name.replace("\\", "/")).name for name in self.export.names]
        here = pictures.keys() | {Path(name).stem for name in pictures}
        footer = _footer(names, here)
        names = names[: len(names) - len(footer)]
        known = dict(zip(names, self.export.forces.tolist(), strict=False))
        if len(known) < len(names):
            raise DataError("{path}: a picture is named twice; give each one force", self.path)
        lost = [name for name in names if name not in here]
        if len(lost) == len(names):
            raise DataError(
                "{path}: none of its {n} names is that of a picture; they begin with {first}, the pictures with"
                " {picture}",
                self.path,
                len(names),
                repr(names[0]),
                repr(next(iter(pictures), "")),
            )
        some = ", ".join(map(repr, lost[:3]))
        words = Message("{n} of {all} names are that of no picture: {some}", len(lost), len(names), some)
        forces = [known.get(name, known.get(Path(name).stem, math.nan)) for name in pictures]
        left = counted(len(footer), "line")
        below = (
            [Message("{lines} below the names left out: {first}", left, repr(footer[0]))] if footer else []
        )
        doubtful = len(lost) >= _SHARE * len(names)
        return PlacedForces(
            np.array(list(pictures.values())),
            np.array(forces),
            True,
            (*((words,) if lost and not doubtful else ()), *below, *self.export.remarks),
            (about(self.path.name, words),) if doubtful else (),
        )


def _footer(names: list[str], here: Set[str]) -> list[str]:
    """The names below the last picture that are no pictures, as Maximum: without an ending, or without a digit."""
    last = max((k for k, name in enumerate(names) if name in here), default=len(names) - 1)
    ending = bool(Path(names[last]).suffix)
    below = itertools.dropwhile(
        lambda name: Path(name).suffix or (not ending and _DIGIT.search(name)), names[last + 1 :]
    )
    return list(below)


def read_forces(path: Path, load: LoadConfig | None = None) -> ForceTable:
    """The table at ``path``, as ``load`` settles what the file leaves open.

    Raises
    ------
    DataError
        As ``read_export``; missing, no regular file, unreadable or larger than 2 GB.
    """
    size = check_regular(path)
    if size > MAX_BYTES:
        raise DataError(
            "{path}: {size_GB:.1f} GB are more than 2 GB; export fewer rows a second", path, size / 1e9
        )
    try:
        with path.open("rb") as file:
            return ForceTable(path, read_export(file, str(path), load or LoadConfig()))
    except OSError as error:
        raise DataError("{path}: cannot be read ({strerror})", path, error) from error
