"""The large figures as a picture, and their message to the drawing process."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from live.pipeline.snapshot import Snapshot
from live.pipeline.timed.figure import TimedFigure
from live.ui.rerun.drawing.layout import HEIGHT, WIDTH, paint
from live.ui.rerun.messages import LargeFigures, figures_message, figures_of
from live.ui.rerun.wire import Kind, Parcel
from tests.live.made_up import figures

NOW = Snapshot(
    1.0, "REC", figures=figures(axial=(2.271e-3, 9e-6), force=5757.6, stress=143.9e6), valid=1008, zois=1008
)


def painted(snapshot: Snapshot) -> Any:
    return paint(LargeFigures.of(snapshot))


def test_figures_come_back_from_a_message() -> None:
    lost = {
        "force": TimedFigure.at(30.0, 6.0, 1200.0),
        "stress": TimedFigure(),
        "axial": TimedFigure.at(0, 0, 1e-3, 2e-6),
    }
    sent = replace(NOW, figures=lost, alarms=("strain limit: axial is 0.02",))
    meta = json.loads(json.dumps(figures_message(sent).meta, allow_nan=False))
    back = figures_of(Parcel(Kind.FIGURES, meta))
    assert back.line == "ALARM strain limit: axial is 0.02" and back.alarmed and back.t == sent.t
    assert back.cells == LargeFigures.of(sent).cells and back.cells[2][:2] == (
        "FORCE N  24 s old",
        "1\u202f200.0",
    )
    assert paint(back).tobytes() == painted(sent).tobytes()


def test_what_counts_stands_below() -> None:
    now = replace(NOW, valid=1007, area_share=0.5, frames={"without_force": 1234})
    assert LargeFigures.of(now).line == (
        "1\u202f007 of 1\u202f008 ZOIs, 1 LOST; strain of 50 % of the area   without a force 1\u202f234"
    )
    assert LargeFigures.of(replace(NOW, zois=0)).line == "nothing measured yet"
    assert LargeFigures.of(replace(NOW, paused=True)).cells[0] == ("STATE", "PAUSED", "PAUSED")


def test_an_alarm_is_red_and_digits_are_large() -> None:
    calm, alarmed = painted(NOW), painted(replace(NOW, alarms=("limit",)))
    assert calm.shape == alarmed.shape == (HEIGHT, WIDTH, 3)
    corner = alarmed[0, -1]
    assert corner[2] > 150 > 60 > max(corner[:2]) and calm[0, -1].max() < 40
    bright = (calm[:, 400:900].min(axis=2) > 200).any(axis=1)  # rows with digits of the strain
    assert bright.sum() > HEIGHT / 3


@pytest.mark.parametrize(
    "more",
    [
        {"figures": figures(force=math.nan, axial=1e-3)},
        {"figures": figures(axial=(math.nan, math.nan), force=-1e7), "state": "\u2603" * 40},
        {"figures": {}},
    ],
)
def test_any_figures_are_painted(more: dict[str, Any]) -> None:
    assert painted(replace(NOW, **more)).any()


@pytest.mark.parametrize(
    ("force", "head", "shown"),
    [(9999.9, "FORCE N", "10\u202f000"), (-10000.0, "FORCE kN", "−10.000"), (12345.6, "FORCE kN", "12.346"),
     (math.nan, "FORCE N  unknown", "-")],
)  # fmt: skip
def test_forces_are_in_kilonewtons_from_ten_on(force: float, head: str, shown: str) -> None:
    now = figures(axial=(-1.2345e-2, 4e-6), force=force, stress=30.86e6)
    state, strain, found, stress = LargeFigures.of(Snapshot(0.0, "REC", figures=now)).cells
    assert found[:2] == (head, shown)
    assert state[:2] == ("STATE", "REC") and strain[:2] == ("STRAIN ± 0.0004 %", "−1.2345")
    assert stress[:2] == ("STRESS MPa", "30.9")


def test_an_old_figure_is_grey_and_thin_with_its_age() -> None:
    old = replace(NOW, figures=NOW.figures | {"force": TimedFigure.at(30.0, 6.0, 1200.0)})
    _, strain, force, _ = LargeFigures.of(old).cells
    assert force == ("FORCE N  24 s old", "1\u202f200.0", "old") and strain[2] == "live"
    white, grey = (
        (
            painted(replace(NOW, figures=NOW.figures | {"force": one}))[40:125, 900:1270].min(axis=2) > 160
        ).sum()
        for one in (TimedFigure.at(6.0, 6.0, 1200.0), TimedFigure.at(30.0, 6.0, 1200.0))
    )
    assert 0 < grey < 0.75 * white, "thin"
    assert painted(NOW)[0, 0].tolist() == [36, 29, 23]
    assert painted(old)[0, 0].tolist() == [30, 38, 179], "a figure that is old is a trouble"
