"""Forces from a CSV for a replay, by the time of the test or the name of a picture.

The heading has the names of the columns and their units (``file,force_kN``; ``Time [s];Extension [mm];Load [N]``), or
a second line has the units; without a heading there are two columns, name or seconds, and newtons. Columns are
separated by commas, tabs or semicolons (then with decimal commas); a line that begins with ``#`` is a comment.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquire.errors import ConfigError, DataError
from acquire.files.picture import read_bytes
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from acquire.protocols.units import newtons_per

_HEADING = re.compile(r"^\s*([A-Za-z]+)(?:[\s_]*[\[(]?\s*([A-Za-z]+)\s*[\])]?)?\s*$")
_FORCE, _TIME = ("force", "load", "f"), ("time", "t", "seconds")
_NAME = ("file", "filename", "picture", "image", "name")
_LONGEST_UNIT = 6
_SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "sec": 1.0, "": 1.0}


@dataclass(frozen=True, slots=True, eq=False)
class ForceTable:
    """The content of the file.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Of the pictures; empty where times are given.
    times : tuple of float, s
        Ascending; empty where names are given.
    forces : tuple of float, N
        NaN where the cell is empty.
    unit : str
        As given; "" where it is not, and the forces are in newtons.
    """

    path: Path
    names: tuple[str, ...]
    times: tuple[float, ...]
    forces: tuple[float, ...]
    unit: str

    def samples(self, pictures: Mapping[str, float] | None, origin: float) -> list[LoadSample]:
        """The forces as samples of a load cell.

        Parameters
        ----------
        pictures : mapping of name to s, or None
            Times of the pictures by name; None where the source has no names.
        origin : float, s
            Zero of the times of the file.

        Raises
        ------
        DataError
            No name is that of a picture.
        ConfigError
            The table has names, and the source has none.
        """
        if not self.names:
            return [
                LoadSample(origin + t, f, self.unit) for t, f in zip(self.times, self.forces, strict=True)
            ]
        if pictures is None:
            raise ConfigError(
                f"{self.path}: names pictures, but this source has times alone; give a column time_s"
            )
        known = self._by_name()
        found = [(t, known.get(name, known.get(Path(name).stem))) for name, t in pictures.items()]
        if all(force is None for _, force in found):
            raise DataError(
                f"{self.path}: none of its {len(known)} names is that of a picture; they begin with {self.names[0]!r}"
            )
        return [LoadSample(t, math.nan if force is None else force, self.unit) for t, force in found]

    def _by_name(self) -> dict[str, float]:
        known = dict(zip((Path(name).name for name in self.names), self.forces, strict=True))
        if len(known) < len(self.names):
            raise DataError(f"{self.path}: a picture is named twice; give each one force")
        return known

    def log(self, samples: Sequence[LoadSample], max_gap_s: float, lag_s: float = 0.0) -> LoadLog:
        """The samples as a closed log; a gap is at least three median intervals of a table with times."""
        steps = np.diff([sample.t for sample in samples])
        gap = math.inf if self.names else max(max_gap_s, 3 * float(np.median(steps)) if len(steps) else 0.0)
        log = LoadLog(gap, lag_s, by_name=bool(self.names))
        for sample in samples:
            log.append(sample)
        log.close()
        return log


def read_forces(path: Path) -> ForceTable:
    """The table at ``path``.

    Raises
    ------
    DataError
        Unreadable, no such columns, a unit that is not known, not a number, or times that run backwards.
    """
    rows = _rows(path)
    columns, rows = _columns(path, rows)
    forces = tuple(columns.newtons * _number(path, row, columns.force, empty=True) for row in rows)
    if columns.by_name:
        names = tuple(row[columns.key] if columns.key < len(row) else "" for row in rows)
        return ForceTable(path, names, (), forces, columns.unit)
    times = tuple(columns.seconds * _number(path, row, columns.key) for row in rows)
    for earlier, later in itertools.pairwise(times):
        if later < earlier:
            raise DataError(f"{path}: the times run backwards ({later:g} s after {earlier:g} s)")
    return ForceTable(path, (), times, forces, columns.unit)


@dataclass(frozen=True, slots=True)
class _Columns:
    """The numbers of the columns, and their units."""

    key: int
    force: int
    by_name: bool
    unit: str = ""
    newtons: float = 1.0
    seconds: float = 1.0


def _rows(path: Path) -> list[list[str]]:
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: the forces cannot be read: {error}; save it as UTF-8") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise DataError(f"{path}: holds no forces")
    delimiter = max(";\t,", key=lambda mark: (mark in lines[0]) * (10 - ";\t,".index(mark)))
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]
    except csv.Error as error:
        raise DataError(f"{path}: not a CSV: {error}") from error
    return [[cell.replace(",", ".") for cell in row] for row in rows] if delimiter == ";" else rows


def _columns(path: Path, rows: list[list[str]]) -> tuple[_Columns, list[list[str]]]:
    """The columns, and the rows without heading and units."""
    if _is_number(rows[0][-1]) and len(rows[0]) == 2:
        return _Columns(0, 1, not _is_number(rows[0][0])), rows
    matches = [_HEADING.match(cell) for cell in rows[0]]
    heads = [(head[1].lower(), head[2] or "") if head else ("", "") for head in matches]
    force, time, name = (_find(path, heads, words) for words in (_FORCE, _TIME, _NAME))
    key = time if name is None else name
    if force is None or key is None:
        raise DataError(
            f"{path}: the heading is {', '.join(rows[0])[:100]!r}; wanted: a column force_N (or kN, lbf ...), and"
            " one of: file, time_s"
        )
    rows = rows[1:]
    unit, second = heads[force][1], heads[key][1]
    under = _units_below(rows[:1], len(heads)) if not unit else None
    if under is not None:
        unit, second, rows = under[force], under[key], rows[1:]
    if not rows:
        raise DataError(f"{path}: holds no forces")
    return _Columns(
        key, force, name is not None, unit, _newtons(path, unit), _seconds(path, second, name)
    ), rows


def _units_below(rows: list[list[str]], n: int) -> list[str] | None:
    """The units of each column where the line below the heading holds them; None where it holds numbers."""
    if not rows or len(rows[0]) < n or any(_is_number(cell) for cell in rows[0]):
        return None
    cells = [cell.strip("[]() ") for cell in rows[0]]
    return cells if all(len(cell) <= _LONGEST_UNIT and "." not in cell for cell in cells) else None


def _find(path: Path, heads: Sequence[tuple[str, str]], words: tuple[str, ...]) -> int | None:
    found = [k for k, (head, _) in enumerate(heads) if head in words]
    if len(found) > 1:
        raise DataError(f"{path}: {len(found)} columns are called {heads[found[0]][0]!r}; leave one")
    return found[0] if found else None


def _newtons(path: Path, unit: str) -> float:
    try:
        return newtons_per(unit) if unit else 1.0
    except ConfigError:
        raise DataError(f"{path}: forces in {unit!r} are not known; give N, kN, kgf or lbf") from None


def _seconds(path: Path, unit: str, name: int | None) -> float:
    if name is not None:
        return 1.0
    if unit.lower() not in _SECONDS:
        raise DataError(f"{path}: times in {unit!r} are not known; give s, ms or min")
    return _SECONDS[unit.lower()]


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _number(path: Path, row: Sequence[str], column: int, *, empty: bool = False) -> float:
    text = row[column] if column < len(row) else ""
    if _is_number(text):
        return float(text)
    if empty and text.lower() in ("", "nan", "-"):
        return math.nan
    raise DataError(f"{path}: {text[:40]!r} in the row {','.join(row)[:60]!r} is not a number")
