"""A testing machine that another program drives: it listens for the speed of its crosshead over TCP.

A line ``speed V`` (1/s: over the free length of the specimen) is answered with ``ok``. The machine is soft:
while the specimen is elastic, part of the way goes into the machine, beyond yield all goes into the specimen. So
the strain rate is not the speed, and jumps at yield; to hold it takes a controller. It only pulls.
"""

from __future__ import annotations

import contextlib
import math
import socket
import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.errors import ConfigError

Array = NDArray[np.float64]

ELASTIC_SHARE = 0.6
"""Of the crosshead's way that reaches an elastic specimen."""
FASTEST = 0.1  # 1/s


class Machine:
    """Strain over time, as the speeds say that were ordered.

    Parameters
    ----------
    port : int
        Of 127.0.0.1; 0: any free one.
    yield_strain : float
    elapsed : callable
        Seconds since the start of the test, at a monotonic time.
    clock : callable giving monotonic seconds
    """

    def __init__(
        self,
        port: int,
        yield_strain: float,
        elapsed: Callable[[float], float],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.port = port
        self._yield_strain, self._elapsed, self._clock = yield_strain, elapsed, clock
        self._knots = [(0.0, 0.0, 0.0)]  # time, strain there, speed from there on
        self._lock = threading.Lock()
        self._listening: socket.socket | None = None

    def drive(self, speed: float) -> None:
        """Pull with ``speed`` (1/s) from now on."""
        with self._lock:
            t = max(self._elapsed(self._clock()), self._knots[-1][0])
            self._knots.append((t, float(self._from(self._knots[-1], t)), min(max(speed, 0.0), FASTEST)))

    def strain(self, t: ArrayLike) -> Array:
        """Strain of the specimen at ``t`` seconds since the start."""
        with self._lock:
            knots = list(self._knots)
        times = np.asarray(t, float)
        begun = np.searchsorted([knot[0] for knot in knots], times, side="right") - 1
        strains = np.zeros(times.shape)
        for number in np.unique(np.maximum(begun, 0)):
            here = np.maximum(begun, 0) == number
            strains[here] = self._from(knots[number], times[here])
        return strains

    def _from(self, knot: tuple[float, float, float], t: ArrayLike) -> Array:
        """The strain at ``t`` with the speed of ``knot``, which bends at yield."""
        t0, strain, speed = knot
        way = speed * np.maximum(np.asarray(t, float) - t0, 0.0)
        elastic = max(self._yield_strain - strain, 0.0) / ELASTIC_SHARE
        return np.asarray(strain + ELASTIC_SHARE * np.minimum(way, elastic) + np.maximum(way - elastic, 0.0))

    def listen(self) -> None:
        """Take orders from now on; raises ConfigError where the port is taken."""
        try:
            self._listening = socket.create_server(("127.0.0.1", self.port))
        except OSError as error:
            raise ConfigError(
                f"machine={self.port}: cannot be listened to ({error.strerror}); choose another"
            ) from None
        self.port = self._listening.getsockname()[1]
        threading.Thread(target=self._serve, args=(self._listening,), name="machine", daemon=True).start()

    def close(self) -> None:
        """Take no more orders."""
        if self._listening is not None:
            with contextlib.suppress(OSError):
                self._listening.shutdown(socket.SHUT_RDWR)
            self._listening.close()
            self._listening = None

    def _serve(self, listening: socket.socket) -> None:
        """One client at a time."""
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listening.accept()
                with (
                    contextlib.suppress(OSError),
                    connection,
                    connection.makefile("rw", newline="\n") as lines,
                ):
                    for line in lines:
                        lines.write(self._answer(line) + "\n")
                        lines.flush()

    def _answer(self, line: str) -> str:
        word, _, value = line.strip().partition(" ")
        with contextlib.suppress(ValueError):
            if word == "speed" and math.isfinite(speed := float(value)):
                self.drive(speed)
                return "ok"
        return "no: give speed V, 1/s"
