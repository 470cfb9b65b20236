"""Software triggers at a steady rate, by a thread: a request to a camera that is gone blocks for seconds."""

from __future__ import annotations

import threading
import time

from acquire.genicam.device import GenicamDevice
from acquire.genicam.library import GenicamError


class SoftwareTrigger:
    """Triggers one picture each period, until ``stop``.

    Parameters
    ----------
    device : GenicamDevice
        Streaming.
    period_s : float, s

    Attributes
    ----------
    refused : str
        Why the camera takes no more triggers; "" while all is well.
    """

    def __init__(self, device: GenicamDevice, period_s: float) -> None:
        self._device, self._period_s, self.refused = device, period_s, ""
        self._stopped = threading.Event()
        threading.Thread(target=self._work, name="genicam-trigger", daemon=True).start()

    def _work(self) -> None:
        due = time.monotonic()
        while not self._stopped.wait(max(0.0, due - time.monotonic())):
            try:
                self._device.ask("arv_camera_software_trigger")
            except GenicamError as error:
                if not self._stopped.is_set():
                    self.refused = error.text
                return
            due = max(due + self._period_s, time.monotonic())

    def stop(self) -> None:
        """No more triggers."""
        self._stopped.set()
