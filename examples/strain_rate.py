"""A controller of your own: it holds the strain rate of a machine with the strain that phasedic sends over TCP.

It reads lines of JSON from the strain output, drives the machine with a PID on the strain, stops it where the strain is
not known or no line comes (``stop_machine``), and ends the test over the socket for commands. ``python
strain_rate.py`` runs it with a simulated machine, as compliant as real ones: at yield, the share of the crosshead
travel that reaches the specimen jumps. For your machine, rewrite ``Machine.drive``.
"""

from __future__ import annotations

import socket
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

from phasedic import ControlPort, LiveRun, Outcome, TerminalScreen, run

try:
    from stop_machine import NotAlive, values
except ImportError:  # imported as a package, as the tests do
    from examples.stop_machine import NotAlive, values

STRAIN_PORT, MACHINE_PORT = 5610, 5612


class Lines:
    """A connection for lines of text, and answers."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._lines = self._socket.makefile("rw", encoding="utf-8", newline="\n")

    def ask(self, line: str) -> str:
        """Send a line; return the answer."""
        self._lines.write(line + "\n")
        self._lines.flush()
        return self._lines.readline().strip()

    def close(self) -> None:
        self._lines.close()
        self._socket.close()


class Machine:
    """The machine: a speed, 1/s of the free length."""

    def __init__(self, port: int) -> None:
        self._lines = Lines(socket.create_connection(("127.0.0.1", port), 10))

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


def control(rate: float, until: float, folder: Path) -> None:
    """Pull with a strain rate (1/s) until the strain is reached, then end the test."""
    to_phasedic = socket.socket(socket.AF_UNIX)
    to_phasedic.connect(str(folder / "orders.sock"))
    strains = socket.create_connection(("127.0.0.1", STRAIN_PORT), 10)
    machine, commands, pid, last = Machine(MACHINE_PORT), Lines(to_phasedic), Pid(rate), -1.0
    commands.ask(f"note strain rate {rate:g} 1/s")
    try:
        for now in values(strains, ["axial"]):
            if now["axial"] > until:
                break
            if now["time_s"] > last:  # else a heartbeat
                machine.drive(pid.speed(now["time_s"], now["axial"]))
            last = now["time_s"]
    except NotAlive as why:
        machine.drive(0.0)
        commands.ask(f"note the machine is stopped: {why}")
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
    port = ControlPort("socket", None, screen)

    def on_start(live: LiveRun) -> None:
        port.open(live, live.folder)
        threading.Thread(target=control, args=(rate, until, live.folder), daemon=True).start()

    try:
        return run(config, screen=screen, on_start=on_start)
    finally:
        port.close()


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]).exit_code)
