"""The text of an exported file: its encoding, its lines in blocks, and their cells."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator
from typing import BinaryIO

from acquire.errors import DataError
from acquire.text import Message

HEAD = 1 << 18
"""Bytes or characters at the beginning of a file in which its form is found."""
_BLOCK, _LONGEST = 1 << 20, 1 << 20  # characters that are read at once, and of a line
_MAGIC = {
    b"PK\x03\x04": Message("a workbook or an archive"), b"\xd0\xcf\x11\xe0": Message("an Excel workbook"),
    b"TDSm": Message("a TDMS file"),
    b"%PDF": Message("a PDF"), b"\x89HDF": Message("an HDF5 file"), b"\x1f\x8b": Message("compressed"),
}  # fmt: skip
_BOMS = {
    codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16",
}  # fmt: skip
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1c-\x1f\x7f]")
_JAPANESE = re.compile("荷重|試験力|時間|時刻")

Rows = list[list[str]]


def encoding_of(file: BinaryIO, where: str) -> str:
    """The encoding by its mark, else the first that fits; raises DataError for what is no text."""
    head = file.read(HEAD)
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            raise DataError("{where}: is {kind}, no text; export the forces as CSV or text", where, kind)
    for bom, encoding in _BOMS.items():
        if head.startswith(bom):
            return encoding
    zeros = [head[k::2].count(0) for k in (0, 1)]
    found = "utf-8"
    if max(zeros) > len(head) // 4 and min(zeros) == 0:
        found = "utf-16-le" if zeros[1] else "utf-16-be"
    elif _decoded(head, "utf-8") is None:
        found = "cp932" if _JAPANESE.search(_decoded(head, "cp932") or "") else "cp1252"
    if _CONTROL.search(head.decode(found, "replace")):
        raise DataError("{where}: is binary, no text; export the forces as CSV or text", where)
    return found


def _decoded(head: bytes, encoding: str) -> str | None:
    try:
        return codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return None


def lines_of(file: BinaryIO, encoding: str, where: str) -> Iterator[list[str]]:
    """All lines, some at once."""
    file.seek(0)
    text, left, count = io.TextIOWrapper(file, encoding, errors="replace"), "", 0
    try:
        while read := text.read(_BLOCK):
            *lines, left = (left + read).split("\n")
            count += len(lines)
            if len(left) > _LONGEST:
                raise DataError(
                    "{where}: line {line} has more than {most:,} characters; no table",
                    where,
                    count + 1,
                    _LONGEST,
                )
            yield lines
        if left:
            yield [left]
    finally:
        text.detach()


def split_rows(lines: list[str], separator: str) -> tuple[Rows, int | None]:
    """A row for each line, and the line of a quote that goes on in the next one: its row has the place of the last."""
    if separator[0] == " ":
        parting = re.compile(rf"{separator}(?!\(|\[) *")  # not before a unit in brackets
        lines, separator = [parting.sub("\t", line.strip()) for line in lines], "\t"
    rows = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
    if len(rows) == len(lines):
        return rows, None
    rows, broken, reader = [], None, csv.reader(lines, delimiter=separator, skipinitialspace=True)
    for row in reader:
        if len(rows) < reader.line_num - 1 and broken is None:
            broken = len(rows)
        rows += [[]] * (reader.line_num - 1 - len(rows))
        rows.append(row)
    return rows, broken
