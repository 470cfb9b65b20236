"""What a replay keeps in memory: no picture longer than it is needed."""

from __future__ import annotations

import gc
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from acquire.frame import Burst
from live.cli import main
from live.measure.tracker import Tracker

NEEDED = 5
"""The reference, the one measured, the one before (it may become the reference), one that waits, one at hand."""


def bursts() -> list[Burst]:
    """All there are."""
    return [one for one in gc.get_objects() if isinstance(one, Burst)]


def test_bursts_are_let_go_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = "lockstep=yes&seconds=2&fps=10&width=160&height=128&bits=12"
    words = ["--zoi", "48", "--step", "24", "--burst", "2", "--no-view", "--no-rrd"]
    run = ["run", "--camera", f"sim:uniform?{size}", "--load", "sim:", "--reference-burst", "2"]
    assert main([*run, *words, "--out", str(tmp_path / "run")]) == 0
    kept: list[int] = []
    measured = Tracker.measure

    def measure(tracker: Tracker, burst: Burst) -> Any:
        if len(kept) == 4:
            time.sleep(0.5)  # all is read that can be, and what was measured before is written
        kept.append(len(bursts()) - len(others))
        return measured(tracker, burst)

    def nobody_wants_it(burst: Burst) -> None:
        raise AssertionError("a picture was made for a view that is not there")

    monkeypatch.setattr(Tracker, "measure", measure)
    monkeypatch.setattr(import_module("live.replay.replay"), "picture_of", nobody_wants_it)
    gc.collect()
    others = bursts()  # of other tests
    assert (
        main(["replay", str(tmp_path / "run" / "session.h5"), *words, "--out", str(tmp_path / "again")]) == 0
    )
    assert len(kept) > 5
    assert kept[4] == NEEDED
