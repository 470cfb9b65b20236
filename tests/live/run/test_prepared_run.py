"""A prepared run: time zero, names and words of devices, bursts that may wait, its state."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.clock import ClockPair
from acquire.errors import ConfigError
from acquire.frame import CameraInfo
from acquire.load_sample import LoadSample
from live.config.loading import load_config
from live.pipeline.event_log import EventLog
from live.run import prepared_run
from live.run.prepared_run import PreparedRun, _burst_lengths, _device_names, _time_zero, new_run_state
from live.run.sources import GrabPlan, _bytes_a_pixel, held_at_first, held_bursts
from tests.live.fakes import ListCamera, frame


def test_time_zero_is_that_of_the_clock_or_of_the_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    now = ClockPair.now()
    monkeypatch.setattr(
        prepared_run, "ClockPair", type("Clock", (ClockPair,), {"now": staticmethod(lambda: now)})
    )

    def zero(clock: str) -> tuple[float, float]:
        log = EventLog()
        rig: Any = SimpleNamespace(camera=SimpleNamespace(info=SimpleNamespace(clock=clock)))
        found = _time_zero(rig, log)
        assert found.utc == now.utc
        return found.monotonic, log.origin

    assert zero("device") == zero("host") == (now.monotonic, 0.0)
    assert zero("nominal") == (0.0, now.monotonic)


def test_devices_are_announced_with_their_warnings() -> None:
    camera = replace(ListCamera([frame(0)]).info, fps=12.5, warnings=("its gain is automatic",))
    cell = SimpleNamespace(name="a cell", warnings=("old",))
    rig: Any = SimpleNamespace(camera=SimpleNamespace(info=camera), load=SimpleNamespace(info=cell))
    prepared = PreparedRun(rig, None, (4, 2), "run", None)  # type: ignore[arg-type]
    assert list(prepared.announcement()) == [
        "camera: a list of frames, 6 x 4 px, 8 bits, 12.5 frames/s", "load cell: a cell",
        "warning: its gain is automatic", "warning: old", "files: run",
    ]  # fmt: skip


def camera(width: int = 1000, height: int = 500, bits: int = 8, fps: float | None = 50.0) -> CameraInfo:
    return CameraInfo("a:", "a", width, height, bits, True, "device", fps=fps)


@pytest.mark.parametrize(
    ("info", "burst", "at_first", "later"),
    [
        (camera(), 4, 13, 4),  # 1 s and 0.25 s of 12.5 bursts a second
        (camera(fps=None), 4, 1, 1),
        (camera(fps=1.0), 1, 1, 1),
        (camera(4000, 3000), 1, 42, 13),  # 3 s, bounded by 512 MB of 12 MB
        (camera(4000, 3000, fps=10.0), 1, 30, 3),
        (camera(4000, 3000, bits=12), 1, 21, 13),
        (camera(4000, 3000, bits=12), 4, 20, 4),  # 16 bits hold the sum of four; with a bit of clipping
    ],
)
def test_so_many_bursts_may_wait_for_the_first_measurement_and_later(
    info: CameraInfo, burst: int, at_first: int, later: int
) -> None:
    plan = GrabPlan(burst, 32)
    assert (held_at_first(info, plan), held_bursts(info, plan, 0.25)) == (at_first, later)


def test_the_bytes_of_a_burst_that_waits() -> None:
    assert [_bytes_a_pixel(camera(bits=bits), GrabPlan(1, 4)) for bits in (8, 9, 12)] == [1, 2, 2]
    assert _bytes_a_pixel(camera(bits=12), GrabPlan(16, 4)) == 2.125
    assert _bytes_a_pixel(camera(bits=12), GrabPlan(17, 4)) == 4.125


def test_the_lengths_of_bursts_are_as_given_else_of_the_source() -> None:
    given = load_config(None, {"measure.burst": 3, "measure.reference_burst": 7})
    assert (_burst_lengths(given, True), _burst_lengths(given, False)) == ((7, 3), (7, 3))
    plain = load_config(None, {})
    assert (_burst_lengths(plain, True), _burst_lengths(plain, False)) == ((32, 4), (1, 1))
    plan = GrabPlan.of(load_config(None, {"output.seconds": 5.0}), (32, 4))
    assert (plan.burst, plan.reference_burst, plan.seconds) == (4, 32, 5.0)
    assert GrabPlan.of(plain, (32, 4)).seconds == float("inf")


def test_devices_have_names_where_their_addresses_differ() -> None:
    two = load_config(None, {"camera.address": "sim:a", "load.address": "sim:b"})
    assert _device_names(two) == {"sim:a": "camera", "sim:b": "load cell"}
    assert _device_names(load_config(None, {"camera.address": "sim:", "load.address": "sim:"})) == {}


def test_the_state_of_a_test_has_lag_gap_and_section_as_configured() -> None:
    config = load_config(
        None,
        {
            "camera.address": "sim:a", "load.address": "sim:b", "load.lag_s": 0.25, "load.max_gap_s": 2.0,
            "specimen.area_mm2": 40.0, "specimen.axis": "x",
        },
    )  # fmt: skip
    screen: Any = SimpleNamespace(print=lambda text: printed.append(text))
    printed: list[str] = []
    state = new_run_state(config, screen)
    assert (state.specimen.area_m2, state.history.current_axis) == (pytest.approx(40e-6), "x")
    assert state.event_log.names == {"sim:a": "camera", "sim:b": "load cell"} and printed == ["opening sim:a"]
    for t in (0.0, 1.5, 4.0):
        state.loads.append(LoadSample(t, 10.0 * t))
    assert state.loads.force_at(0.5) == pytest.approx(7.5) and state.loads.raw_force_at(0.5) == pytest.approx(
        5.0
    )
    assert math.isnan(state.loads.force_at(3.0)), "between samples 2.5 s apart"
    with pytest.raises(ConfigError, match="no camera is given"):
        new_run_state(load_config(None, {}), screen)
