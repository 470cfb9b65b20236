"""The guard of the examples: it stops a machine on null, silence, an alarm, and where the connection ends."""

from __future__ import annotations

import json
import socket
from typing import Any

import pytest

from examples import stop_machine
from examples.stop_machine import NotAlive, values


def line(axial: float | None, force: float | None = 10.0, **more: Any) -> bytes:
    return (
        json.dumps({"axial": axial, "age_s": 0.1, "force_N": force, "state": "live", **more}).encode() + b"\n"
    )


@pytest.mark.parametrize(
    ("last", "why"),
    [
        (line(None, state="old"), r"axial is not known any more \(old\)"),
        (line(2e-3, None), "force_N is not known any more"),
        (b"HOLD\n", "an alarm: HOLD"),
        (b'{"axial":', "closed"),
        (b"", "closed"),
    ],
)
def test_it_stops_on_what_is_not_a_known_value(last: bytes, why: str) -> None:
    here, there = socket.socketpair()
    with here, there:
        here.sendall(line(None, None) + line(None) + line(1e-3) + line(1e-3) + last)
        here.shutdown(socket.SHUT_WR)
        lines = values(there)
        assert [next(lines)["axial"] for _ in range(2)] == [1e-3, 1e-3], "it waits for the first values"
        with pytest.raises(NotAlive, match=why):
            next(lines)


def test_it_stops_on_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stop_machine, "SILENCE_S", 0.05)
    here, there = socket.socketpair()
    with here, there:
        here.sendall(line(1e-3))
        lines = values(there)
        assert next(lines)["axial"] == 1e-3
        with pytest.raises(NotAlive, match=r"no line for 0\.05 s"):
            next(lines)


def test_without_a_load_cell_there_is_no_force_to_wait_for() -> None:
    here, there = socket.socketpair()
    with here, there:
        here.sendall(b'{"axial":0.001,"age_s":0.1}\n')
        assert next(values(there))["axial"] == 1e-3
