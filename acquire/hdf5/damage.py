"""HDF5 files that are damaged, unfinished or on a full disk, without a hang or a crash of the library.

- ``read_superblock`` and ``check_size`` look at the first bytes before the library does.
- ``probe`` reads a file in a child process with a time limit: HDF5 waits for ever on a truncated file in SWMR
  mode, and may crash on damaged bytes.
- ``abandon_file`` closes a file whose disk takes no more. While closing, HDF5 tries to write once more; when that
  fails too, it crashes the process. So the file is first swapped for the null device, and what stands on the
  disk stays as the last complete flush left it.
- ``create_file`` makes a file in memory first: where the disk is full, HDF5 objects that are closed print
  tracebacks.
"""

from __future__ import annotations

import errno
import io
import logging
import os
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from acquire.errors import DataError
from acquire.system import python_command, python_environment
from acquire.text import Message, word

DAMAGE = (
    OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, MemoryError, OverflowError,
)  # fmt: skip
"""What HDF5, JSON and our own decoding raise on bytes that are not what they were."""
PROBE_S = 30.0  # without a sign of progress: HDF5 retries a bad checksum of an unfinished file for ever
_EVERY_S = 1.0
_PROGRESS = "\0"  # a line of the child
_said = [0.0]

log = logging.getLogger(__name__)
_HELD = (errno.EAGAIN, errno.EACCES)

_BOUNDS = ("v110", "v110")  # the format that survives SIGKILL; older ones promise nothing

CACHE_BYTES, METADATA_BYTES = 16 << 10, 256 << 10
"""Of values of each dataset, and of the structure of a file, that HDF5 keeps in memory: enough to append."""

SIGNATURE = b"\x89HDF\r\n\x1a\n"


def probe(path: Path, package: str, timeout_s: float | None = None, *, words: Sequence[str] = ()) -> None:
    """Read ``path`` by ``python -P -m package path``, with more ``words``, first.

    Parameters
    ----------
    package : str
        Its ``__main__`` reads the file and prints what is wrong with it, exit code 4.
    timeout_s : float or None, s
        From one ``still_reading`` of the child to the next: a long file may take long.

    Raises
    ------
    DataError
        The child crashed, did not end in time, or refused the file itself.
    """
    said: queue.SimpleQueue[str] = queue.SimpleQueue()
    with subprocess.Popen(
        python_command(package, str(path), *words), env=python_environment(), stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True, errors="backslashreplace",
    ) as child:  # fmt: skip

        def listen() -> None:
            for line in child.stdout or ():
                said.put(line)
            said.put("")

        listener, lines = threading.Thread(target=listen, daemon=True), [""]
        listener.start()
        try:
            while line := said.get(timeout=timeout_s or PROBE_S):
                lines += [line] * (line.strip() != _PROGRESS)
        except queue.Empty:
            raise DataError("{path} is damaged: reading it does not come to an end", path) from None
        finally:
            child.kill()
            listener.join()
    if child.returncode != 0:
        refusal = "".join(lines).strip() if child.returncode == DataError.exit_code else ""
        raise DataError(
            refusal
            or Message(
                "{path} is damaged: the HDF5 library fails on it ({returncode})", path, child.returncode
            )
        )


def still_reading() -> None:
    """Called by the child of ``probe`` now and then: it is no endless attempt."""
    if time.monotonic() >= _said[0] + _EVERY_S:
        _said[0] = time.monotonic()
        print(_PROGRESS, flush=True)


def reason(error: Exception) -> str:
    """HDF5's own words, shortened to the part a person can use."""
    text = " ".join(str(error).split())
    _, _, words = text.partition("error message = '")
    plain = error.strerror if isinstance(error, OSError) else ""
    return word(words.partition("'")[0] or (plain or text)[:200])


def open_file(path: Path, mode: str = "r", **options: Any) -> h5py.File:
    """Open an HDF5 file, without a lock where its file system has none; ``options`` as of ``h5py.File``.

    Raises
    ------
    DataError
        Another program has locked it.
    OSError or RuntimeError
        It cannot be opened.
    """
    try:
        return h5py.File(path, mode, **options)
    except OSError as error:
        if "unable to lock file" not in str(error):
            raise
        if error.errno not in _HELD:
            return h5py.File(path, mode, locking=False, **options)
        raise DataError(
            "{path} is locked: another program has it open or writes to it; close it there, or wait, and call "
            "again",
            path,
        ) from error


