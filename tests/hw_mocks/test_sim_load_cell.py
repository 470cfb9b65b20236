"""The simulated load cell through the product's own serial reader, and on nominal time."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.events import Event, EventKind, ignore_event
from acquire.load_cell.contract import LoadCell
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from hw_mocks.indicator import IndicatorReading
from hw_mocks.indicator_server import PtyPort
from hw_mocks.sim_indicators import HbmAedIndicator
from hw_mocks.sim_load_cell import NominalLoadCell, SimLoadCell, SimLoadSettings, _indicator, open_sim_load
from hw_mocks.sim_settings import SERIAL_FAULTS
from hw_mocks.specimen import VirtualSpecimen, specimen_from


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


def test_forces_fall_by_what_the_event_states_and_rise_when_it_is_undone() -> None:
    events: list[Event] = []
    cell, specimen = opened("sim:?lockstep=yes&seconds=4&hold=2&noise_N=0&rate=50", events.append)
    stream = iter(cell)
    before = [next(stream) for _ in range(150)][-1]
    true = float(specimen.force(149 / 50))
    assert before.force == pytest.approx(true, abs=0.1) and true > 10
    cell.tare()
    tared = next(stream)
    assert tared.force == pytest.approx(float(specimen.force(150 / 50)) - before.force, abs=0.1)
    assert events[-1].kind is EventKind.TARE
    assert events[-1].data == {"offset_N": before.force, "step_N": before.force}
    cell.undo_tare()
    assert next(stream).force == pytest.approx(float(specimen.force(151 / 50)), abs=0.1)
    assert events[-1].data["step_N"] == pytest.approx(-before.force)
    log = LoadLog()
    for event in events:
        log.take_event(event)
    assert log.zero_at(events[0].t) == pytest.approx(before.force)
    assert log.zero_at(events[-1].t) == pytest.approx(0)
    cell.close()


def steps(events: list[Event]) -> list[float]:
    """By how much each tare made the forces fall, N."""
    return [event.data["step_N"] for event in events if event.kind is EventKind.TARE]


def test_each_tare_is_undone_by_itself() -> None:
    events: list[Event] = []
    cell, _ = opened("sim:?lockstep=yes&seconds=4&hold=0&noise_N=0&rate=50", events.append)
    stream = iter(cell)
    for _ in range(2):
        for _ in range(20):
            next(stream)
        cell.tare()
    first, second = steps(events)
    assert first > 0 and second > 0
    for _ in range(3):
        cell.undo_tare()
    assert steps(events)[2:] == pytest.approx([-second, -first])
    cell.close()


def test_without_a_tare_there_is_nothing_to_undo() -> None:
    events: list[Event] = []
    cell, _ = opened("sim:?lockstep=yes&seconds=1&noise_N=0", events.append)
    cell.undo_tare()
    (told,) = events
    assert (told.kind, told.level, told.text, told.data) == (
        EventKind.DEVICE, "warning", "there is no tare to undo", {"tared": False},
    )  # fmt: skip
    assert told.source == cell.info.address
    assert next(iter(cell)).force == pytest.approx(0)


def test_on_nominal_time_a_weight_hangs_on_the_cell_beside_the_force() -> None:
    cell, specimen = opened("sim:?lockstep=yes&seconds=2&rate=10&noise_N=0&resolution_N=0.5&weight_N=12.3")
    samples = list(cell)
    assert [sample.t for sample in samples] == pytest.approx([k / 10 for k in range(21)])
    assert samples[0].force == 12.5 and samples[0].raw == b"12.5 N"
    true = [float(specimen.force(sample.t)) + 12.3 for sample in samples]
    assert [sample.force for sample in samples] == pytest.approx(true, abs=0.26)


LINES = {"baud": "9600", "bytesize": "8", "parity": "N"}
TIMED = {"millis": "1", "column": "2"}
READERS: dict[str, tuple[SimLoadSettings, dict[str, str]]] = {
    "ascii": (SimLoadSettings(), LINES | {"baud": "115200"} | TIMED),
    "ascii plain": (SimLoadSettings(line="plain"), LINES | {"baud": "115200"}),
    "ascii label": (SimLoadSettings(line="label"), LINES | {"baud": "115200"}),
    "ascii openscale": (SimLoadSettings(line="openscale"), LINES | {"baud": "115200"} | TIMED),
    "mt-sics": (SimLoadSettings("mt-sics"), LINES),
    "aed-standard": (SimLoadSettings("aed-standard"), {"baud": "2400", "bytesize": "7", "parity": "E"}),
    "mark10": (SimLoadSettings("mark10"), LINES),
    "sauter": (SimLoadSettings("sauter"), LINES | {"unit": "N"}),
    "hbm-aed": (
        SimLoadSettings("hbm-aed", range_N=500.0),
        LINES | {"parity": "E", "unit": "N", "nominal": "500"},
    ),
    "modbus": (
        SimLoadSettings("modbus", resolution_N=0.02),
        LINES | {"unit": "N", "profile": "laumas-tlb", "scale": "0.02"},
    ),
}


@pytest.mark.parametrize("name", READERS)
def test_the_reader_is_told_what_the_indicator_does_not_say(name: str) -> None:
    settings, expected = READERS[name]
    indicator, told = _indicator(settings)
    assert told == {"protocol": name.partition(" ")[0]} | expected
    assert (indicator.name, indicator.resolution) == (settings.protocol, settings.resolution_N)
    if isinstance(indicator, HbmAedIndicator):
        assert indicator.render(IndicatorReading(250.0)).startswith(b" 0500000")


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("seconds=3", "seconds belongs to the camera's sim: address, say it there"),
        ("E_GPa=3", "E_GPa belongs to the camera"),
        ("lockstep=no", "camera and load must both be in lock step or neither"),
        ("rate=5&lockstep=yes", ""),
    ],
)
def test_the_specimen_is_that_of_the_camera(query: str, words: str) -> None:
    specimen = specimen_from(parse_address("sim:?lockstep=yes"))
    specimen.clock.claimed = True
    if not words:
        assert open_sim_load(parse_address(f"sim:?{query}"), print, specimen).info.settings["rate"] == 5
        return
    with pytest.raises(ConfigError, match=words):
        open_sim_load(parse_address(f"sim:?{query}"), print, specimen)


def test_a_second_specimen_is_refused() -> None:
    specimen = VirtualSpecimen()
    specimen.clock.claimed = True
    for text, words in (("sim:hole", "specimen is uniform"), ("sim:?lockstep=yes", "lock step")):
        with pytest.raises(ConfigError, match=words):
            open_sim_load(parse_address(text), ignore_event, specimen)
