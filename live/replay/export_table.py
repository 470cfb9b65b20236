"""Where the table of forces is in a text file: separator, heading, units, columns; and its rows in blocks.

The heading may be below a preamble or a block of results, and have its units in a row below it. Two columns that could
be the force are refused with the option that settles it (docs/load-cells.md).
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import BinaryIO

from acquire.errors import DataError
from acquire.text import Message, joined
from acquire.text.message import counted
from live.config.sections import LoadConfig
from live.replay.export_text import (
    EMPTY,
    HEAD,
    NUMBERISH,
    Rows,
    encoding_of,
    find_columns,
    given_columns,
    is_unit,
    is_value,
    lines_of,
    name_and_unit,
    newtons_of,
    plain_unit,
    split_rows,
)

_SEPARATORS = {
    "\t": Message("tabs"), ";": Message("semicolons"), "|": Message("bars"), ",": Message("commas"),
    "  ": Message("blanks"), " ": Message("blanks"),
}  # fmt: skip
_TIMES = ("time", "clock", "duration")
_BETWEEN = 5  # lines of text and blanks between a heading and its rows, at most
_SHORT = {"file", "time", "time_s", "t", "force", "F"}
"""Our own headings; with them a force without a unit is in newtons."""


@dataclass(frozen=True, slots=True)
class Table:
    """Where the table is in its file, and its columns.

    Attributes
    ----------
    encoding, separator : str
    heads : tuple of str
        With the units below them; numbers where there is no heading.
    first : int
        Line of the first row of values, from 0.
    force : int
    key : int or None
        Column of times or names; None where there is one row a picture.
    by_name : bool
    texts : tuple of tuple of str
        The heading and the lines between it and the values.
    date : int or None
        Column of dates beside one of times.
    remarks : tuple of str
        Tables above that are left out.
    """

    encoding: str
    separator: str
    heads: tuple[str, ...]
    first: int
    force: int
    key: int | None
    by_name: bool
    texts: tuple[tuple[str, ...], ...]
    date: int | None = None
    remarks: tuple[str, ...] = ()

    @property
    def is_ours(self) -> bool:
        """Whether newtons are meant where there is no unit: without a heading, and under our own."""
        return not self.texts or (len(self.heads) == 2 and set(self.texts[0]) <= _SHORT)

    def name(self, column: int) -> str:
        """Name of a column without its unit."""
        return name_and_unit(self.heads[column])[0]

    @property
    def form(self) -> str:
        """Encoding and separator for a person."""
        return joined(", ", (self.encoding.upper().removesuffix("-SIG"), _SEPARATORS[self.separator]))


def cell_of(row: Sequence[str], column: int | None) -> str:
    """A cell without blanks around it; "" where the row is too short."""
    return row[column].strip() if column is not None and column < len(row) else ""


def is_remark(row: Sequence[str]) -> bool:
    """Whether a row is empty or begins with ``#``."""
    return not any(row) or (row[0].startswith("#") and len(row[0]) > 1)


def blocks(file: BinaryIO, table: Table, where: str) -> Iterator[tuple[int, Rows]]:
    """The rows of the table and what follows, in blocks: number of the first line, from 1, and a row for each line.

    Raises
    ------
    DataError
        A line is too long or has a quote that is not closed.
    """
    line = 0
    for lines in lines_of(file, table.encoding, where):
        skipped = max(0, table.first - line)
        try:
            rows, broken = split_rows(lines[skipped:], table.separator)
        except csv.Error as error:
            raise DataError(
                "{where}: no table after line {line}: {why}", where, line + skipped + 1, error
            ) from error
        if broken is not None:
            raise DataError(
                "{where}: a quote in line {line} is not closed; mend it", where, line + skipped + broken + 1
            )
        if rows:
            yield line + skipped + 1, rows
        line += len(lines)


# -- the table ----------------------------------------------------------------------------------


