"""Room on a disk, and how long it lasts."""

from __future__ import annotations

import math
import os
import shutil
from pathlib import Path


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


NETWORK = frozenset({"nfs", "nfs4", "cifs", "smb3", "smbfs", "fuse.sshfs", "9p", "afs", "ceph", "davfs"})


def network_share(
    path: str | os.PathLike[str], mounts: str | os.PathLike[str] = "/proc/mounts"
) -> str | None:
    """The kind of network file system that holds ``path``; None for a local disk or where nobody says."""
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
