"""A load cell on a real pseudo-terminal: a backlog of 64 kB and more, and every fault of a line by name.

No force is wrong, and each fault is reported in its event.
"""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest

from acquire.addresses import parse_address
from acquire.events import Event
from acquire.load_cell.contract import open_load_cell
from acquire.load_sample import LoadFlag, LoadSample
from acquire.serial_line.cell import SerialCell
from acquire.serial_line.settings import read_settings
from hw_mocks.indicator import AsciiIndicator, Sensing
from hw_mocks.indicator_server import IndicatorServer, PtyPort
from hw_mocks.sim_settings import SERIAL_FAULTS, FaultPlan, parse_faults

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


@pytest.mark.timed
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
    assert min(sample.force for sample in samples) >= 0, "a reading from before the test"
    assert not any(LoadFlag.STALE in sample.flags for sample in samples[2:])


RATE, AT_S, SECONDS = 80.0, 1.6, 3.2  # twenty devices at once are opened before the fault comes


def truth(t: float) -> float:
    """The force on the cell, N: a slow ramp, so that a stale value shows."""
    return 100.0 + 20.0 * t


@dataclass
class Run:
    """What the reader made of one fault."""

    began: float = 0.0
    samples: list[LoadSample] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    machine_late_s: float = 0.0  # by which another program has held this one up meanwhile

    @property
    def told(self) -> str:
        return " | ".join(event.text for event in self.events)

    def flagged(self, flag: LoadFlag) -> int:
        return sum(flag in sample.flags for sample in self.samples)


def run_with(faults: str, plain: bool) -> Run:
    """Read for some seconds from an indicator with this fault; plain: without stamps of its own."""
    run = Run()
    plan = parse_faults(faults, SERIAL_FAULTS, "test") if faults else FaultPlan()
    began: list[float] = []

    def elapsed(t: float) -> float:
        began.append(t) if not began else None
        return t - began[0]

    sensing = Sensing(lambda t: truth(elapsed(t)), elapsed, RATE, 0.0, 10_000.0)
    with IndicatorServer(
        AsciiIndicator(0.01, style="plain" if plain else "millis"), sensing, faults=plan
    ) as server:
        address = f"{server.path}?timeout=0.5&unit=N{'&max_step=40' if plain else '&millis=1&column=2'}"
        cell = open_load_cell(address, run.events.append)
        timer = threading.Timer(SECONDS, cell.stop)
        timer.start()
        with cell:
            run.samples = list(cell)
        timer.cancel()
    run.began = began[0]
    return run


SHORT = {"silence": "*0.8", "late": "*0.4", "backlog": "*2", "unplug": "*0.4", "overload": "*0.3"}
SHORT |= dict.fromkeys(("unstable", "unit", "comma", "cr", "reset"), "*0.3")


PLAIN = ("late", "backlog", "partial", "duplicate")
NAMES = ["", *SERIAL_FAULTS, *(f"{name} plain" for name in PLAIN)]


@pytest.fixture(scope="module")
def runs() -> dict[str, Run]:
    """One run for each fault, all at the same time."""
    found: dict[str, Run] = {}

    def one(name: str, text: str) -> None:
        found[name] = run_with(text, name.endswith("plain"))

    texts = {"": ""} | {name: f"{name}@{AT_S}{SHORT.get(name, '')}" for name in SERIAL_FAULTS}
    texts |= {f"{name} plain": texts[name] for name in PLAIN}
    threads = [threading.Thread(target=one, args=item) for item in texts.items()]
    for thread in threads:
        thread.start()
    late = 0.0
    while any(thread.is_alive() for thread in threads):
        asked = time.monotonic() + 0.005
        time.sleep(0.005)
        late = max(late, time.monotonic() - asked)
    for run in found.values():
        run.machine_late_s = late
    return found


@pytest.mark.timed
@pytest.mark.parametrize("name", NAMES)
def test_no_force_is_wrong(name: str, runs: dict[str, Run]) -> None:
    run = runs[name]
    doubtful = LoadFlag.STALE | LoadFlag.STEP
    good = [s for s in run.samples if not math.isnan(s.force) and not s.flags & doubtful]
    assert len(good) > 40
    # 0.1 s of the ramp, by which a line may be late before it is known to be, and what this machine was late itself.
    for s in good:
        allowed = 20.0 * (0.1 + 2 * run.machine_late_s)
        assert s.force == pytest.approx(truth(s.t - run.began), abs=allowed), (name, s)


@pytest.mark.timed
@pytest.mark.parametrize("name", NAMES)
def test_times_never_go_back(name: str, runs: dict[str, Run]) -> None:
    times = [s.t for s in runs[name].samples]
    assert times == sorted(times)


SIGNS: dict[str, Callable[[Run], bool]] = {
    "garbage": lambda run: run.flagged(LoadFlag.ERROR) >= 1,
    "nul": lambda run: run.flagged(LoadFlag.ERROR) >= 1,
    "silence": lambda run: "no reading for 0.5 s; last good sample" in run.told,
    "late": lambda run: run.flagged(LoadFlag.STALE) == 0,  # the device's own stamps are right
    "partial plain": lambda run: run.flagged(LoadFlag.STEP) >= 1,
    "late plain": lambda run: run.flagged(LoadFlag.STALE) >= 10,
    "backlog plain": lambda run: run.flagged(LoadFlag.STALE) >= 100,
    "unplug": lambda run: "lost" in run.told and "connected again" in run.told,
    "overload": lambda run: "load alarm" in run.told and run.flagged(LoadFlag.OVERLOAD) >= 10,
    "unit": lambda run: "unit on the line changed" in run.told,
    "comma": lambda run: run.flagged(LoadFlag.ERROR) >= 10,
    "jump": lambda run: "clock jumped" in run.told,
    "reset": lambda run: "clock jumped" in run.told and run.flagged(LoadFlag.STALE) >= 20,
    "backlog": lambda run: run.flagged(LoadFlag.STALE) >= 100 and "clock jumped" not in run.told,
}


@pytest.mark.timed
@pytest.mark.parametrize("name", SIGNS)
def test_the_fault_shows(name: str, runs: dict[str, Run]) -> None:
    run = runs[name]
    assert SIGNS[name](run), (run.told, [s for s in run.samples if s.flags][:3])


@pytest.mark.timed
def test_without_a_fault_nothing_is_told(runs: dict[str, Run]) -> None:
    assert [event.level for event in runs[""].events] == ["info"]
    assert "load times are those of the device's clock" in runs[""].told
    assert not any(sample.flags & ~LoadFlag.STALE for sample in runs[""].samples)