def find_table(file: BinaryIO, where: str, given: LoadConfig) -> Table:
    """The longest table with a force against times or names; else with one row a picture; else without a heading.

    Raises
    ------
    DataError
        The file is no text, or has no such table, or two columns could be the force.
    """
    encoding = encoding_of(file, where)
    lines: list[str] = []
    for more in lines_of(file, encoding, where):
        lines += more
        if sum(map(len, lines)) > HEAD:
            break
    lines = lines[:20_000]
    if not any(line.strip() and not line.startswith("#") for line in lines):
        raise DataError("{where}: holds no forces", where)
    parted = {mark: _head_rows(lines, mark) for mark in _SEPARATORS if any(mark in line for line in lines)}
    parted, empty = parted or {",": _head_rows(lines, ",")}, False
    for needs_key in (True, False):
        for separator, rows in parted.items():
            search = _Search(where, given, encoding, separator, rows, needs_key)
            found = [table for k in range(len(rows)) if (table := search.at(k))]
            # of equal ones the nearest heading
            longest = max(reversed(found), key=search.length, default=None)
            if longest and search.length(longest):
                return search.check(
                    [t for t in found if search.length(t) or t.heads == longest.heads], longest
                )
            empty = empty or bool(found)
    if empty:
        raise DataError("{where}: holds no forces below their heading", where)
    return _without_heading(parted, where, given, encoding)


def _head_rows(lines: list[str], separator: str) -> Rows:
    try:
        rows, _ = split_rows(_named_by_remark(lines, separator), separator)
    except csv.Error:
        return []
    rows = [[] if is_remark(row) else [" ".join(cell.split()) for cell in row] for row in rows]
    return [_trimmed(row) for row in rows]


