"""A simulated indicator on a pseudo-terminal: a thread that samples, sends and answers.

``PtyPort`` is a serial port with a program at its other end, under a steady name: a symbolic link, so that the port
can be pulled out and comes back where it was. One slave descriptor stays open, so that the reader may close and
open as often as it likes.
"""

from __future__ import annotations

import logging
import os
import select
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from acquire.closing import Closing
from acquire.system import open_pty
from hw_mocks.faults import FaultPlan
from hw_mocks.indicator import Indicator, IndicatorOutput, Sensing


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
        self._master, self._slave, name = open_pty()
        self._link.symlink_to(name)

    def unplug(self) -> None:
        """Pull it out: whoever has it open gets an error, and the name is gone."""
        if not self.plugged:
            return
        self._link.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    def write(self, data: bytes, timeout_s: float = 0.0) -> None:
        """Send; what does not fit into the line's buffer within ``timeout_s`` of waiting is lost."""
        while data and self.plugged:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                if not select.select([], [self._master], [], timeout_s)[1]:
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
        """Unplug for good; idempotent."""
        self.unplug()
        if self._folder.exists():
            self._folder.rmdir()


log = logging.getLogger(__name__)
POLL_S = 0.05
SPLIT_S = 0.03
BACKLOG_TIMEOUT_S = 0.2  # for a backlog that does not fit into the line's buffer at once


class IndicatorServer(Closing):
    """Runs an indicator until ``close``.

    Samples are taken on whole milliseconds of the device's clock, as firmware does, so that the
    time a line carries is exactly that of its force.

    Parameters
    ----------
    indicator : Indicator
    sensing : Sensing
    seed : int
    faults : FaultPlan
    clock : callable giving monotonic seconds

    Attributes
    ----------
    path : str
        What to open as the serial port.
    """

    def __init__(
        self,
        indicator: Indicator,
        sensing: Sensing,
        *,
        seed: int = 0,
        faults: FaultPlan | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock, self._boot = clock, clock()
        self._output = IndicatorOutput(indicator, sensing, self._boot, seed, faults)
        self._port = PtyPort()
        self.path = self._port.path
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._work, name="sim-indicator", daemon=True)
        self._thread.start()

    @property
    def lost_bytes(self) -> int:
        """Bytes that found the line's buffer full."""
        return self._port.lost_bytes

    def close(self) -> None:
        """End the thread and remove the port; idempotent."""
        self._stopped.set()
        self._thread.join()
        self._port.close()

    def _work(self) -> None:
        try:
            ideal = 0.0  # s since the boot, before rounding to milliseconds
            while not self._stopped.is_set():
                t = self._boot + round(ideal * 1e3) / 1e3
                self._listen_until(t)
                self._plug(t)
                self._send(t)
                ideal += self._output.interval(t)
        except Exception:
            log.exception("the simulated indicator failed")

    def _listen_until(self, t: float) -> None:
        while not self._stopped.is_set() and (left := t - self._clock()) > 0:
            if not self._port.plugged:
                self._stopped.wait(min(left, POLL_S))
            elif data := self._port.read(min(left, POLL_S)):
                self._port.write(self._output.answers(data, self._clock()))

    def _plug(self, t: float) -> None:
        if self._output.unplugged(t):
            self._port.unplug()
        else:
            self._port.plug()

    def _send(self, t: float) -> None:
        for i, chunk in enumerate(self._output.sample(t)):
            if i:
                self._stopped.wait(SPLIT_S)
            self._port.write(chunk, BACKLOG_TIMEOUT_S if len(chunk) > 1000 else 0.0)
