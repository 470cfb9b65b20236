"""The large figures as a picture, and what they say on the way to the process that draws."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from live.view import Figures
from live.view.exchange.wire import WireError
from live.view.painting import HEIGHT, WIDTH, paint

NOW = Figures(1.0, "REC", 2.271e-3, 9e-6, 5757.6, 143.9, 1008, 1008)


def test_figures_come_back_from_a_message() -> None:
    some = replace(NOW, stress_MPa=math.nan, alarms=("strain limit: axial is 0.02",))
    back = Figures.from_meta(json.loads(json.dumps(some.as_meta(), allow_nan=False)))
    assert math.isnan(back.stress_MPa)
    assert replace(back, stress_MPa=0.0) == replace(some, stress_MPa=0.0)
    with pytest.raises(WireError):
        Figures.from_meta({"state": "REC"})


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
        {"axial": math.nan, "sigma": math.nan},
        {"force_N": -1e7, "state": "\u2603" * 40},
    ],
)
def test_whatever_the_figures_are_they_are_painted(more: dict[str, Any]) -> None:
    assert paint(replace(NOW, **more)).any()
