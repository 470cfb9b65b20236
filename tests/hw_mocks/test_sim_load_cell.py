"""The simulated load cell through the product's own serial reader, and on nominal time."""

from __future__ import annotations

import itertools
import math
import os
from pathlib import Path

import numpy as np
import pytest

from acquire.addresses import Options, parse_address
from acquire.errors import ConfigError
from acquire.events import Event, ignore_event
from acquire.load_cell.contract import LoadCell
from acquire.load_sample import LoadSample
from hw_mocks.indicator import AsciiIndicator, Sensing
from hw_mocks.indicator_server import IndicatorServer, PtyPort
from hw_mocks.sim_indicators import INDICATORS
from hw_mocks.sim_load_cell import NominalLoadCell, SimLoadCell, open_sim_load
from hw_mocks.sim_settings import SERIAL_FAULTS, SPECIMEN_KEYS
from hw_mocks.specimen import VirtualSpecimen, specimen_from, take_specimen


def opened(text: str, on_event=ignore_event) -> tuple[LoadCell, VirtualSpecimen]:
    address = parse_address(text)
    specimen = specimen_from(address)
    return open_sim_load(address, on_event, specimen), specimen


def first(cell: LoadCell, n: int) -> list[LoadSample]:
    samples = []
    for sample in cell:
        samples.append(sample)
        if len(samples) == n:
            break
    return samples


@pytest.mark.timed
def test_force_is_the_programmes_within_noise() -> None:
    cell, specimen = opened("sim:?seconds=0.6&hold=0.1&rate=200&noise_N=0.5")
    with cell:
        samples = first(cell, 80)
    assert isinstance(cell, SimLoadCell) and isinstance(cell, LoadCell)
    assert cell.noise_N == pytest.approx(0.5, rel=0.01)
    assert np.all(np.diff([s.t for s in samples]) >= 0)
    slope = np.ptp([s.force for s in samples]) / (samples[-1].t - samples[0].t)
    assert slope > 1e3
    # The line's latency turns into force at this slope; 10 ms are granted.
    for s in samples:
        e = specimen.elapsed(s.t)
        low, high = specimen.force([e - 0.01, e + 0.01])
        assert low - 3 < s.force < high + 3


def test_a_weight_hangs_on_the_cell() -> None:
    """The test takes minutes, so that the specimen does not pull yet."""
    cell, _ = opened("sim:?seconds=600&hold=60&rate=200&noise_N=0&weight_N=2500")
    with cell:
        samples = first(cell, 3)
    assert [sample.force for sample in samples] == pytest.approx([2500.0] * 3, abs=100)


def test_events_and_info_carry_the_address() -> None:
    events: list[Event] = []
    cell, _ = opened("sim:?rate=200&seed=4", events.append)
    with cell:
        first(cell, 2)
        cell.tare()
        first(cell, 2)
    assert cell.info.address == "sim:?rate=200&seed=4" and cell.info.protocol == "ascii"
    assert events and {event.source for event in events} == {"sim:?rate=200&seed=4"}


def test_port_is_gone_after_close() -> None:
    cell, _ = opened("sim:?rate=100")
    path = Path(cell.info.settings["port"])
    assert path.exists()
    cell.close()
    cell.close()
    assert not path.parent.exists()


def test_unplugged_port_is_reached_again() -> None:
    events: list[Event] = []
    cell, _ = opened("sim:?rate=100&faults=unplug@0.1*0.2", events.append)
    with cell:
        samples = first(cell, 100)
    assert max(np.diff([s.t for s in samples])) > 0.2
    assert [event.level for event in events][:1] == ["error"]
    assert any("again" in event.text for event in events)


@pytest.mark.slow
@pytest.mark.parametrize("protocol", INDICATORS)
def test_every_protocol_reads_the_force(protocol: str) -> None:
    """Simulator and reader were written apart from the same descriptions; here they meet.

    The force rises for a second, then stands still: what is read there depends on no delay. A reader that comes late
    may find two answers in one (NaN), never a wrong force.
    """
    cell, specimen = opened(f"sim:?seconds=1&hold=0&noise_N=0&wait=1&protocol={protocol}")
    top, forces = float(specimen.force(specimen.duration_s)), []
    with cell:
        for sample in itertools.islice(cell, 1000):
            forces += [] if math.isnan(sample.force) else [sample.force]
            if forces[-3:] == pytest.approx([top] * 3, abs=0.06):
                break
    assert forces[-3:] == pytest.approx([top] * 3, abs=0.06)
    assert forces == sorted(forces) and forces[0] < top / 2


