"""A serial port with nothing but a program at its other end: a pseudo-terminal under a steady name.

The name is a symbolic link, so that the port can be pulled out and comes back where it was. One
slave descriptor stays open, so that the reader may close and open as often as it likes.
"""

from __future__ import annotations

import os
import pty
import select
import tempfile
import tty
from pathlib import Path


class PtyPort:
    """The device's side of the line.

    Attributes
    ----------
    path : str
        What to open as the serial port.
    lost_bytes : int
        Written while nobody read and the line's buffer (4095 bytes) was full.
    """

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="phasedic-sim-"))
        self._link = self._folder / "tty"
        self.path = str(self._link)
        self._master = self._slave = -1
        self.lost_bytes = 0
        self.plug()

    @property
    def plugged(self) -> bool:
        """Whether the port is there."""
        return self._master >= 0

    def plug(self) -> None:
        """Make the port appear (again)."""
        if self.plugged:
            return
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._link.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Pull it out: whoever has it open gets an error, and the name is gone."""
        if not self.plugged:
            return
        self._link.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    def write(self, data: bytes, patience_s: float = 0.0) -> None:
        """Send; what finds no room in the line's buffer within ``patience_s`` of waiting is lost."""
        while data and self.plugged:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                if not select.select([], [self._master], [], patience_s)[1]:
                    self.lost_bytes += len(data)
                    return

    def read(self, timeout_s: float) -> bytes:
        """What the host sent within ``timeout_s``; b"" for nothing."""
        if not self.plugged or not select.select([self._master], [], [], max(timeout_s, 0.0))[0]:
            return b""
        try:
            return os.read(self._master, 4096)
        except OSError:
            return b""

    def close(self) -> None:
        """Unplug for good; may be called again."""
        self.unplug()
        if self._folder.exists():
            self._folder.rmdir()
