"""The forces in the text file of a testing machine, spreadsheet or logger: rows to numbers, in bounded memory.

The form of the numbers is found from the whole file: a mark is the decimal one where a cell has no other reading.
Nothing is guessed: what has two readings is refused with the option that settles it (docs/load-cells.md).
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.session.layout import MAX_FORCE_N
from acquire.text import Message
from acquire.text.message import counted
from acquire.text.quantity import number as grouped
from live.config.sections import LoadConfig
from live.replay import export_text
from live.replay.export_table import Table, blocks, cell_of, find_table, is_heading, is_remark

MAX_ROWS, MAX_NAMES = 20_000_000, 1_000_000
_MARKS = {"point": ".", "comma": ","}
_HALF_DAY_S, _DAY_S = 43_200.0, 86_400.0
_UNIX_S, _UNIX_MS = 1e8, 1e11  # from 1973 on
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Export:
    """What a file holds, and how it was read.

    Attributes
    ----------
    names : tuple of str
        Of the pictures; empty where there are times.
    times : (N,) float64 or None, s
        Rising; None where there are names, or one row a picture.
    forces : (N,) float64, N
        NaN where the cell is empty.
    clock : "" | "clock" | "unix"
        Zero of the times: one of their own, a midnight, or 1970 in UTC.
    taken : str
        Column, unit, rows, range and form, for a person.
    remarks : tuple of str
        What was assumed and what was left out.
    """

    names: tuple[str, ...]
    times: Array | None
    forces: Array
    clock: Literal["", "clock", "unix"]
    taken: str
    remarks: tuple[str, ...]


def read_export(file: BinaryIO, where: str, given: LoadConfig) -> Export:
    """The forces in ``file``, which can be read again from its beginning; ``where`` is its name for messages.

    Parameters
    ----------
    given : LoadConfig
        ``unit``, ``column``, ``decimal`` and ``sign`` settle what the file leaves open.

    Raises
    ------
    DataError
        No text, no table, what has two readings, a cell that is no number, times that do not rise, too many rows.
    """
    table = find_table(file, where, given)
    mark = _MARKS.get(given.decimal or "") or export_text.decimal_mark(
        (rows for _, rows in blocks(file, table, where)), table.key if table.by_name else None, where
    )
    reader = _Reader(table, mark, where, given)
    for line, rows in blocks(file, table, where):
        reader.take(line, rows)
    return reader.export()


# -- rows to numbers ----------------------------------------------------------------------------


class _Reader:
    """Takes the rows of a table, block by block."""

    def __init__(self, table: Table, mark: str, where: str, given: LoadConfig) -> None:
        self._table, self._mark, self._where, self._given = table, mark, where, given
        self._decimal = "comma" if mark == "," else "point"
        self._names: list[str] = []
        self._times, self._forces = array("d"), array("d")
        self._kinds: dict[int | None, dict[str, str]] = {table.force: {}, table.key: {}}
        self._remarks = list(table.remarks)
        self._is_clock, self._last_clock, self._days = False, 0.0, 0
        self._dates: list[tuple[int, str]] = []  # rows from which a date holds
        self._n_texts, self._n_unread, self._other, self._first_text = 0, 0, "", ""
        force, _, time = (part.strip() for part in (given.unit or "").partition(","))
        self._unit = force or export_text.name_and_unit(table.heads[table.force])[1]
        self._time_unit = time or (
            export_text.name_and_unit(table.heads[table.key])[1] if table.key is not None else ""
        )
        self._newtons, self._seconds = self._factors()

    def _factors(self) -> tuple[float, float]:
        """Newtons and seconds of one unit; raises DataError where they are not known."""
        if not self._unit and not self._table.is_ours:
            called = self._table.heads[self._table.force]
            raise DataError(
                "{where}: the column {name} has no unit; give --load-unit N, kN, kgf or lbf",
                self._where,
                repr(called),
            )
        if not self._unit:
            self._unit = "N"
            self._remarks.append(
                Message("the force has no unit: taken as newtons; if it is another, give --load-unit kN")
            )
        newtons, seconds = export_text.newtons_of(self._unit), export_text.seconds_per(self._time_unit or "s")
        if newtons is None:
            raise DataError(
                "{where}: forces in {unit} are not known; give N, kN, kgf or lbf: --load-unit kN",
                self._where,
                repr(self._unit),
            )
        if seconds is None and not self._table.by_name:
            raise DataError(
                "{where}: times in {unit} are not known; give s, ms, us, min or h behind the unit of the force:"
                " --load-unit N,ms",
                self._where,
                repr(self._time_unit),
            )
        return newtons, seconds or 1.0

    def take(self, line: int, rows: export_text.Rows) -> None:
        """Take the rows that begin at ``line``."""
        lines: Sequence[int] = range(line, line + len(rows))
        rows = self._of_width(lines, rows)
        if (plain := self._all_plain(rows)) is not None:
            keys, forces = plain
        else:
            found = [(n, *pair) for n, row in zip(lines, rows, strict=True) if (pair := self._values(n, row))]
            lines, keys, forces = zip(*found, strict=True) if found else ((), (), ())
        for column, kinds in self._kinds.items():
            self._note_kinds(
                kinds, {cell_of(row, column) for row in rows} if self._mark not in kinds else set()
            )
        if self._table.by_name:
            self._names += map(str, keys)
        elif self._table.key is not None and len(keys):
            self._add_times(
                lines, self._since_midnight(keys) if self._is_clock else np.array(keys, np.float64)
            )
        self._forces.extend(forces)
        if len(self._forces) > MAX_ROWS or len(self._names) > MAX_NAMES:
            raise DataError(
                "{where}: has more than {most_rows} rows, or {most_names} names; export fewer a second",
                *(self._where, grouped(MAX_ROWS), grouped(MAX_NAMES)),
            )

    def _of_width(self, lines: Sequence[int], rows: export_text.Rows) -> export_text.Rows:
        """The same rows; what a comma that is the decimal mark too has cut is refused, or mended if that is given."""
        n, force = len(self._table.heads), self._table.force
        if max(map(len, rows)) <= n:
            return rows
        commas = self._table.separator == ","
        if commas and self._given.decimal == "comma":
            rows = [
                [f"{a},{b}" for a, b in zip(row[::2], row[1::2], strict=True)] if len(row) == 2 * n else row
                for row in rows
            ]
        for number, row in zip(lines, rows, strict=True):
            if any(cell.strip() for cell in row[n:]) and export_text.NUMBERISH.fullmatch(cell_of(row, force)):
                why = (
                    Message("is the comma the decimal mark too? give --load-decimal comma, or")
                    if commas
                    else ""
                )
                words = Message("line {line} has {cells} cells for {columns} columns", number, len(row), n)
                raise DataError(
                    "{where}: {what}; {hint} export it with other separators", self._where, words, why
                )
        return rows

    def _all_plain(self, rows: export_text.Rows) -> tuple[Sequence[Any], Sequence[float]] | None:
        """Times and forces where every row has both; None otherwise, for ``_values`` to tell row by row."""
        key, force = self._table.key, self._table.force
        if self._table.by_name or self._other or not self._forces:
            return None
        try:
            forces = self._numbers([row[force].strip() for row in rows])
            if forces is None or key is None:
                return None if forces is None else ([], forces)
            cells = [row[key].strip() for row in rows]
        except IndexError:
            return None
        times = (
            [self._time(*pair) for pair in zip(cells, rows, strict=True)]
            if self._is_clock
            else self._numbers(cells)
        )
        return None if times is None or None in times else (times, forces)

    def _numbers(self, cells: Sequence[str]) -> Sequence[float] | None:
        return export_text.numbers_in(cells, self._mark)

    def _number(self, cell: str) -> float | None:
        numbers = self._numbers([cell])
        return numbers[0] if numbers else None

    def _values(self, line: int, row: Sequence[str]) -> tuple[Any, float] | None:
        """Time or name, and force, of one row; None for a row of text; raises DataError for a row that is neither."""
        if is_remark(row):
            return None
        t = self._table
        value, key = cell_of(row, t.force), cell_of(row, t.key)
        force = math.nan if value.lower() in export_text.EMPTY else self._number(value)
        at = (
            (key or None)
            if t.by_name
            else self._time(key, row)
            if t.key is not None
            else 0.0
            if value
            else None
        )
        if not self._other and force is not None and at is not None:
            return at, force
        texts = tuple(" ".join(cell.split()) for cell in row)
        if any(texts[: len(known)] == known for known in t.texts):
            self._other = ""
        elif not self._other and not t.by_name and is_heading(texts):
            heading = repr(", ".join(filter(None, texts))[:60])
            self._other = Message("line {line}: another table begins ({heading})", line, heading)
        elif self._other:
            self._n_unread += 1
        elif at is not None or export_text.is_value(key) or (not key and force is not None and value):
            bad = value if force is None else key
            shown = self._table.separator.join(row)[:60]
            raise DataError(
                "{where}: line {line}: {bad} in {row} is not a number with a decimal {mark}; mend it, or give"
                " --load-decimal point or comma",
                self._where,
                line,
                repr(bad[:40]),
                repr(shown),
                self._decimal,
            )
        else:
            self._n_texts += 1
            self._first_text = self._first_text or t.separator.join(row)[:60]
        return None

    def _time(self, cell: str, row: Sequence[str]) -> float | tuple[str, float] | None:
        """A number, or the date and seconds since midnight."""
        if not self._forces and not self._is_clock:
            self._is_clock = export_text.CLOCK.fullmatch(cell) is not None
        if not self._is_clock:
            return self._number(cell)
        found, date = export_text.time_of_day(cell), cell_of(row, self._table.date)
        return (date, found[1]) if found and not found[0] and export_text.DATE.fullmatch(date) else found

    def _since_midnight(self, found: Sequence[tuple[str, float]]) -> Array:
        """Seconds from dates and times of the day; a day more where the date is another, or without one falls."""
        times = np.array([time for _, time in found])
        nights = np.diff(times, prepend=self._last_clock if self._times else times[0]) < -_HALF_DAY_S
        for k, (date, _) in enumerate(found):
            if date and date != (self._dates[-1][1] if self._dates else ""):
                nights[k] = bool(self._dates)
                self._dates.append((len(self._times) + k, date))
            elif self._dates:
                nights[k] = False
        days = np.cumsum(nights) + self._days
        self._last_clock, self._days = float(times[-1]), int(days[-1])
        times += _DAY_S * days
        return times

    def _to_dates(self, times: Array) -> Array:
        """The same times, with the days that the dates are apart."""
        days = export_text.days_of([date for _, date in self._dates])
        if days is None:
            raise DataError(
                "{where}: the dates {first} to {last} do not rise, or can be read in two ways; give times in seconds:"
                " time_s",
                self._where,
                repr(self._dates[0][1]),
                repr(self._dates[-1][1]),
            )
        for k, (first, _) in enumerate(self._dates[1:], start=1):
            times[first:] += _DAY_S * (days[k] - days[k - 1] - 1)
        return times

    def _add_times(self, lines: Sequence[int], times: Array) -> None:
        """Add times, s or in the unit of the file; raises DataError with the line where they do not rise."""
        if not self._is_clock:
            while not self._times and not self._time_unit and times[0] * self._seconds > _UNIX_MS:
                self._seconds *= 1e-3  # Unix times in ms, us or ns
            times = times * self._seconds
        before = self._times[-1] if self._times else -math.inf
        for k in np.flatnonzero(np.diff(times, prepend=before) <= 0)[:1]:
            earlier, later = float(times[k - 1] if k else before), float(times[k])
            words = Message(
                "the times run backwards ({later:.10g} s after {earlier:.10g} s); give each part its own file",
                later,
                earlier,
            )
            if later == earlier:
                words = Message(
                    "the time {later:.10g} s stands twice; export the times with more decimals", later
                )
            raise DataError("{where}: line {line}: {why}", self._where, lines[k], words)
        self._times.extend(times)

    def _note_kinds(self, kinds: dict[str, str], cells: set[str]) -> None:
        """Note whether the cells of a column prove their decimal mark, or could have groups of thousands."""
        for cell in cells:
            if self._mark in cell:
                if export_text.NUMBERISH.fullmatch(cell):
                    kinds[export_text.vote(cell)] = cell
            elif "plain" not in kinds and not {".", ","} & {*cell} and self._number(cell):
                kinds["plain"] = cell

    # -- the whole ------------------------------------------------------------------------------

    def export(self) -> Export:
        """All that was taken; raises DataError where there is nothing, or numbers have two readings."""
        forces = np.array(self._forces) * (self._newtons * self._given.sign)
        if not np.isfinite(forces).any():
            if self._n_texts:
                raise DataError(
                    "{where}: no row has a time beside its force, as {row}; wanted: s, h:min:s with or without a date"
                    " as 2026-11-25, or Unix times",
                    self._where,
                    repr(self._first_text),
                )
            raise DataError("{where}: holds no forces", self._where)
        if (most := np.nanmax(np.abs(forces))) > MAX_FORCE_N:
            raise DataError(
                "{where}: a force of {most:.3g} N is beyond sense; give --load-unit", self._where, most
            )
        for kinds in self._kinds.values():
            if self._given.decimal is None and kinds.keys() >= {"?", "plain"} and self._mark not in kinds:
                raise export_text.two_readings(self._where, kinds["?"])
        times = self._to_dates(np.array(self._times)) if self._times else None
        clock = self._zero(times)
        return Export(
            tuple(self._names), times, forces, clock, self._taken(forces, clock), tuple(self._remarks)
        )

    def _zero(self, times: Array | None) -> Literal["", "clock", "unix"]:
        """What the times count from, with remarks on what was assumed and left out."""
        add = self._remarks.append
        if self._n_texts:
            add(Message("{lines} of text left out", counted(self._n_texts, "line")))
        if self._n_unread or self._other:
            add(Message("{table}: its {rows} are not read", self._other, counted(self._n_unread, "row")))
        if times is None:
            return ""
        if self._is_clock:
            return "clock" if self._dates or times[0] >= 3600.0 else ""
        if times[0] > _UNIX_S:
            return "unix"
        if not self._time_unit and not self._table.is_ours:
            add(Message("the times have no unit: taken as seconds; if it is another, give --load-unit N,ms"))
        return ""

    def _taken(self, forces: Array, clock: str) -> str:
        t, low, high = self._table, _shown(np.nanmin(forces)), _shown(np.nanmax(forces))
        plain = "h:min:s" if self._is_clock else self._time_unit or "s"
        kind = {"clock": Message("times of the day"), "unix": Message("Unix times")}.get(clock, plain)
        key = t.name(t.key) if t.key is not None else ""
        with_kind = Message(" against {column} ({kind})", key, kind)
        against = "" if t.key is None else Message(" against {column}", key) if t.by_name else with_kind
        return Message(
            "column {column}, {unit}, {n} rows, {low} to {high} N{against}; {form}, decimal {mark}",
            t.name(t.force), self._unit, grouped(len(forces)), low, high, against, t.form,
            Message("comma") if self._decimal == "comma" else Message("point"),
        )  # fmt: skip


def _shown(force: float) -> str:
    return grouped(force) if abs(force) >= 1000 else f"{force + 0.0:.4g}"  # not -0
