"""The table of a campaign: ``summary.csv`` and ``summary.parquet``, each whole or not there."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acquire.errors import DataError
from live.batch.work import COLUMNS, Row, Value


def write_summary(rows: Sequence[Row], out: Path) -> list[Path]:
    """Write both, in place of those of an earlier call; Parquet where pyarrow is installed.

    Raises
    ------
    DataError
        They cannot be written; the earlier ones stay.
    """
    made = {"summary.csv": as_csv(rows)}
    if (table := as_parquet(rows)) is not None:
        made["summary.parquet"] = table
    for name, content in made.items():
        _put(out / name, content)
    return [out / name for name in made]


def as_csv(rows: Sequence[Row]) -> bytes:
    """A line a test, with a heading; what is not known is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(row.values[name]) for name in COLUMNS] for row in rows)
    return text.getvalue().encode()


def as_parquet(rows: Sequence[Row]) -> bytes | None:
    """The same with types; None without pyarrow."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return None
    kinds = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
    sink = io.BytesIO()
    parquet.write_table(pyarrow.Table.from_pylist([dict(row.values) for row in rows], schema), sink)
    return sink.getvalue()


def _cell(value: Value) -> Any:
    """No program takes a word for a formula."""
    return value.lstrip("=+-@\t ") if isinstance(value, str) else "" if value is None else value


def _put(path: Path, content: bytes) -> None:
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise DataError(f"{path}: cannot be written ({error.strerror}); make room and call again") from error
