"""Every load cell keeps the contract of ``acquire.load_cell.LoadCell``: one suite over all of them."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import islice, pairwise
from pathlib import Path

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DataError, DeviceError, PhasedicError
from acquire.events import Event, EventKind
from acquire.load_cell.contract import LoadCell, open_load_cell
from hw_mocks.indicator import Sensing
from hw_mocks.indicator_server import IndicatorServer
from hw_mocks.sim_indicators import INDICATORS
from hw_mocks.sim_load_cell import open_sim_load
from hw_mocks.sim_settings import FaultPlan
from hw_mocks.specimen import specimen_from
from tests.acquire.session import fixtures as session_fixtures
from tests.contracts.entry_points import install_example
from tests.live.ui.waiting import LONG_S

LOAD_N = 25.0
Opener = Callable[[Path, ExitStack, list[Event]], LoadCell]

MORE = {
    "ascii": "&millis=1&column=2&unit=N",
    "sauter": "&unit=N",
    "hbm-aed": "&unit=N&nominal=10000",
    "modbus": "&unit=N&profile=laumas-tlb&scale=0.1",
}


def indicator(name: str) -> Opener:
    """The product's serial reader before a simulated indicator under a constant load."""

    def open_it(folder: Path, stack: ExitStack, events: list[Event]) -> LoadCell:
        sensing = Sensing(lambda t: LOAD_N, lambda t: t, 50.0, 0.0, 1000.0)
        made = INDICATORS[name](0.1)
        server = stack.enter_context(IndicatorServer(made, sensing, faults=FaultPlan()))
        baud, bytesize, parity = made.line
        line = f"baud={baud}&bytesize={bytesize}&parity={parity}&rate=20"
        return open_load_cell(f"{server.path}?protocol={name}&{line}{MORE.get(name, '')}", events.append)

    return open_it


def session(folder: Path, stack: ExitStack, events: list[Event]) -> LoadCell:
    with session_fixtures.writer(folder / "run.h5") as writer:
        for k in range(20):
            writer.write_load(session_fixtures.sample(k))
    return open_load_cell(f"session:{folder}/run.h5", events.append)


def simulated(folder: Path, stack: ExitStack, events: list[Event]) -> LoadCell:
    address = parse_address("sim:?rate=100")
    return open_sim_load(address, events.append, specimen_from(address))


def none(folder: Path, stack: ExitStack, events: list[Event]) -> LoadCell:
    return open_load_cell("none:", events.append)


def of_somebody_else(folder: Path, stack: ExitStack, events: list[Event]) -> LoadCell:
    """The example's ``csv:``, found through its entry point."""
    install_example(folder, stack.enter_context(pytest.MonkeyPatch.context()))
    rows = "".join(f"{k / 50:.2f},{LOAD_N}\n" for k in range(40))
    (folder / "forces.csv").write_text(f"time_s,force_N\n{rows}")
    return open_load_cell(f"csv:{folder}/forces.csv", events.append)


SERIAL: dict[str, Opener] = {name: indicator(name) for name in INDICATORS}
LIVE: dict[str, Opener] = {**SERIAL, "sim": simulated, "csv": of_somebody_else}
ALL: dict[str, Opener] = {**LIVE, "session": session, "none": none}


@pytest.fixture
def events() -> list[Event]:
    return []


@pytest.fixture
def cell(name: str, tmp_path: Path, events: list[Event]) -> Iterator[LoadCell]:
    """The load cell of this name."""
    with ExitStack() as stack:
        made = ALL[name](tmp_path, stack, events)
        stack.callback(made.close)
        yield made


@pytest.mark.parametrize("name", ALL)
def test_is_a_load_cell_and_tells_what_it_is(cell: LoadCell) -> None:
    assert isinstance(cell, LoadCell)
    assert cell.info.address and cell.info.name and cell.info.protocol
    assert cell.info.sign in (1, -1)


@pytest.mark.parametrize("name", ALL)
def test_samples_come_in_order_of_time(name: str, cell: LoadCell) -> None:
    with cell:
        samples = list(islice(cell, 8))
    assert all(b.t >= a.t for a, b in pairwise(samples))
    assert len(samples) == 8 or name == "none"


@pytest.mark.parametrize("name", SERIAL)
def test_the_force_is_that_of_the_specimen_tension_positive(cell: LoadCell) -> None:
    with cell:
        samples = [sample for sample in islice(cell, 8) if not math.isnan(sample.force)]
    assert samples and all(sample.force == pytest.approx(LOAD_N, abs=0.051) for sample in samples)
    assert all(sample.raw for sample in samples)


@pytest.mark.parametrize("name", ALL)
def test_stop_from_another_thread_ends_the_iteration(name: str, cell: LoadCell) -> None:
    ended = threading.Event()
    begun = threading.Event()

    def iterate() -> None:
        with cell:
            for _ in cell:
                begun.set()
        ended.set()

    thread = threading.Thread(target=iterate)
    thread.start()
    assert name == "none" or begun.wait(LONG_S)
    cell.stop()
    assert ended.wait(LONG_S)
    thread.join()


@pytest.mark.parametrize("name", ALL)
def test_stop_before_the_iteration(cell: LoadCell) -> None:
    with cell:
        cell.stop()
        assert list(cell) == []


@pytest.mark.parametrize("name", ALL)
def test_closing_twice_and_unentered(cell: LoadCell) -> None:
    cell.close()
    cell.close()


@pytest.mark.parametrize("name", LIVE)
def test_tare_makes_the_load_zero_and_is_an_event(cell: LoadCell, events: list[Event]) -> None:
    """Asked again where a busy machine has let too few samples through, and it was refused."""
    until, asked = time.monotonic() + LONG_S, 0
    with cell:
        for count, sample in enumerate(cell):
            told = any(event.kind is EventKind.TARE for event in events)
            if (told and abs(sample.force) < 6) or time.monotonic() > until:
                break
            refused = sum(event.data.get("tared") is False for event in events)
            if count >= 4 and not told and asked == refused:
                cell.tare()
                asked += 1
    assert abs(sample.force) < 6
    assert [event.kind for event in events].count(EventKind.TARE) == 1


@pytest.mark.parametrize(
    ("address", "error"),
    [
        ("none:?a=1", ConfigError),
        ("none:x", ConfigError),
        ("session:", ConfigError),
        ("session:nowhere.h5", DataError),
        ("/dev/nowhere?unit=N", DeviceError),
        ("socket://127.0.0.1:9?unit=N", DeviceError),
        ("/dev/null?unit=N", DeviceError),
        ("loop://?unit=N&nonsense=1", ConfigError),
    ],
)
def test_what_cannot_be_opened_says_why(address: str, error: type[PhasedicError]) -> None:
    with pytest.raises(error) as caught:
        open_load_cell(address)
    assert address.partition("?")[0].removeprefix("session:") in str(caught.value)


@pytest.mark.parametrize("name", ["session"])
def test_a_tare_of_a_recording_is_refused_in_words(cell: LoadCell, events: list[Event]) -> None:
    with cell:
        cell.tare()
    assert "cannot be tared" in events[0].text
