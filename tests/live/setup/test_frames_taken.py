"""What a check takes from a camera: how many frames, which are counted as lost, and where light and noise are read."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from analysis import Roi, StrainField, ZoiGrid
from live.config.loading import load_config
from live.setup import prepared as prepared_module
from live.setup.check import sample as module
from live.setup.check.sample import MIN_FRAMES, _inner_halves, take
from live.setup.lens_calibration import _places
from live.setup.prepared import MeasurePlan
from tests.live.fakes import ListCamera, frame


def taken(monkeypatch: pytest.MonkeyPatch, frames: list[Any], reference: int | None) -> Any:
    camera, closed = ListCamera(frames, live=True), list[str]()
    rig = SimpleNamespace(camera=camera, close=lambda: closed.append("closed"))
    monkeypatch.setattr(module, "open_rig", lambda *given, **more: rig)
    settings: dict[str, Any] = {"camera.address": "list:"}
    if reference is not None:
        settings["measure.reference_burst"] = reference
    try:
        return take(load_config(None, settings))
    finally:
        assert closed == ["closed"]


@pytest.mark.parametrize(("reference", "count"), [(None, 64), (8, 16), (4, 8), (1, 8)])
def test_twice_the_reference_is_taken_and_eight_frames_at_least(
    monkeypatch: pytest.MonkeyPatch, reference: int | None, count: int
) -> None:
    assert MIN_FRAMES == 8
    assert len(taken(monkeypatch, [frame(k) for k in range(100)], reference)) == count


def test_large_pictures_are_no_more_than_fit_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_BYTES", 4 * 6 * 2 * 20)
    assert len(taken(monkeypatch, [frame(k) for k in range(100)], 32)) == 20


def test_frames_lost_between_and_damaged_ones_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was lost before the first one is no matter; the second is damaged, and two are lost later."""
    frames = [
        frame(3, lost=3),
        frame(4, damaged=True),
        frame(5),
        frame(8, lost=2),
        *(frame(k) for k in range(9, 40)),
    ]
    found = taken(monkeypatch, frames, 4)
    assert (found.lost, len(found)) == (3, 8)
    assert found.times.tolist() == pytest.approx([0.3, 0.5, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3])
    with pytest.raises(DataError, match="gave 7 whole frames, a check needs 8"):
        taken(monkeypatch, frames[:8], 4)


def test_light_and_noise_are_read_in_the_inner_halves_of_the_zois() -> None:
    grid = ZoiGrid.cover(Roi(40, 10, 64, 32), 32, 32)
    found = _inner_halves(grid, np.ones((60, 200), bool))
    expected = np.zeros((60, 200), bool)
    expected[18:34, 48:64] = expected[18:34, 80:96] = True
    assert np.array_equal(found, expected)
    nothing, inside = grid.subset(active=np.zeros(grid.shape, bool)), np.eye(60, 200, dtype=bool)
    assert np.array_equal(_inner_halves(nothing, inside), inside)


def test_the_places_of_a_shift_are_those_before_and_after_it() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 48, 32), 32, 16)
    places = _places(StrainField.from_values(grid, {"u": 2.0, "v": -3.0}))
    assert places.tolist() == [[15.5, 15.5], [31.5, 15.5], [17.5, 12.5], [33.5, 12.5]]


@pytest.mark.parametrize(("estimator", "phase"), [("spectral", False), ("phase", True)])
def test_the_loops_of_the_phase_estimator_are_compiled_where_it_is_used(
    monkeypatch: pytest.MonkeyPatch, estimator: str, phase: bool
) -> None:
    given: list[Any] = []
    monkeypatch.setattr(
        prepared_module, "compile_ahead", lambda kinds, **more: given.append((kinds, more["phase"])) or 1.5
    )
    camera: Any = SimpleNamespace(bits=12)
    plan: Any = SimpleNamespace(settings=SimpleNamespace(estimator=estimator))
    assert MeasurePlan.compile(plan, camera, lambda text: None, lambda: False) == 1.5
    assert given == [(("uint16", "float32"), phase)]
