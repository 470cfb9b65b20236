"""What a load cell may send must delay nothing, and must never become a force that was not there."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from acquire.events import Event, ignore_event
from acquire.load_cell import LoadCell, open_load_cell
from acquire.load_sample import LoadFlag, LoadSample
from acquire.protocols.base import find_protocol
from acquire.protocols.modbus import crc16, frame
from live.config.loading import load_config
from live.run.live_run import run_live
from live.run.outcome import Outcome
from live.ui.terminal.screen import TerminalScreen
from tests.acquire.protocols.conversation import parser
from tests.adversary.peers import PEERS, TALKS, Peer, SocketPeer, leave, stamped

SOON_S = 2.0  # on a busy machine; the contract allows half a second to stop


class Reader:
    """Reads a load cell in a thread, as a test does."""

    def __init__(self, cell: LoadCell) -> None:
        self.cell, self.samples = cell, 0
        self.entered, self.ended = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        with self.cell:
            self.entered.set()
            for _ in self.cell:
                self.samples += 1
        self.ended.set()


@pytest.mark.timed
@pytest.mark.parametrize("talk", TALKS)
@pytest.mark.parametrize("kind", PEERS)
def test_start_and_end_are_soon_whatever_comes(kind: str, talk: str) -> None:
    events: list[Event] = []
    with PEERS[kind](TALKS[talk]) as peer:
        cell = opened(peer, events)
        reader = Reader(cell)
        assert reader.entered.wait(SOON_S)
        time.sleep(0.1)
        began = time.monotonic()
        cell.stop()
        assert reader.ended.wait(SOON_S)
        cell.close()
        assert time.monotonic() - began < SOON_S
        assert reader.samples > 0 or talk != "flood"


def opened(peer: Peer, events: list[Event]) -> LoadCell:
    return open_load_cell(f"{peer.url}?unit=N&wait=0.2", events.append)


CAMERA = "bench:?width=160&height=128&fps=30&seconds=1&pictures=8&buffers=64"


def run_beside(load: str, folder: Path) -> Outcome:
    """A short test with the camera from memory."""
    settings = {
        "camera.address": CAMERA, "load.address": load, "measure.zoi": 48, "measure.step": 32, "measure.burst": 1,
        "measure.reference_burst": 4, "view.enabled": False, "view.rrd": False, "output.dir": str(folder),
    }  # fmt: skip
    return run_live(load_config(None, settings), TerminalScreen(quiet=True))


@pytest.mark.timed
@pytest.mark.parametrize(
    ("kind", "talk"),
    [
        *(pytest.param(kind, "flood", marks=() if kind == "pty" else pytest.mark.slow) for kind in PEERS),
        ("socket", "closed"),
    ],
)
def test_a_test_goes_on_beside_it(kind: str, talk: str, tmp_path: Path) -> None:
    with PEERS[kind](TALKS[talk]) as peer:
        outcome = run_beside(f"{peer.url}?unit=N&wait=0.2", tmp_path / "run")
    counts = outcome.run_state.frame_counts
    assert counts.grabbed + counts.lost == 30 and counts.measured > 10 and counts.adds_up
    times = {event.kind: event.t for event in outcome.run_state.event_log.events()}
    assert times["stop"] - times["start"] < 1.0 + SOON_S


# -- lateness ---------------------------------------------------------------------------------

RATE, STALL_AT_S, STALL_S, SECONDS = 200.0, 1.0, 0.7, 2.4


def received(kind: str) -> list[LoadSample]:
    """What comes of a stream whose values are the times at which they were due, with a stall on the way."""
    with PEERS[kind](stamped(RATE, STALL_AT_S, STALL_S)) as peer:
        cell = opened(peer, [])
        timer = threading.Timer(SECONDS, cell.stop)
        timer.start()
        with cell:
            return list(cell)


@pytest.fixture(scope="module")
def streams() -> dict[str, list[LoadSample]]:
    found: dict[str, list[LoadSample]] = {}
    threads = [threading.Thread(target=lambda k=kind: found.update({k: received(k)})) for kind in PEERS]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


@pytest.mark.timed
@pytest.mark.parametrize("kind", PEERS)
def test_what_waited_on_the_way_is_stale(kind: str, streams: dict[str, list[LoadSample]]) -> None:
    samples = streams[kind]
    late = [s.t - s.force for s in samples]
    stale = [LoadFlag.STALE in s.flags for s in samples]
    assert sum(delay > 0.2 for delay in late) > 0.5 * STALL_S * RATE  # it did wait
    assert not any(delay > 0.2 and not doubted for delay, doubted in zip(late, stale, strict=True))
    assert stale.count(False) > 0.3 * len(stale)


# -- peers that hang up -------------------------------------------------------------------------


@pytest.mark.timed
def test_a_peer_that_hangs_up_at_once_is_reported_once() -> None:
    events: list[Event] = []
    with SocketPeer(leave) as peer:
        cell = opened(peer, events)
        reader = Reader(cell)
        assert reader.entered.wait(SOON_S)
        time.sleep(0.9)
        cell.stop()
        assert reader.ended.wait(SOON_S)
        assert peer.connections <= 4
    told = [event.text for event in events if "lost" in event.text]
    assert len(told) <= 2


# -- check digits -------------------------------------------------------------------------------
# Of the protocols only modbus has them.

PROFILE = "profile=laumas-tlb"


def answer(value: int) -> bytes:
    return frame(1, 3, 4, words=(value >> 16 & 0xFFFF, value & 0xFFFF))


def swapped(sound: bytes) -> bytes:
    return sound[:-2] + sound[:-3:-1]


def of_another_start(sound: bytes) -> bytes:
    """The check sum of a CRC that begins with 0."""
    crc = 0
    for byte in sound[:-2]:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return sound[:-2] + crc.to_bytes(2, "little")


WRONG: dict[str, Callable[[bytes], bytes]] = {
    "swapped": swapped,
    "of another start": of_another_start,
    "none": lambda sound: sound[:-2],
    "zero": lambda sound: sound[:-2] + b"\0\0",
    "one more": lambda sound: sound[:-1] + bytes([(sound[-1] + 1) & 0xFF]),
    "of the frame before": lambda sound: sound[:-2] + crc16(answer(7)[:-2]),
    "a digit changed": lambda sound: sound[:4] + bytes([sound[4] ^ 1]) + sound[5:],
    "a byte lost": lambda sound: sound[:4] + sound[5:],
    "a byte twice": lambda sound: sound[:4] + sound[4:5] + sound[4:],
}


def test_only_modbus_has_check_digits() -> None:
    names = ("ascii", "mt-sics", "aed-standard", "mark10", "sauter", "hbm-aed")
    assert all("transmission errors are not detected" in find_protocol(name).undetected for name in names)


@pytest.mark.parametrize("name", WRONG)
def test_wrong_answers_give_no_value_and_sound_ones_between_are_read(name: str) -> None:
    modbus = parser("modbus", PROFILE)
    for k in range(3000):
        sound = answer(1000 + k)
        wrong = WRONG[name](sound) if k % 3 == 0 else sound
        values = [reading.value for reading in modbus.feed(wrong) + modbus.silence()]
        assert values == [1000 + k] if wrong == sound else values and all(map(math.isnan, values)), k


def test_every_flip_of_up_to_two_bits_is_found() -> None:
    sound = answer(123456)
    bits = range(8 * len(sound))
    whole = int.from_bytes(sound, "big")
    for flip in {1 << a | 1 << b for a in bits for b in bits}:
        modbus = parser("modbus", PROFILE)
        readings = modbus.feed((whole ^ flip).to_bytes(len(sound), "big")) + modbus.silence()
        assert all(math.isnan(reading.value) for reading in readings)


def test_a_slave_that_answers_wrongly_gives_no_force_on_a_line() -> None:
    """Asked and answered over a socket, as long as it takes for a dozen answers."""

    def talk(write: Callable[[bytes], None], stopped: threading.Event) -> None:
        while not stopped.wait(0.02):
            write(swapped(answer(4242)))

    with SocketPeer(talk) as peer:
        cell = open_load_cell(f"{peer.url}?protocol=modbus&{PROFILE}&unit=N&wait=0&rate=50", ignore_event)
        timer = threading.Timer(0.5, cell.stop)
        timer.start()
        with cell:
            samples = list(cell)
    assert all(math.isnan(sample.force) for sample in samples)
