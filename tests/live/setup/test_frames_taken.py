"""Frames that a check takes: how many, lost ones, their noise, and their middle."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from analysis import Roi, StrainField, ZoiGrid
from live.config.loading import load_config
from live.pipeline.consumer import Screen
from live.setup import prepared as prepared_module
from live.setup.check import sample as module
from live.setup.check.sample import FrameStack, _inner_halves, around, moved, take, temporal_noise
from live.setup.check.stillness import MAX_ZOIS, covered, middle
from live.setup.lens import _places
from live.setup.prepared import MeasurePlan
from tests.live.fakes import ListCamera, frame
from tests.live.setup.test_prepared import CAMERA


def taken(monkeypatch: pytest.MonkeyPatch, frames: list[Any], reference: int | None) -> Any:
    camera, closed = ListCamera(frames, live=True), list[str]()
    rig = SimpleNamespace(camera=camera, close=lambda: closed.append("closed"))
    monkeypatch.setattr("live.setup.pictures.open_rig", lambda *given, **more: rig)
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
    assert MeasurePlan.compile(plan, camera, Screen(), None) == 1.5
    assert given == [(("uint16", "float32"), phase)]


def test_frames_of_a_check_are_a_burst_with_their_mean_times_and_clipped_pixels() -> None:
    frames = np.array([[[0, 10]], [[1, 255]], [[5, 20]]], np.uint8)
    stack = FrameStack(frames, np.array([1.0, 1.5, 3.0]), 0, CAMERA)
    burst = stack.mean(1, 2)
    assert (burst.mean.tolist(), burst.clipped.tolist()) == ([[3.0, 137.5]], [[False, True]])
    assert (burst.n, burst.t, burst.duration, burst.first_index, burst.last_index) == (2, 2.25, 1.5, 1, 2)
    assert stack.mean().mean.tolist() == [[2.0, 95.0]] and stack.mean(0, 1).mean.tolist() == [[0.0, 10.0]]
    assert stack.few and stack.noise() is None and stack.count_text == "3 pictures"
    assert FrameStack(frames[:1], np.zeros(1), 0, CAMERA).count_text == "1 picture"


def test_the_noise_in_time_is_that_of_one_frame_without_the_drift_of_the_light() -> None:
    rng = np.random.default_rng(0)
    still = rng.normal(100, 2.0, (40, 2000))
    assert temporal_noise(still) == pytest.approx(2.0, rel=0.02)
    assert temporal_noise(still + np.arange(40)[:, None] * 5.0) == pytest.approx(2.0, rel=0.02)
    assert temporal_noise(np.ones((9, 50), np.uint8)) == 0.0
    many = FrameStack(rng.normal(100, 2.0, (16, 40, 50)), np.arange(16.0), 0, CAMERA)
    assert many.noise() == pytest.approx(2.0 / 4, rel=0.03) and not many.few


def test_some_of_the_pixels_stand_for_all() -> None:
    frames = np.arange(2 * 300 * 400, dtype=np.uint32).reshape(2, 300, 400)
    stack = FrameStack(frames, np.zeros(2), 0, CAMERA)
    inside = np.zeros((300, 400), bool)
    inside[10:12, 20:23] = True
    assert stack.pixels(inside).tolist() == [
        [4020, 4021, 4022, 4420, 4421, 4422],
        [124020, 124021, 124022, 124420, 124421, 124422],
    ]


def test_a_cut_has_a_margin_within_the_picture_and_the_same_zois() -> None:
    inside = np.zeros((400, 500), bool)
    inside[150:200, 220:300] = True
    rows, columns = around(inside)
    margin = 150 - rows.start
    assert margin > 0 and (rows.stop, columns.start, columns.stop) == (
        200 + margin,
        220 - margin,
        300 + margin,
    )
    assert around(np.zeros((7, 9), bool)) == (slice(0, 7), slice(0, 9))
    corner = np.zeros((400, 500), bool)
    corner[0, 0] = True
    assert around(corner) == (slice(0, 1 + margin), slice(0, 1 + margin))
    grid = ZoiGrid.cover(Roi(220, 150, 80, 48), 32, 16)
    found = moved(grid, (rows, columns))
    assert (found.first_x + columns.start).tolist() == grid.first_x.tolist()
    assert (found.first_y + rows.start).tolist() == grid.first_y.tolist()
    seen = covered(grid, inside.shape)
    assert seen.sum() == 80 * 48 and seen[150, 220] and seen[197, 299] and not seen[198, 299]


def test_the_zois_about_the_middle_do_not_overlap_and_are_few() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 800, 400), 32, 8)
    chosen = middle(grid)
    assert chosen.n_active == MAX_ZOIS == 64
    rows, columns = np.nonzero(chosen.active)
    x, y = np.unique(chosen.first_x[columns]), np.unique(chosen.first_y[rows])
    assert set(np.diff(x)) == set(np.diff(y)) == {32} and len(x) in (8, 9, 10) and len(y) in (8, 9, 10)
    assert abs(x.mean() + 15.5 - grid.x.mean()) <= 16 and abs(y.mean() + 15.5 - grid.y.mean()) <= 16
    roi = chosen.roi
    assert (roi.x, roi.y) == (int(x[0]), int(y[0])), "no larger than they are"
    assert (roi.x + roi.width, roi.y + roi.height) == (int(x[-1]) + 32, int(y[-1]) + 32)
    few = ZoiGrid.cover(Roi(0, 0, 80, 48), 32, 16)
    assert middle(few).n_active == few.n_active == 8
