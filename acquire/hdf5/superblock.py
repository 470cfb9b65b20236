"""Looking at an HDF5 file before the library does: its superblock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquire.errors import DataError

SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True, slots=True)
class Superblock:
    """The first bytes of an HDF5 file, as far as they tell its state.

    Attributes
    ----------
    unfinished : bool
        Not closed by its writer.
    size : int, bytes
        Size that the file must have, where it was closed.
    """

    unfinished: bool
    size: int


def read_superblock(path: Path) -> Superblock:
    """The superblock of ``path`` (HDF5 file format specification, version 2 and 3).

    Raises
    ------
    DataError
        No such file, unreadable, or not HDF5 of this kind.
    """
    if path.exists() and not path.is_file():
        raise DataError(f"{path} is no regular file; give a file that a run has written")
    if not path.is_file():
        raise DataError(f"{path}: no such file; give a session.h5 that a run has recorded")
    try:
        with path.open("rb") as file:
            begin = file.read(48)
    except OSError as error:
        raise DataError(f"{path} cannot be read ({error.strerror}); check its permissions") from error
    if not begin.startswith(SIGNATURE):
        raise DataError(f"{path} is not an HDF5 file, so not a session; give a session.h5")
    if len(begin) < 48:
        raise DataError(f"{path} is truncated to {len(begin)} bytes; nothing in it can be read")
    if begin[8] not in (2, 3) or begin[9] != 8:
        return Superblock(False, 0)
    return Superblock(begin[11] != 0, int.from_bytes(begin[28:36], "little"))


def check_size(path: Path, block: Superblock) -> None:
    """Refuse a file that was closed and has lost its end since.

    Raises
    ------
    DataError
    """
    there = path.stat().st_size
    if not block.unfinished and there < block.size:
        raise DataError(
            f"{path} is truncated: {there} of {block.size} bytes are there; copy it again from where it came"
        )
