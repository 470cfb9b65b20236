"""A tare of the simulated load cell on nominal time: by how much the forces fall, and as which event."""

from __future__ import annotations

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.events import Event, EventKind
from acquire.load_cell.load_log import LoadLog
from hw_mocks.indicator import IndicatorReading
from hw_mocks.sim_indicators import HbmAedIndicator
from hw_mocks.sim_load_cell import SimLoadSettings, _indicator, open_sim_load
from hw_mocks.specimen import specimen_from


def test_forces_fall_by_what_the_event_states_and_rise_when_it_is_undone() -> None:
    events: list[Event] = []
    address = parse_address("sim:?lockstep=yes&seconds=4&hold=2&noise_N=0&rate=50")
    cell = open_sim_load(address, events.append, specimen_from(address))
    stream, specimen = iter(cell), specimen_from(address)
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
    address = parse_address("sim:?lockstep=yes&seconds=4&hold=0&noise_N=0&rate=50")
    cell = open_sim_load(address, events.append, specimen_from(address))
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
    address = parse_address("sim:?lockstep=yes&seconds=1&noise_N=0")
    cell = open_sim_load(address, events.append, specimen_from(address))
    cell.undo_tare()
    (told,) = events
    assert (told.kind, told.level, told.text, told.data) == (
        EventKind.DEVICE, "warning", "there is no tare to undo", {"tared": False},
    )  # fmt: skip
    assert told.source == address.text
    assert next(iter(cell)).force == pytest.approx(0)


def test_a_weight_hangs_on_the_cell_beside_the_force() -> None:
    address = parse_address("sim:?lockstep=yes&seconds=2&rate=10&noise_N=0&resolution_N=0.5&weight_N=12.3")
    specimen = specimen_from(address)
    with open_sim_load(address, lambda event: None, specimen) as cell:
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
