"""The large figures and the maps as pictures, and what they say on the way to the process that draws."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.field import Status
from live.measure import Snapshot
from live.view.exchange.messages import figures_message, figures_of
from live.view.exchange.setup import MAPS
from live.view.exchange.wire import Kind, Message, WireError
from live.view.painting import HEIGHT, WIDTH, FieldMaps, paint
from live.view.painting.field_maps import FreeSpan
from tests.live.made_up import make_field, make_grid
from tests.live.view.drawing.test_scene import make_setup

NOW = Snapshot(
    1.0, "REC", axial=2.271e-3, sigma_axial=9e-6, force_N=5757.6, stress_Pa=143.9e6, valid=1008, zois=1008
)


def test_figures_come_back_from_a_message() -> None:
    some = replace(NOW, stress_Pa=math.nan, alarms=("strain limit: axial is 0.02",))
    meta = json.loads(json.dumps(figures_message(some).meta, allow_nan=False))
    back = figures_of(Message(Kind.FIGURES, meta))
    assert math.isnan(back.stress_Pa)
    assert paint(back).tobytes() == paint(some).tobytes()
    for damaged in ({"state": "REC"}, meta | {"zois": "many"}, meta | {"axial": [1]}):
        with pytest.raises(WireError):
            figures_of(Message(Kind.FIGURES, damaged))


def test_an_alarm_is_red_and_digits_are_large() -> None:
    calm, alarmed = paint(NOW), paint(replace(NOW, alarms=("limit",)))
    assert calm.shape == alarmed.shape == (HEIGHT, WIDTH, 3)
    corner = alarmed[0, -1]
    assert corner[2] > 150 > 60 > max(corner[:2]) and calm[0, -1].max() < 40
    bright = (calm[:, 400:900].min(axis=2) > 200).any(axis=1)  # rows with digits of the strain
    assert bright.sum() > HEIGHT / 3


@pytest.mark.parametrize(
    "more",
    [
        {"force_N": math.nan},
        {"axial": math.nan, "sigma_axial": math.nan},
        {"force_N": -1e7, "state": "\u2603" * 40},
    ],
)
def test_whatever_the_figures_are_they_are_painted(more: dict[str, Any]) -> None:
    assert paint(replace(NOW, **more)).any()


def test_every_map_has_colours_and_a_span_or_a_legend() -> None:
    grid = make_grid()
    field, maps = make_field(grid, 1e-3), FieldMaps(make_setup())
    painted = maps.paint(field, MAPS)
    assert set(painted) == set(MAPS)
    valid = field.ok
    for name, one in painted.items():
        assert one.rgba.shape == (*grid.shape, 4)
        assert (one.rgba[valid][:, 3] > 0).all(), name
        assert (one.span is None) == (name == "status")
    low, high = painted["eyy"].span or (0.0, 0.0)
    assert low == -high and high >= 1e-3
    assert painted["e1"].span == painted["eyy"].span  # tension along y: the largest principal strain
    legend = dict(painted["status"].legend)
    assert f"OK {int(valid.sum())}" in legend and "NOT_MEASURED" not in " ".join(legend)
    rejected = painted["status"].rgba[-1, -1, :3]
    assert tuple(rejected) == legend[f"{Status(7).name} 1"] != legend[f"OK {int(valid.sum())}"]


def test_colours_over_the_values_there_are() -> None:
    grid = make_grid()
    rng = np.random.default_rng(0)
    maps = FieldMaps(make_setup(scale="automatic"))
    field = make_field(grid, 1e-3)
    values = np.where(field.ok, 1e-3 + 1e-4 * rng.standard_normal(grid.shape), np.nan).astype(np.float32)
    low, high = maps.paint(field, ("eyy",))["eyy"].span or (0.0, 0.0)
    assert 0 < low <= 1e-3 <= high < 1.1e-3
    span = FreeSpan().update(values)
    assert 0.6e-3 < span[0] < 1e-3 < span[1] < 1.4e-3


def test_a_span_grows_at_once_and_shrinks_late() -> None:
    span, wide, small = FreeSpan(), np.linspace(0, 1, 100), np.linspace(0, 0.1, 100)
    first = span.update(wide)
    assert first[0] <= 0.02 and first[1] >= 0.98
    assert span.update(small) == first
    for _ in range(30):
        last = span.update(small)
    assert last[1] < 0.2
    assert span.update(np.full(3, np.nan)) == last