@pytest.mark.parametrize("fault", SERIAL_FAULTS)
def test_every_fault_is_survived_by_the_reader(fault: str) -> None:
    """While the force still rises there are readings again that fit their time; one that is late itself may not."""
    short = SERIAL_FAULTS[fault] in (1.0, 5.0) and fault not in ("partial", "split", "duplicate")
    amount = "*0.1" if short else ""
    text = f"sim:?seconds=10&hold=0&noise_N=0&rate=200&faults={fault}@0.05{amount}"
    cell, specimen = opened(text)

    def fits(sample: LoadSample) -> bool:
        e = specimen.elapsed(sample.t)
        low, high = specimen.force([e - 0.05, e + 0.05])
        return 0.3 < e < 9 and low - 2 < sample.force < high + 2

    with cell:
        assert any(fits(sample) for sample in itertools.islice(cell, 1500))


def test_nominal_time_in_lock_step() -> None:
    runs = []
    for _ in range(2):
        cell, specimen = opened("sim:?lockstep=yes&seconds=2&rate=50&noise_N=0.5&seed=9")
        with cell:
            runs.append([(s.t, s.force) for s in cell])
    assert isinstance(cell, NominalLoadCell) and isinstance(cell, LoadCell)
    assert runs[0] == runs[1]
    t, force = np.array(runs[0]).T
    np.testing.assert_allclose(t, np.arange(101) / 50)
    assert np.std(force - specimen.force(t)) == pytest.approx(cell.noise_N, rel=0.25)


def test_nominal_tare() -> None:
    events: list[Event] = []
    cell, _ = opened("sim:?lockstep=yes&seconds=1&hold=0&noise_N=0", events.append)
    stream = iter(cell)
    before = [next(stream) for _ in range(20)][-1]
    cell.tare()
    after = next(stream)
    assert events[0].data["offset_N"] == pytest.approx(before.force)
    assert after.force < before.force / 5


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("sim:?rat=3", "known: .*rate"),
        ("sim:?faults=boom@3", "unknown fault"),
        ("sim:?protocol=telepathy", "protocol=telepathy"),
    ],
)
def test_bad_settings_are_refused(text: str, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        opened(text)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("sim:?E_GPa=3", "E_GPa belongs to the camera"),
        ("sim:hole", "specimen is uniform"),
        ("sim:?lockstep=yes", "lock step"),
    ],
)
def test_a_second_specimen_is_refused(text: str, word: str) -> None:
    specimen = VirtualSpecimen()
    specimen.clock.claimed = True
    with pytest.raises(ConfigError, match=word):
        open_sim_load(parse_address(text), ignore_event, specimen)


def test_keys_of_the_specimen_are_all_listed() -> None:
    known = set[str]()
    for text in ("sim:", "sim:?programme=cyclic"):
        options = Options(parse_address(text))
        take_specimen(options)
        known |= set(options._known)
    assert known == SPECIMEN_KEYS


def test_pty_outlives_its_reader_and_counts_what_nobody_reads() -> None:
    port = PtyPort()
    for _ in range(2):
        reader = os.open(port.path, os.O_RDWR | os.O_NOCTTY)
        port.write(b"12.5 N\r\n")
        assert os.read(reader, 100) == b"12.5 N\r\n"
        os.write(reader, b"T\r\n")
        assert port.read(1.0) == b"T\r\n"
        os.close(reader)
    port.write(bytes(200_000))
    assert port.lost_bytes > 0
    port.unplug()
    assert not os.path.lexists(port.path) and port.read(0.0) == b""
    port.plug()
    assert Path(port.path).exists()
    port.close()
    port.close()


def test_server_writes_lines_at_its_rate() -> None:
    sensing = Sensing(lambda t: 5.0, lambda t: t, rate=500, noise_N=0.0)
    with IndicatorServer(AsciiIndicator(style="plain"), sensing) as server:
        reader = os.open(server.path, os.O_RDWR | os.O_NOCTTY)
        data = b""
        while data.count(b"\n") < 20:
            data += os.read(reader, 1000)
        os.close(reader)
    assert set(data.split(b"\r\n")[1:-1]) == {b"5.0 N"}


def test_on_nominal_time_a_weight_hangs_on_the_cell_and_forces_are_rounded() -> None:
    cell, specimen = opened("sim:?lockstep=yes&seconds=2&rate=50&noise_N=0&resolution_N=2&weight_N=37")
    samples = list(cell)
    assert cell.noise_N == pytest.approx(2 / math.sqrt(12))
    assert {sample.force % 2 for sample in samples} == {0.0}
    truth = specimen.force([sample.t for sample in samples]) + 37
    assert np.abs(truth - [sample.force for sample in samples]).max() <= 1.0