def _named_by_remark(lines: list[str], separator: str) -> list[str]:
    """The same lines; a remark that names the values below it, as numpy.savetxt writes, is their heading."""
    first = next((k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")), 0)
    for k in reversed(range(first)):
        (heads, values), _ = split_rows([lines[k].lstrip("# "), lines[first]], separator)
        if (
            len(heads) == len(values)
            and find_columns(heads, "force")
            and _has_value([*map(str.strip, values)])
        ):
            return [*lines[:k], separator.join(heads), *lines[k + 1 :]]
    return lines


def _trimmed(row: list[str]) -> list[str]:
    """Without the empty cells at the end."""
    while row and not row[-1]:
        row = row[:-1]
    return row


@dataclass(frozen=True, slots=True)
class _Search:
    """A search for a table in the first rows of a file."""

    where: str
    given: LoadConfig
    encoding: str
    separator: str
    rows: Rows
    needs_key: bool

    def at(self, k: int) -> Table | None:
        """The table whose heading is row ``k``; None where this is no heading."""
        if not self.rows[k] or any(NUMBERISH.fullmatch(head) for head in self.rows[k]):
            return None
        below = [i for i in range(k + 1, min(k + 2 + _BETWEEN, len(self.rows))) if self.rows[i]]
        between = next((n for n, i in enumerate(below) if _has_value(self.rows[i])), 0)
        texts = [self.rows[i] for i in below[:between]]
        labels = [["s", *row[1:]] for row in self.rows[:k] if row[:1] == ["Y_Unit_Label"]]  # LabVIEW
        heads = self._with_units(self.rows[k], [*filter(_is_units, texts), *labels[-1:]])
        first = below[between] if below else len(self.rows)
        heads = self._fitting(heads, len(self.rows[first]) if below else len(heads))
        columns = self._columns(heads)
        if columns is None:
            return None
        return Table(
            self.encoding,
            self.separator,
            tuple(heads),
            first,
            *columns,
            tuple(map(tuple, (self.rows[k], *texts))),
            self._date(heads, columns[1]),
        )

    def _date(self, heads: list[str], key: int | None) -> int | None:
        """The column of dates beside times of the day; none where the times are given."""
        dates = [k for k in find_columns(heads, "date") if k != key]
        return (
            dates[0] if key is not None and len(dates) == 1 and "," not in (self.given.column or "") else None
        )

    def _with_units(self, heads: list[str], rows: Rows) -> list[str]:
        """The heading with the units of the first of ``rows``."""
        found = []
        for n, head in enumerate(heads):
            own, unit = name_and_unit(head)[1], plain_unit(cell_of(rows[0], n)) if rows else ""
            if own and unit and None is not newtons_of(own) != newtons_of(unit) is not None:
                raise DataError(
                    "{where}: {name} has the unit {unit} below it: which one? give --load-unit",
                    self.where,
                    repr(head),
                    repr(unit),
                )
            below = f"{head} [{unit}]"
            found.append(below if not own and name_and_unit(below)[1] else head)
        return found

    def _fitting(self, heads: list[str], width: int) -> list[str]:
        """The heading with units that a comma or blank has parted from their names put back; none where that fails."""
        if len(heads) > width and any(is_unit(plain_unit(head)) for head in heads[1:]):
            joined = heads[:1]
            for head in heads[1:]:
                if is_unit(plain_unit(head)):
                    joined[-1] += f" [{plain_unit(head)}]"
                else:
                    joined.append(head)
            return joined if len(joined) == width else []
        return heads if self.separator[0] != " " or len(heads) == width else []

    def _columns(self, heads: list[str]) -> tuple[int, int | None, bool] | None:
        """Force, key, and whether the key is a name."""
        given = given_columns(heads, self.given.column) if self.given.column else None
        if self.given.column and given is None:
            return None
        name = find_columns(heads, "name")
        time = next(filter(None, (find_columns(heads, kind) for kind in _TIMES)), [])
        if given and given[1] is not None:
            return given[0], given[1], given[1] in name
        keys = name or time
        if self.needs_key and not keys:
            return None
        forces = [given[0]] if given else find_columns(heads, "force")
        if not forces or forces == keys:
            return None
        return forces[0], keys[0] if keys else None, bool(name)

    def check(self, found: list[Table], longest: Table) -> Table:
        """The longest table from before its pause, with what is left out above it.

        Raises
        ------
        DataError
            Other columns could be the force or the time too.
        """
        begin = next(k for k, table in enumerate(found) if table.heads == longest.heads)
        table = found[begin]
        given = given_columns(table.heads, self.given.column) if self.given.column else None
        for kinds, option in ((("force",), "FORCE"), (("name", *_TIMES), "FORCE,TIME")):
            called = next(filter(None, (find_columns(table.heads, kind) for kind in kinds)), [])
            if len(called) > 1 and (given is None or (option != "FORCE" and given[1] is None)):
                words = ", ".join(repr(table.heads[k]) for k in called)
                raise DataError(
                    "{where}: {columns}: which one? give --load-column {wanted}, by heading or number",
                    self.where,
                    words,
                    option,
                )
        left = (
            Message(
                "line {line}: another table ({heading}): its {rows} are not read",
                *(t.first + 1, repr(", ".join(t.heads)[:60]), counted(self.length(t), "row")),
            )
            for t in found[:begin]
            if t.first < table.first  # not the same rows under a line above their heading
        )
        return replace(table, remarks=tuple(left))

    def length(self, table: Table) -> int:
        """The number of rows of values that follow its heading."""
        n = 0
        for row in self.rows[table.first :]:
            cell = cell_of(row, table.force)
            if row and cell.lower() not in EMPTY and not NUMBERISH.fullmatch(cell):
                break
            n += bool(NUMBERISH.fullmatch(cell))
        return n


def _has_value(row: Sequence[str]) -> bool:
    return any(map(is_value, row))


def _is_units(row: Sequence[str]) -> bool:
    return any(is_unit(plain_unit(cell)) for cell in row if len(cell) < 20)


def _without_heading(parted: dict[str, Rows], where: str, given: LoadConfig, encoding: str) -> Table:
    """Two columns, name or seconds and newtons, or those that are given by their numbers; raises DataError."""
    for separator, rows in parted.items():
        first = next((k for k, row in enumerate(rows) if row), 0)
        row = rows[first] if rows else []
        heads = tuple(str(k + 1) for k in range(len(row)))
        columns = given_columns(heads, given.column or "2,1") if _has_value(row) else None
        if columns is None or columns[1] is None or (not given.column and len(row) != 2):
            continue
        force, key = columns
        if NUMBERISH.fullmatch(row[force]):
            by_name = not _has_value([row[key or 0]])
            return Table(encoding, separator, heads, first, force, key, by_name, ())
    shown = max(
        (row for rows in parted.values() for row in rows[:1000] if not _has_value(row)), key=len, default=[]
    )
    shown = shown or next((row for rows in parted.values() for row in rows if row), [])
    what: str = Message("no force against time or picture")
    if given.column:
        what = Message("no column {name}", repr(given.column))
    raise DataError(
        "{where}: {what} under the heading {heading}; wanted: a column force_N (or kN, lbf ...), and file or time_s;"
        " or name them: --load-column FORCE,TIME",
        where,
        what,
        repr(", ".join(shown)[:100]),
    )


def is_heading(row: Sequence[str]) -> bool:
    """Whether a line of text could be the heading of a table."""
    return len([cell for cell in row if cell]) > 1 and not _has_value(row)
