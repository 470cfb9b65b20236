"""A simulated indicator on a pseudo-terminal: a thread that samples, sends and answers; and one on Modbus RTU.

``PtyPort`` is a serial port with a program at its other end, under a steady name: a symbolic link, so that the port
can be pulled out and comes back where it was. One slave descriptor stays open, so that the reader may close and
open as often as it likes. Of Modbus there are function codes 3, 6 and 16, CRC and exceptions; the register map is a
setting: those of Laumas TLB/TLU, of the DAT-400 (its status bits and commands, on the same registers) and of the PT113.
"""

from __future__ import annotations

import logging
import os
import select
import struct
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from acquire.clock import Clock
from acquire.opening import Closing
from acquire.system import open_pty
from hw_mocks.indicator import Indicator, IndicatorOutput, IndicatorReading, Sensing
from hw_mocks.sim_settings import FaultPlan

READ, WRITE_ONE, WRITE_MANY = 3, 6, 16
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
MAX_REGISTERS = 32
ValueType = Literal["i32", "u32", "f32"]
FORMS: Mapping[ValueType, str] = {"i32": ">i", "u32": ">I", "f32": ">f"}

log = logging.getLogger(__name__)
POLL_S = 0.05
SPLIT_S = 0.03
BACKLOG_TIMEOUT_S = 0.2  # for a backlog that does not fit into the line's buffer at once


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """Where things are; registers count from 0.

    Attributes
    ----------
    slave : int
    status, gross, net, peak, divisions, command : int
        Registers; -1: there is none.
    value_type : "i32" | "u32" | "f32"
    low_word_first : bool
    size : int
        Registers there are.
    zero, tare, reset_peak : int
        What to write to the command register.
    stable, unstable, tared, underload, overload : int
        Masks in the status register; 0: none.
    always : int
        Bits always set (data ok).
    """

    slave: int = 1
    status: int = 6
    gross: int = 7
    net: int = 9
    peak: int = 11
    divisions: int = 13
    command: int = 5
    value_type: ValueType = "i32"
    low_word_first: bool = False
    size: int = 32
    zero: int = 8
    tare: int = 7
    reset_peak: int = -1
    stable: int = 0
    unstable: int = 0
    tared: int = 0
    underload: int = 0
    overload: int = 0
    always: int = 0


DAT400 = RegisterMap(
    zero=1, tare=2, reset_peak=3, stable=1 << 1, tared=1 << 3, underload=1 << 4, overload=1 << 5
)
PT113 = RegisterMap(  # 40001-2 weight, 40003 bit 1 data ok, bit 2 set when UNstable
    status=2,
    gross=0,
    net=-1,
    peak=-1,
    divisions=-1,
    command=-1,
    size=8,
    unstable=1 << 2,
    always=1 << 1,
)
MAPS = {"laumas": RegisterMap(), "dat400": DAT400, "pt113": PT113}


