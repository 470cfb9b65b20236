"""The decorator of compiled loops that numba keeps for the next process, each file with a checksum behind it.

A power cut leaves files that are empty, cut, or of zeros. Numba would raise an error on them, or run what they hold;
here they are compiled anew. Without this module numba reads its files too, since it ignores what follows.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile

_DIGEST = 32  # bytes of SHA-256


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """``numba.njit`` whose cache is checked."""

    def compiled(function: Callable[..., Any]) -> Any:
        dispatcher = numba.njit(**options)(function)
        with contextlib.suppress(AttributeError):  # numba's own affair, or nothing is kept
            dispatcher._cache._cache_file.__class__ = KeptFile
        return dispatcher

    return compiled


class _Pieces(list[bytes]):
    """A file in memory."""

    write = list.append


class KeptFile(IndexDataCacheFile):  # type: ignore[misc]
    """Index and data of one function; what is not whole is as if it were not there."""

    def _load_index(self) -> dict[Any, str]:
        index = super()._load_index() if _is_whole(self._index_path) else {}
        return {key: name for key, name in index.items() if _is_whole(self._data_path(name))}

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[_Pieces]:
        pieces = _Pieces()
        yield pieces
        data = b"".join(pieces)
        with super()._open_for_write(filepath) as file:
            file.write(data + hashlib.sha256(data).digest())


def _is_whole(path: str) -> bool:
    try:
        status = os.stat(path)  # noqa: PTH116 - a string, as numba has it
        return _matches(path, status.st_mtime_ns, status.st_size)
    except OSError:
        return False


@cache
def _matches(path: str, time: int, size: int) -> bool:
    """Read once a process and version of the file."""
    data = Path(path).read_bytes()
    return hashlib.sha256(data[:-_DIGEST]).digest() == data[-_DIGEST:]
