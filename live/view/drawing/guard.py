"""What ends the process that draws when nobody else does: a parent that has gone, a memory that has grown."""

from __future__ import annotations

import os
import resource
import select
import signal
import socket
import sys
import threading
from pathlib import Path

GRACE_S = 5.0
"""For drawing what waits and closing the file once the parent has gone."""


def follow(parent: socket.socket) -> None:
    """End this process ``GRACE_S`` after ``parent`` is closed at the other end, wherever it hangs then."""
    threading.Thread(target=_follow, args=(parent.fileno(),), name="guard", daemon=True).start()


def _follow(number: int) -> None:
    poll = select.poll()
    poll.register(number, 0)  # a closed end is told unasked
    poll.poll()
    threading.Event().wait(GRACE_S)
    os.kill(os.getpid(), signal.SIGKILL)  # it may hang anywhere


def memory_MiB() -> float:
    """Resident memory of this process (its largest so far where the system does not tell)."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20
    except (OSError, ValueError, IndexError):
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return most / 2**20 if sys.platform == "darwin" else most / 2**10
