"""A test as documents (start, descriptor, event, stop), which callbacks of bluesky's RunEngine take.

``python documents.py`` prints them for a simulated test of three seconds. With bluesky:
``run(SETTINGS, [Documents([LiveTable(["strain"])])])``; a callback is any ``callable(name, document)``.
"""

from __future__ import annotations

import sys
import time
import uuid
from collections.abc import Callable, Sequence
from typing import Any

from phasedic import Consumer, Measurement, run

Callback = Callable[[str, dict[str, Any]], object]
KEYS = {"strain": "1", "sigma": "1"}
SETTINGS = {
    "camera.address": "sim:uniform?lockstep=yes&seconds=3&fps=15&width=224&height=192",
    "load.address": "sim:",
    "measure.zoi": 48,
    "view.enabled": False,
    "view.rrd": False,
}


class Documents(Consumer):
    """Gives each measurement to all callbacks as an event document."""

    name = "documents"

    def __init__(self, callbacks: Sequence[Callback]) -> None:
        self._callbacks, self._count = callbacks, 0
        self._run, self._descriptor = str(uuid.uuid4()), str(uuid.uuid4())

    def begin(self) -> None:
        keys = {
            key: {"source": "phasedic", "dtype": "number", "shape": [], "units": u} for key, u in KEYS.items()
        }
        about = {"run_start": self._run, "name": "primary", "data_keys": keys, "object_keys": {}}
        self._emit("start", {"uid": self._run, "plan_name": "tensile test"})
        self._emit("descriptor", {"uid": self._descriptor, "configuration": {}, "hints": {}, **about})

    def measurement(self, measurement: Measurement) -> None:
        self._count += 1
        step = measurement.time_step
        data, times = {"strain": step.eyy, "sigma": step.sigma_eyy}, dict.fromkeys(KEYS, time.time())
        event = {"descriptor": self._descriptor, "seq_num": self._count, "data": data, "timestamps": times}
        self._emit("event", {"uid": str(uuid.uuid4()), "filled": {}, **event})

    def end(self) -> str:
        counts = {"num_events": {"primary": self._count}, "exit_status": "success", "reason": ""}
        self._emit("stop", {"uid": str(uuid.uuid4()), "run_start": self._run, **counts})
        return f"{self._count} events"

    def _emit(self, name: str, document: dict[str, Any]) -> None:
        for callback in self._callbacks:
            callback(name, {"time": time.time(), **document})


def main() -> int:
    return run(
        SETTINGS, [Documents([lambda name, document: print(name, document.get("data", ""))])]
    ).exit_code


if __name__ == "__main__":
    sys.exit(main())
