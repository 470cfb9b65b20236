"""A recorded session as a source: its reference, its bursts, and its forces with lag, gap and tares."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind
from acquire.frame import Burst
from acquire.load_sample import LoadSample
from acquire.record_mode import RecordMode
from live.config.loading import load_config
from live.pipeline.measure import NewReference
from live.replay import opening as module
from live.replay.opening import session_config, session_source
from live.replay.source import ReplayRequest, ReplaySource
from tests.live.made_up import CAMERA, START, make_measurement

PATH = Path("session.h5")


def burst(number: int) -> Burst:
    return make_measurement(number).burst


def event(kind: EventKind, number: int, **data: Any) -> Event:
    span = {"first": 8 * number, "last": 8 * number + 7, "n": 8}
    return Event(START + 0.1 * number, kind, "m", "", "info", span | data)


class Store:
    """Bursts of 8 frames; notes how the bursts after the reference are asked for."""

    def __init__(self) -> None:
        self.asked: list[Any] = []

    def burst(self, data: Any) -> Burst:
        return burst(int(data["first"]) // 8)

    def first_burst(self, n: int) -> tuple[Burst, int]:
        self.asked.append(("first", n))
        return burst(0), 7

    def index_after(self, last: int, n: int | None) -> Any:
        self.asked.append(("after", last, n))
        return SimpleNamespace(t=np.array([burst(k).t for k in range(2, 8)]))

    def bursts_at(self, index: Any, numbers: range) -> Any:
        return iter([burst(2 + k) for k in numbers])


EVENTS = (
    event(EventKind.REFERENCE, 0),
    event(EventKind.MEASURED, 1, lost=4),
    event(EventKind.REFERENCE, 2, renewed=True, automatic=True),
    event(EventKind.MEASURED, 3),
    event(EventKind.REFERENCE, 4, renewed=True),
    event(EventKind.MEASURED, 5, lost=2),
    event(EventKind.REFERENCE, 6),
)


class Recorded(SimpleNamespace):
    """A session of 64 frames, or of bursts."""

    indices = range(64)

    def __len__(self) -> int:
        return len(self.indices)


def source(
    monkeypatch: pytest.MonkeyPatch,
    *,
    mode: str = "all",
    settings: Any = None,
    events: Any = EVENTS,
    **asked: Any,
) -> tuple[ReplaySource, list[Any]]:
    store = Store()
    monkeypatch.setattr(module, "open_store", lambda session, path: store)
    samples = [LoadSample(START + t, 10.0 * t + 100.0) for t in (0.0, 0.2, 0.4, 0.6, 1.4)]
    tare = Event(START + 0.5, EventKind.TARE, "a cell", "", "info", {"step_N": 100.0})
    session: Any = Recorded(
        each_load_sample=lambda high: (one for one in samples if one.t <= high),
        events=lambda: iter((*events, tare)), mode=RecordMode.parse(mode),
        start_monotonic=START, start_utc="now", camera=CAMERA,
    )  # fmt: skip
    given = {"overrides": {}, "as_measured": False} | asked
    request = ReplayRequest("session.h5", None, given.pop("overrides"))
    found = session_source(session, replace(request, **given), load_config(None, settings or {}), PATH)
    return found, store.asked


def test_forces_have_the_lag_the_gap_and_the_tares_of_the_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = source(monkeypatch, settings={"load.lag_s": 0.1, "load.max_gap_s": 0.3})
    assert found.loads.force_at(START + 0.2) == pytest.approx(103.0)
    assert found.loads.raw_force_at(START + 0.2) == pytest.approx(102.0)
    assert math.isnan(found.loads.force_at(START + 0.9)), "between samples 0.8 s apart"
    assert found.loads.zero_at(START + 0.4) == 0.0 and found.loads.zero_at(START + 0.6) == 100.0
    wide, _ = source(monkeypatch, settings={"load.max_gap_s": 1.0})
    assert wide.loads.force_at(START + 0.9) == pytest.approx(109.0)
    assert wide.loads.force_at(START + 0.2) == pytest.approx(102.0) and len(list(wide.samples)) == 5


def test_a_session_with_two_sections_asks_which() -> None:
    specimen = {"width_mm": 20.0, "thickness_mm": 2.0, "diameter_mm": 10.0}
    session: Any = SimpleNamespace(config={"specimen": specimen}, metadata={})
    request = ReplayRequest("session.h5", None, {})
    with pytest.raises(DataError, match=r"and specimen.diameter_mm are two sections .*--section W,T"):
        session_config(session, request, {}, PATH)
    chosen = replace(request, overrides={"specimen.diameter_mm": 9.0})
    assert session_config(session, chosen, {}, PATH).specimen.section_text == "diameter 9 mm"


def test_of_the_load_what_comes_after_the_window_and_the_reference_is_not_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "BESIDE_S", 0.1)
    asked = {"settings": {"load.max_gap_s": 0.3}, "end_s": 0.1, "events": EVENTS[:1]}
    found, _ = source(monkeypatch, **asked)
    until = max(START + 0.1, found.reference.t) + 0.4
    assert [one.t for one in found.samples] == [
        START + t for t in (0.0, 0.2, 0.4, 0.6, 1.4) if START + t <= until
    ]
    assert len(found.loads) == len(list(found.samples)) < 5
    turned, _ = source(monkeypatch, **{**asked, "settings": {"load.max_gap_s": 0.3, "load.sign": -1}})
    assert [one.force for one in turned.samples] == [-one.force for one in found.samples]


def test_the_reference_is_the_last_that_was_used_and_no_renewed_one(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = source(monkeypatch, settings={"measure.burst": 8})
    assert found.reference.first_index == 48 and asked == [("after", 55, 8)]
    assert [item.first_index for item in found.bursts if isinstance(item, Burst)] == [16, 24, 32, 40, 48, 56]
    assert found.expected == 6 and found.times is not None and found.times[0] == burst(2).t
    assert (found.start.monotonic, found.count, len(found.events)) == (START, None, 8)


def test_another_reference_is_of_the_first_frames_or_of_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    overrides = {"measure.reference_burst": 16}
    _, asked = source(monkeypatch, settings=overrides, overrides=overrides)
    assert asked == [("first", 16), ("after", 7, None)]
    _, asked = source(monkeypatch, events=())
    assert asked == [("first", 1), ("after", 7, None)]
    monkeypatch.setattr(module, "reference_from", lambda path, camera: burst(9))
    found, asked = source(monkeypatch, reference="a.png")
    assert found.reference.first_index == 72 and asked == [("after", -1, None)]


@pytest.mark.parametrize(("mode", "length"), [("all", 3), ("bursts", None), ("every=2", None)])
def test_the_length_of_bursts_is_that_of_the_run_where_all_frames_are_there(
    monkeypatch: pytest.MonkeyPatch, mode: str, length: int | None
) -> None:
    _, asked = source(monkeypatch, mode=mode, settings={"measure.burst": 3})
    assert asked == [("after", 55, length)]
    _, asked = source(monkeypatch, mode=mode, overrides={"measure.burst": 5}, settings={"measure.burst": 5})
    assert asked == [("after", 55, 5)]


def test_a_part_of_the_bursts_is_counted_within_the_window(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = source(monkeypatch, start_s=0.25, end_s=0.65, numbers=range(1, 3))
    assert [item.first_index for item in found.bursts if isinstance(item, Burst)] == [32, 40]
    assert (
        found.expected == 2 and found.times is not None and found.times.tolist() == [burst(4).t, burst(5).t]
    )


def test_as_measured_has_the_bursts_and_references_of_the_run_and_what_was_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, asked = source(monkeypatch, as_measured=True)
    items = [
        ("new", item.burst.first_index) if isinstance(item, NewReference) else (item.first_index, item.lost)
        for item in found.bursts
    ]
    assert items == [(8, 4), (24, 1), ("new", 32), (40, 2)], "those the pipeline renews are left to it"
    assert found.expected == 3 and asked == []
    part, _ = source(monkeypatch, as_measured=True, start_s=0.25, end_s=0.35)
    assert [type(item).__name__ for item in part.bursts] == ["Burst", "NewReference"] and part.expected == 1


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"mode": "every=2"}, "holds only one frame in 2, not the bursts that were measured"),
        ({"reference": "a.png"}, "--as-measured takes the references of the run"),
    ],
)
def test_what_cannot_be_as_measured(monkeypatch: pytest.MonkeyPatch, how: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        source(monkeypatch, as_measured=True, **how)