def abandon_file(file: h5py.File) -> None:
    """Close a file that cannot be written any more, without touching it and without an error."""
    try:
        nowhere = os.open(os.devnull, os.O_RDWR)
        try:
            os.dup2(nowhere, file.id.get_vfd_handle())
        finally:
            os.close(nowhere)
        file.close()
    except (OSError, RuntimeError) as error:
        log.debug("abandoning a file: %s", error)


def create_file(path: Path, declare: Callable[[h5py.File], object]) -> h5py.File:
    """Make a file with what ``declare`` puts into it, open to append while others read (SWMR).

    Its caches are bounded. By default HDF5 keeps up to 1 MiB of each dataset, and 32 MiB of a file's structure: a file
    with some hundred columns then takes more memory for an hour. What it frees it keeps for reuse, as much again.

    Raises
    ------
    FileExistsError
    OSError
        It cannot be written; nothing is left of it.
    """
    # Not HDF5's own image of a file in memory: the checksum in it is wrong up to HDF5 1.14.
    content = io.BytesIO()
    with h5py.File(content, "w", libver=_BOUNDS) as head:
        declare(head)
    stream = path.open("xb")
    try:
        with stream:
            stream.write(content.getbuffer())
    except OSError:
        path.unlink(missing_ok=True)
        raise
    file = open_file(path, "r+", libver=_BOUNDS, rdcc_nbytes=CACHE_BYTES)
    cache = file.id.get_mdc_config()
    cache.set_initial_size = True
    cache.initial_size = cache.min_size = cache.max_size = METADATA_BYTES
    cache.incr_mode = cache.decr_mode = cache.flash_incr_mode = 0
    file.id.set_mdc_config(cache)
    file.swmr_mode = True
    return file


@dataclass(frozen=True, slots=True)
class Superblock:
    """The first bytes of an HDF5 file, as far as they show its state.

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
        raise DataError("{path} is no regular file; give a file that a run has written", path)
    if not path.is_file():
        raise DataError("{path}: no such file; give a session.h5 that a run has recorded", path)
    try:
        with path.open("rb") as file:
            begin = file.read(48)
    except OSError as error:
        raise DataError(
            "{path} cannot be read ({strerror}); check its permissions", path, error.strerror
        ) from error
    if not begin.startswith(SIGNATURE):
        raise DataError("{path} is not an HDF5 file, so not a session; give a session.h5", path)
    if len(begin) < 48:
        raise DataError("{path} is truncated to {count} bytes; nothing in it can be read", path, len(begin))
    if begin[8] not in (2, 3) or begin[9] != 8:
        return Superblock(False, 0)
    return Superblock(begin[11] != 0, int.from_bytes(begin[28:36], "little"))


class PaddedFile(io.RawIOBase):
    """A file that has lost its end, of the size that it had: HDF5 opens none that is shorter.

    What begins beyond the end cannot be read, and what reaches beyond it ends in zeros, which no checksum fits.

    Parameters
    ----------
    path : Path
    size : int, bytes
        What it had.
    """

    def __init__(self, path: Path, size: int) -> None:
        self._file = path.open("rb", buffering=0)
        self._size, self._there, self._at = size, path.stat().st_size, 0

    def readable(self) -> bool:
        """Always."""
        return True

    def seekable(self) -> bool:
        """Always."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As of a file of the whole size."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def readinto(self, buffer: Any) -> int:
        """Bytes of the file, then zeros; raises OSError beyond the end of what is there."""
        wanted = memoryview(buffer)[: max(self._size - self._at, 0)]
        if wanted and self._at >= self._there:
            raise OSError(errno.EIO, "the file is cut off before it")
        self._file.seek(self._at)
        there = self._file.readinto(wanted) or 0
        wanted[there:] = bytes(len(wanted) - there)
        self._at += len(wanted)
        return len(wanted)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()


def check_size(path: Path, block: Superblock) -> None:
    """Refuse a file that was closed and has lost its end since.

    Raises
    ------
    DataError
    """
    there = path.stat().st_size
    if not block.unfinished and there < block.size:
        raise DataError(
            "{path} is truncated: {there} of {size} bytes are there; copy it again from where it came",
            path,
            there,
            block.size,
        )
