"""The disk below a file: its free space, and when what is written is flushed and brought to it.

A flush is often enough for a kill to lose little, and seldom enough to cost little; data are on the disk soon enough
for a power cut to lose little.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import shutil
import threading
import time
from pathlib import Path

from acquire.clock import Clock
from acquire.system import forget_pages, to_disk
from acquire.text import Message

NETWORK = frozenset({"nfs", "nfs4", "cifs", "smb3", "smbfs", "fuse.sshfs", "9p", "afs", "ceph", "davfs"})

SYNC_S, CLOSE_TIMEOUT_S = 1.0, 10.0
"""Between two times that a file is brought to its disk, and the longest wait for the last one."""

SYNC_BYTES, LOOK_S = 32 << 20, 0.1
"""So much is brought sooner; time between two looks at it. A second of fast pictures at once holds others up."""

KEPT_BYTES = 8 << 20
"""Of the end of a file, which is written to again, stay in memory."""

_CANNOT = (errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP)


def free_bytes(path: str | os.PathLike[str]) -> int:
    """Bytes free for this user on the disk that holds ``path``.

    The file itself need not exist yet; the nearest folder above it that does counts.

    Raises
    ------
    OSError
        The disk is gone.
    """
    place = Path(path).absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    return shutil.disk_usage(place).free


def forecast(path: str | os.PathLike[str], bytes_per_s: float) -> float:
    """Seconds until the disk that holds ``path`` is full at this rate; infinite at rate zero."""
    return free_bytes(path) / bytes_per_s if bytes_per_s > 0 else math.inf


def network_share(
    path: str | os.PathLike[str], mounts: str | os.PathLike[str] = "/proc/mounts"
) -> str | None:
    """The kind of network file system that holds ``path``; None for a local disk or an unknown one."""
    place = str(Path(path).resolve())
    try:
        lines = Path(mounts).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    best, kind = "", ""
    for line in lines:
        fields = line.split()
        if len(fields) < 3:
            continue
        point = fields[1].replace("\\040", " ")
        if (place + "/").startswith(point.rstrip("/") + "/") and len(point) >= len(best):
            best, kind = point, fields[2]
    return kind if kind in NETWORK else None


def path_of(descriptor: int, path: Path) -> Path:
    """Where the open file or folder ``path`` is now, whatever it is called since; as it was where no system tells."""
    with contextlib.suppress(OSError):
        now = Path(f"/proc/self/fd/{descriptor}").readlink()
        if now.exists() and not (path.exists() and path.samefile(now)):
            return now
    return path


class FolderWatch:
    """Holds a folder, so that it is found again where it is renamed.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._held = os.open(path, os.O_RDONLY) if os.name == "posix" and path.is_dir() else -1

    def end(self) -> Path:
        """Where it is now; it is held no longer."""
        if self._held >= 0:
            self._path = path_of(self._held, self._path)
            os.close(self._held)
            self._held = -1
        return self._path


class FileWatch:
    """Notices that a file that is written here was removed, or cut, by somebody else.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path, self._file = path, os.open(path, os.O_RDONLY)
        found = os.fstat(self._file)
        self._links, self._size = found.st_nlink, found.st_size

    def check(self) -> None:
        """To be called before a write: raises OSError where the file is not as ``wrote`` has left it.

        Where it is whole, but has another name now, that is FileNotFoundError.
        """
        found = os.fstat(self._file)
        if found.st_nlink < self._links:
            raise OSError(errno.EIO, "somebody has removed it")
        if found.st_size < self._size:
            raise OSError(errno.EIO, f"somebody has cut it to {found.st_size} of {self._size} bytes")
        if not self._path.exists() and not (self.path.exists() and self.path.name == self._path.name):
            raise FileNotFoundError(errno.ENOENT, Message("somebody has renamed it"))

    @property
    def path(self) -> Path:
        """Where the file is now: a folder may be renamed."""
        return path_of(self._file, self._path)

    def wrote(self) -> None:
        """To be called after a write."""
        self._size = os.fstat(self._file).st_size

    def close(self) -> None:
        """Close its own descriptor."""
        os.close(self._file)


class FlushTimer:
    """When the next flush is due.

    Parameters
    ----------
    every_s : float, s
        What was written waits no longer for a flush, and flushes are no closer to each other.
    now : callable
        Gives seconds.
    """

    def __init__(self, every_s: float, now: Clock = time.monotonic) -> None:
        self._every_s, self._now = every_s, now
        self._last = -math.inf
        self._waits = False

    def wrote(self) -> None:
        """Something waits."""
        self._waits = True

    def began(self) -> None:
        """A flush begins."""
        self._last = self._now()

    def done(self) -> None:
        """It is done: nothing waits."""
        self._waits = False

    def left_s(self) -> float:
        """Time until the next flush is due, s; 0 where it is now, infinite where nothing waits."""
        return max(0.0, self._last + self._every_s - self._now()) if self._waits else math.inf


class DiskSync:
    """Brings what stands in a file to its disk, and frees the memory, on a thread of its own.

    It does so once a second, and after ``SYNC_BYTES``.

    Left to itself the system keeps half a minute of pictures in memory: gone with the power, written all at once when
    they must, and a disk that fails is not noticed. Memory that is used again and again is cheaper too: on a virtual
    machine that gives free memory back, a picture of 1.3 MB took 5 ms of the system's time, and takes 0.5 with this.

    Parameters
    ----------
    path : Path
        Of a file that is open for writing somewhere else.
    every_s : float, s

    Attributes
    ----------
    failure : OSError or None
        Error of the disk.
    """

    def __init__(self, path: Path, every_s: float = SYNC_S) -> None:
        self.failure: OSError | None = None
        self._every_s, self._ended = every_s, threading.Event()
        self._brought_bytes, self._brought_t = 0, time.monotonic()
        self._file = os.open(path, os.O_RDONLY)
        self._thread = threading.Thread(target=self._work, name="disk", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Once more, and no more; may be called again."""
        self._ended.set()
        self._thread.join(CLOSE_TIMEOUT_S)

    def _work(self) -> None:
        try:
            while not self._ended.wait(min(LOOK_S, self._every_s)):
                if self._is_due():
                    self._bring()
            self._bring()
        except OSError as error:
            self.failure = None if error.errno in _CANNOT else error
        finally:
            os.close(self._file)

    def _is_due(self) -> bool:
        grown = os.fstat(self._file).st_size - self._brought_bytes
        return grown >= SYNC_BYTES or time.monotonic() >= self._brought_t + self._every_s

    def _bring(self) -> None:
        size = self._brought_bytes = os.fstat(self._file).st_size
        self._brought_t = time.monotonic()
        to_disk(self._file)
        if size > KEPT_BYTES:
            forget_pages(self._file, size - KEPT_BYTES)
