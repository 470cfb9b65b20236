"""Faults of V4L2 cameras: in words, who holds a camera, and where an unplugged one came back."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path

from acquire.text import Message, joined
from acquire.v4l2.api import Kernel
from acquire.v4l2.device import Identity, NotACamera, V4L2Device


def identities(kernel: Kernel, nodes: Iterable[str]) -> dict[str, Identity]:
    """Who each of these nodes is; those that are no cameras or do not open are left out."""
    seen: dict[str, Identity] = {}
    for node in nodes:
        with contextlib.suppress(OSError, NotACamera), contextlib.closing(V4L2Device(node, kernel)) as device:
            seen[node] = device.identity
    return seen


def find_again(
    kernel: Kernel, path: str, identity: Identity, others: Collection[Identity] = ()
) -> str | None:
    """The node that a camera has now; None while it is away.

    Parameters
    ----------
    kernel : Kernel
    path : str
        Where it was.
    identity : Identity
    others : collection of Identity
        Cameras that were there beside it: never taken for it, though they may have its name.

    Returns
    -------
    str or None
        The node of the same identity; else the only one of its name, on another port.
    """
    seen = identities(kernel, dict.fromkeys([path, *kernel.nodes()]))
    exact = [node for node, found in seen.items() if found == identity]
    if exact:
        return exact[0]
    alike = [
        node
        for node, found in seen.items()
        if found not in others and replace(found, bus=identity.bus) == identity
    ]
    return alike[0] if len(alike) == 1 else None


_FAULTS = {
    errno.ENODEV: Message("the camera was unplugged or its driver is gone"),
    errno.ENXIO: Message("the camera was unplugged or its driver is gone"),
    errno.EIO: Message("the driver reports a fatal error of the stream"),
    errno.EPROTO: Message("the driver reports a fatal error of the stream (USB protocol)"),
    errno.ENOSPC: Message("not enough USB bandwidth"),
    errno.ETIMEDOUT: Message("the camera has stalled"),
}


def fault_in_words(error: OSError) -> str:
    """What a failed request means, for a person."""
    words = _FAULTS.get(error.errno or 0, "a request to the camera failed")
    return Message("{words} ({strerror})", words, error)


def why_not_open(path: str, error: OSError, kernel: Kernel) -> str:
    """Why a camera cannot be opened, and what to do."""
    if error.errno == errno.ENOENT:
        return Message("{path}: there is no such device; {cameras_here}", path, cameras_here(kernel))
    if error.errno in (errno.EACCES, errno.EPERM):
        return Message(
            "{path}: no permission; add yourself to the group that owns it (sudo usermod -aG video $USER, then "
            "log in again; docs/cameras.md)",
            path,
        )
    if error.errno == errno.EBUSY:
        return Message(
            "{path}: another program holds the camera{holders}; close it and try again", path, _holders(path)
        )
    if error.errno == errno.ENOSPC:
        return Message(
            "{path}: not enough USB bandwidth; ask for a smaller picture or rate, or use another USB controller",
            path,
        )
    return Message(
        "{path}: {fault_in_words}; unplug it, plug it in again and try once more", path, fault_in_words(error)
    )


def _holders(path: str) -> str:
    """The programs that have the node open, as far as we may see."""
    real = os.path.realpath(path)
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if any(os.path.realpath(fd) == real for fd in (process / "fd").iterdir()):
                found.append(
                    Message("{program}, PID {name}", (process / "comm").read_text().strip(), process.name)
                )
    others = [words for words in found if not words.endswith(f" {os.getpid()}")]
    return f" ({'; '.join(others)})" if others else ""


def cameras_here(kernel: Kernel) -> str:
    """All cameras there are, for messages."""
    found = [
        Message("{node} ({card})", node, identity.card)
        for node, identity in identities(kernel, kernel.nodes()).items()
    ]
    return (
        Message("cameras here: ")
        + (joined(", ", found) if found else Message("none"))
        + Message("; see phasedic devices")
    )
