"""Software triggers at a steady rate, by a thread: a request to a camera that is gone blocks for seconds."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from acquire.genicam.device import GenicamDevice
from acquire.genicam.library import GenicamError


class SoftwareTrigger:
    """Triggers one picture each period, until ``stop``.

    Parameters
    ----------
    device : GenicamDevice
        Streaming.
    period_s : float, s
    report : callable taking a text
        Called once, when a trigger is refused.
    """

    def __init__(self, device: GenicamDevice, period_s: float, report: Callable[[str], None]) -> None:
        self._device, self._period_s, self._report = device, period_s, report
        self._stopped = threading.Event()
        threading.Thread(target=self._work, name="genicam-trigger", daemon=True).start()

    def _work(self) -> None:
        due = time.monotonic()
        while not self._stopped.wait(max(0.0, due - time.monotonic())):
            try:
                self._device.ask("arv_camera_software_trigger")
            except GenicamError as error:
                if not self._stopped.is_set():
                    self._report(f"triggers are refused: {error}")
                return
            due = max(due + self._period_s, time.monotonic())

    def stop(self) -> None:
        """No more triggers."""
        self._stopped.set()