def crc(data: bytes) -> bytes:
    """Modbus CRC-16 (polynomial 0xA001, from 0xFFFF), low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


class ModbusIndicator(Indicator):
    """See the module.

    Parameters
    ----------
    resolution, unit : see ``Indicator``
        A count is one ``resolution``.
    registers : RegisterMap
        Laumas by default.
    """

    name = "modbus"
    line: ClassVar[tuple[int, int, str]] = (9600, 8, "N")

    def __init__(
        self, resolution: float = 0.1, unit: str = "N", *, registers: RegisterMap | None = None
    ) -> None:
        self.registers = registers or RegisterMap()
        super().__init__(resolution, unit)

    def restart(self) -> None:
        """See ``Indicator``."""
        super().restart()
        self._written: dict[int, int] = {}
        self._peak = 0.0

    def render(self, shown: IndicatorReading) -> bytes:
        """The answer to a query of the gross weight alone."""
        return self._read(self.registers.gross, 2, shown)

    def receive(self, data: bytes, shown: IndicatorReading) -> bytes:
        """Take bytes in any pieces; whole requests with a good CRC are answered."""
        self._partial += data
        answers = []
        while len(self._partial) >= 8:
            length = 9 + self._partial[6] if self._partial[1] == WRITE_MANY else 8
            request = self._partial[:length]
            if len(request) < length:
                break
            if crc(request[:-2]) != request[-2:]:
                self._partial = self._partial[1:]  # out of step: look for the next beginning
                continue
            self._partial = self._partial[length:]
            if request[0] == self.registers.slave:
                answers.append(self._respond(request[1], request[2:-2], shown))
        return b"".join(answers)

    def _respond(self, function: int, body: bytes, shown: IndicatorReading) -> bytes:
        self._peak = max(self._peak, shown.force)
        register, number = struct.unpack(">HH", body[:4])
        if function == READ:
            return self._read(register, number, shown)
        if function not in (WRITE_ONE, WRITE_MANY):
            return self._exception(function, ILLEGAL_FUNCTION)
        words = [number] if function == WRITE_ONE else list(struct.unpack(f">{number}H", body[5:]))
        if register + len(words) > self.registers.size:
            return self._exception(function, ILLEGAL_ADDRESS)
        for offset, word in enumerate(words):
            if not self._write(register + offset, word, shown):
                return self._exception(function, ILLEGAL_VALUE)
        return self._framed(bytes([function]) + body[:4])

    def _write(self, register: int, word: int, shown: IndicatorReading) -> bool:
        r = self.registers
        if register != r.command:
            self._written[register] = word
            return True
        if word in (r.zero, r.tare):
            self.tare(shown)
        elif word == r.reset_peak:
            self._peak = shown.force
        return word in (0, r.zero, r.tare, r.reset_peak)

    def _read(self, register: int, number: int, shown: IndicatorReading) -> bytes:
        if not 1 <= number <= MAX_REGISTERS:
            return self._exception(READ, ILLEGAL_VALUE)
        if register + number > self.registers.size:
            return self._exception(READ, ILLEGAL_ADDRESS)
        words = self._contents(shown)
        body = b"".join(struct.pack(">H", words.get(register + i, 0)) for i in range(number))
        return self._framed(bytes([READ, len(body)]) + body)

    def _contents(self, shown: IndicatorReading) -> dict[int, int]:
        """All registers that are not zero."""
        r = self.registers
        words = {**self._written, r.status: self._status(shown)}
        gross = shown.force if r.net >= 0 else self.net(shown)
        for register, force in ((r.gross, gross), (r.net, self.net(shown)), (r.peak, self._peak)):
            if register >= 0:
                high, low = self._words(force)
                words[register], words[register + 1] = (low, high) if r.low_word_first else (high, low)
        return words

    def _words(self, force: float) -> tuple[int, int]:
        counts = round(force / self.resolution)
        value = max(counts, 0) if self.registers.value_type == "u32" else counts
        high, low = struct.unpack(">HH", struct.pack(FORMS[self.registers.value_type], value))
        return high, low

    def _status(self, shown: IndicatorReading) -> int:
        r = self.registers
        bits = r.always | (r.stable if shown.stable else r.unstable) | (r.tared if self.offset else 0)
        return bits | {"overload": r.overload, "underload": r.underload}.get(shown.status, 0)

    def _exception(self, function: int, code: int) -> bytes:
        return self._framed(bytes([function | 0x80, code]))

    def _framed(self, body: bytes) -> bytes:
        frame = bytes([self.registers.slave]) + body
        return frame + crc(frame)


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
        clock: Clock = time.monotonic,
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
                if self._output.unplugged(t):
                    self._port.unplug()
                else:
                    self._port.plug()
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

    def _send(self, t: float) -> None:
        for i, chunk in enumerate(self._output.sample(t)):
            if i:
                self._stopped.wait(SPLIT_S)
            self._port.write(chunk, BACKLOG_TIMEOUT_S if len(chunk) > 1000 else 0.0)
