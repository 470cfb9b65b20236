"""Bytes of a regular file. A pipe, device or socket would wait or run for ever and is refused unopened."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from acquire.errors import DataError

MOST_BYTES = 2**31 - 1
_KINDS = {
    stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device", stat.S_IFBLK: "a device",
}  # fmt: skip


def check_regular(path: Path) -> int:
    """The size of a regular file, bytes.

    Raises
    ------
    DataError
        Missing, not to be looked at, or no regular file.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read: {_why(error)}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "no file")
        raise DataError(f"{path}: cannot be read: it is {kind}; give a regular file")
    return status.st_size


def read_bytes(path: Path, most: int = MOST_BYTES) -> bytes:
    """All of a regular file of at most ``most`` bytes.

    Raises
    ------
    DataError
        As ``check_regular``, larger, or unreadable.
    """
    size = check_regular(path)
    if size > most:
        raise DataError(
            f"{path}: {size / 1e6:.0f} MB are more than the {most / 1e6:.0f} MB such a file may have"
        )
    try:
        # Whatever took the place of the file in the meantime does not make us wait.
        with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            return file.read(size)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {_why(error)}") from error


def _why(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
