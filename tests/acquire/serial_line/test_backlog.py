"""What waits on a line that is open and that nobody reads: 64 kB and more, on a real pseudo-terminal."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Iterator

import pytest

from acquire.addresses import parse_address
from acquire.events import Event
from acquire.load_sample import LoadFlag, LoadSample
from acquire.serial_line.cell import SerialCell
from acquire.serial_line.clock import DeviceClock
from acquire.serial_line.settings import read_settings
from hw_mocks.pty_port import PtyPort

PERIOD_S = 0.0125


class Device:
    """Sends its own milliseconds and how many lines it has sent; nobody minds whether they are read."""

    def __init__(self) -> None:
        self.port = PtyPort()
        self._boot, self._ended = time.monotonic(), threading.Event()
        self._thread = threading.Thread(target=self._send, daemon=True)

    def backlog(self, lines: int) -> None:
        """Lines of the last minute at once; then it goes on at its pace."""
        for k in range(lines):
            ms = (time.monotonic() - self._boot) * 1e3 + 60_000 - (lines - k) * PERIOD_S * 1e3
            self.port.write(f"{ms:.0f}, -1.0 N\r\n".encode(), 0.0 if self.port.lost_bytes else 0.05)
        self._thread.start()

    def _send(self) -> None:
        for k in itertools.count():
            if self._ended.wait(PERIOD_S):
                return
            ms = (time.monotonic() - self._boot) * 1e3 + 60_000
            self.port.write(f"{ms:.0f}, {k}.0 N\r\n".encode())

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.port.close()


@pytest.fixture
def device() -> Iterator[Device]:
    made = Device()
    yield made
    made.close()


def test_what_waited_before_the_test_is_not_taken_for_a_flood_nor_for_a_restart(device: Device) -> None:
    told: list[Event] = []
    address = f"{device.port.path}?protocol=ascii&millis=1&column=2&wait=0"
    cell = SerialCell(read_settings(parse_address(address)), told.append)
    device.backlog(4500)
    samples: list[LoadSample] = []
    with cell:
        for sample in cell:
            samples.append(sample)
            if len(samples) == 60:
                break
        cell.close()
    assert device.port.lost_bytes > 0, "the line was full"
    assert not [event.text for event in told if event.level == "warning" and "check digit" not in event.text]
    assert min(sample.force for sample in samples[1:]) >= 0, "a reading from before the test"
    assert not any(LoadFlag.STALE in sample.flags for sample in samples[2:])


def test_first_messages_that_waited_together_do_not_make_the_clock_jump() -> None:
    clock = DeviceClock()
    waited = [
        (1000.0 + 12.5 * k, 51.0 + 0.001 * k) for k in range(80)
    ]  # ms; all came in the moment they were read
    clock.begin(waited)
    stamps = [clock.stamp(ms, t) for ms, t in waited]
    later = [clock.stamp(2000.0 + 12.5 * k, 51.0876 + 0.0125 * k) for k in range(400)]
    assert clock.jumps == 0 and not any(stamp.doubtful for stamp in stamps + later)
    assert abs(later[-1].t - stamps[0].t - (2.000 + 399 * 0.0125 - 1.0)) < 0.01
