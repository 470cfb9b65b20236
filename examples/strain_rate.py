"""A controller of your own: it holds the strain rate of a machine with the strain that phasedic sends over TCP.

It reads lines of JSON from the strain output, drives the machine with a PID on the strain, and ends the test over
the control port. ``python strain_rate.py`` runs it with a simulated machine, as compliant as real ones: at
yield, the share of the crosshead travel that reaches the specimen jumps. For your machine, rewrite ``Machine.drive``.
"""

from __future__ import annotations

import json
import socket
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass

from phasedic import ControlPort, LiveRun, Outcome, TerminalScreen, run

STRAIN_PORT, CONTROL_PORT, MACHINE_PORT = 5610, 5611, 5612


class Lines:
    """A TCP connection for lines of text."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), 10)
        self._lines = self._socket.makefile("rw", encoding="utf-8", newline="\n")

    def ask(self, line: str) -> str:
        """Send a line; return the answer."""
        self._lines.write(line + "\n")
        self._lines.flush()
        return self._lines.readline().strip()

    def __iter__(self) -> Iterator[str]:
        return iter(self._lines)

    def close(self) -> None:
        self._lines.close()
        self._socket.close()


class Machine:
    """The machine: a speed, 1/s of the free length."""

    def __init__(self, port: int) -> None:
        self._lines = Lines(port)

    def drive(self, speed: float) -> None:
        if self._lines.ask(f"speed {speed:.6g}") != "ok":
            raise RuntimeError("the machine did not accept the speed")

    def close(self) -> None:
        self._lines.close()


@dataclass
class Pid:
    """A PID that keeps the strain on a ramp of ``rate`` (1/s) by the speed of the machine."""

    rate: float
    p: float = 5.0
    i: float = 6.0
    d: float = 0.1
    _began: tuple[float, float] | None = None
    _last: tuple[float, float] = (0.0, 0.0)
    _sum: float = 0.0

    def speed(self, t: float, strain: float) -> float:
        """The speed after a measurement at ``t`` s."""
        if self._began is None:
            self._began, self._last = (t, strain), (t, 0.0)
            return self.rate
        error = self._began[1] + self.rate * (t - self._began[0]) - strain
        step = max(t - self._last[0], 1e-3)
        self._sum += error * step
        slope = (error - self._last[1]) / step
        self._last = t, error
        return max(0.0, self.rate + self.p * error + self.i * self._sum + self.d * slope)


def control(rate: float, until: float) -> None:
    """Pull with a strain rate (1/s) until the strain is reached, then end the test."""
    strains, machine, commands, pid = (
        Lines(STRAIN_PORT),
        Machine(MACHINE_PORT),
        Lines(CONTROL_PORT),
        Pid(rate),
    )
    commands.ask(f"note strain rate {rate:g} 1/s")
    for line in strains:
        now = json.loads(line)
        if now["axial"] is None:
            continue
        if now["axial"] > until:
            break
        machine.drive(pid.speed(now["time_s"], now["axial"]))
    machine.drive(0.0)
    commands.ask("quit")
    for connection in (strains, machine, commands):
        connection.close()


def main(folder: str | None = None, rate: float = 5e-4, until: float = 4e-3) -> Outcome:
    """A run with the controller beside it."""
    settings = {
        "camera.address": f"sim:uniform?seconds=60&fps=40&buffers=64&width=224&height=192&machine={MACHINE_PORT}",
        "load.address": "sim:",
        "measure.burst": 2,
        "measure.zoi": 48,
        "view.enabled": False,
        "view.rrd": False,
        "strain_out.tcp": str(STRAIN_PORT),
        "strain_out.channels": ["time_s", "axial"],
        "output.dir": folder,
    }
    config = {key: value for key, value in settings.items() if value is not None}
    screen = TerminalScreen()
    port = ControlPort(str(CONTROL_PORT), None, screen)

    def on_start(live: LiveRun) -> None:
        port.open(live)
        threading.Thread(target=control, args=(rate, until), daemon=True).start()

    try:
        return run(config, screen=screen, on_start=on_start)
    finally:
        port.close()


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]).exit_code)
