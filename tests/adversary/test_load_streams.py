"""What a load cell may send must delay nothing: neither the start nor a pass nor the end."""

from __future__ import annotations

import threading
import time

import pytest

from acquire.events import Event
from acquire.load_cell import LoadCell, open_load_cell
from tests.adversary.peers import PEERS, TALKS, Peer

SOON_S = 2.0  # on a busy machine; the contract says half a second to stop


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


@pytest.mark.parametrize("talk", TALKS)
@pytest.mark.parametrize("kind", PEERS)
def test_start_and_end_are_soon_whatever_comes(kind: str, talk: str) -> None:
    events: list[Event] = []
    with PEERS[kind](TALKS[talk]) as peer:
        cell = opened(peer, events)
        reader = Reader(cell)
        assert reader.entered.wait(SOON_S)
        time.sleep(0.3)
        began = time.monotonic()
        cell.stop()
        assert reader.ended.wait(SOON_S)
        cell.close()
        assert time.monotonic() - began < SOON_S
        assert reader.samples > 0 or talk != "flood"


def opened(peer: Peer, events: list[Event]) -> LoadCell:
    return open_load_cell(f"{peer.url}?unit=N&wait=0.2", events.append)
