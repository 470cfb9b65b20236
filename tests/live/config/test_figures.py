"""The table of figures: each stands, with its value, sigma, unit and age, in every place that it names."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.text.quantity import UNITS
from analysis.evaluate import GaugeValue
from live.config.figures import FIGURES, LIVE, LiveFigure, attributes, channel_names, columns, figure_of
from live.config.sections import SpecimenConfig
from live.pipeline.measurement import TimeStep
from live.pipeline.run_state import FrameCounts, RunState
from live.pipeline.snapshot import Snapshot
from live.pipeline.timed.figure import TimedFigure
from live.results.layout import ResultsInfo, StrainRow
from live.results.report.curves import others
from live.ui.rerun.messages import LargeFigures
from live.ui.terminal.screen import status_line
from live.ui.web.page_consumer import fact
from tests.live.made_up import START, make_measurement

PLACES = ("terminal", "page", "display")
SHOWN = [(place, one) for place in PLACES for one in FIGURES if getattr(one, place)]


def among_others(one: LiveFigure, figure: TimedFigure) -> Snapshot:
    """A test in which only this figure, among those of the table, has a source."""
    counts = FrameCounts().as_dict()
    return Snapshot(0.0, "REC", 0.0, figures={one.plain: figure}, valid=9, zois=9, frames=counts)


def texts(place: str, s: Snapshot) -> str:
    """What a place says of a test."""
    if place == "page":
        return "  ".join(f"{one['label']} {one['amount']}  {one['why']}" for one in map(fact, s.rows("page")))
    return LargeFigures.of(s).line if place == "display" else status_line(s, 400)


@pytest.mark.parametrize(("place", "one"), SHOWN)
def test_a_figure_has_its_value_sigma_and_unit_in_each_of_its_places(place: str, one: LiveFigure) -> None:
    unit = UNITS[one.kind][0]
    now = among_others(one, TimedFigure.at(5.0, 5.0, 7.0 * unit.one, 2.0 * unit.one))
    (row,) = [row for row in now.rows(place) if row.figure is one]
    assert str(row.amount) == f"7 ± 2 {unit.name}".strip()
    shown = texts(place, now)
    assert f"{one.label} {row.amount}" in shown or f"{one.label.upper()} {row.amount}" in shown


@pytest.mark.parametrize(("place", "one"), SHOWN)
def test_a_figure_that_is_not_live_has_its_age_and_no_value(place: str, one: LiveFigure) -> None:
    old = TimedFigure.at(30.0, 6.0, 7.0 * UNITS[one.kind][0].one)
    (row,) = [row for row in among_others(one, old).rows(place) if row.figure is one]
    assert math.isnan(row.amount.value) and not row.matters
    assert place == "display" or "24 s" in texts(place, among_others(one, old))
    assert one not in [row.figure for row in among_others(one, TimedFigure()).rows(place)] or one.plain in (
        "lost_frames", "recorded",
    )  # fmt: skip


@pytest.mark.parametrize("one", [one for one in FIGURES if one.above < math.inf or one.below > -math.inf])
def test_a_figure_matters_beyond_its_limits_and_is_kept_in_a_short_line(one: LiveFigure) -> None:
    limit = one.above if one.above < math.inf else one.below
    for value in (limit - 1, limit + 1):
        beyond = not one.below <= value <= one.above
        now = among_others(one, TimedFigure.at(5.0, 5.0, value))
        (row,) = [row for row in now.rows("terminal") if row.figure is one]
        assert row.matters is beyond
        assert (one.label.upper() in status_line(now, 50)) is beyond


def test_one_that_is_hidden_is_shown_only_where_it_counts() -> None:
    hidden = [one for one in FIGURES if one.hidden]
    assert len(hidden) == 3
    for one in hidden:
        found = [among_others(one, TimedFigure.at(5.0, 5.0, n)).rows("terminal") for n in (0.0, 1.0)]
        assert [one in [row.figure for row in rows] for rows in found] == [False, True]


def test_columns_and_channels_are_read_from_what_the_table_names() -> None:
    """Each attribute has its own number, so that one that is read for another is found."""
    m = make_measurement(3)
    own = {one.name: 100.0 + k for k, one in enumerate(fields(TimeStep)) if one.type == "float"}
    step = replace(m.time_step, **own, n_valid=7, n_zoi=9, gauges={"a": GaugeValue(1e-3, 1e-6)})  # type: ignore[arg-type]
    burst = replace(m.burst, first_index=31, last_index=38, n=8, lost=2, noise=2.5, duration=0.25)
    measured = replace(m, burst=burst, time_step=step)
    info = ResultsInfo(START, "", {}, {}, {}, None, lagged=True)
    row = StrainRow.of(measured, info)
    assert set(row.values) >= {*columns(), *info.extras}
    for name, of in attributes("step").items():
        assert row.values[name] == getattr(step, of), name
    for name, of in attributes("burst").items():
        assert row.values[name] == getattr(burst, of), name
    state = RunState.new(1.0, specimen=SpecimenConfig(axis="y"))
    state.health.state = "REC"
    state.history.add(step)
    now = state.snapshot(step.t + 0.5, step)
    for one in LIVE:
        found = now.figure(one.plain)
        assert (found.value, found.age) == (getattr(step, one.plain), 0.5), one.name
        assert found.sigma == pytest.approx(getattr(step, f"sigma_{one.plain}", math.nan), nan_ok=True)
        assert now.of_channel(one.name) is found and figure_of(one.name) is one


def test_names_are_once_and_a_gauge_is_a_strain_whatever_its_name() -> None:
    names = [name for one in FIGURES for name in one.columns]
    assert len(names) == len({*names})
    assert [figure_of(f"{prefix}gauge_my_N").unit for prefix in ("", "sigma_", "mean_")] == [""] * 3
    assert figure_of("gauge_my_N").kind == "strain" and figure_of("force_N").kind == "force"
    assert {*channel_names(["a"], system=True)} - {one.name for one in FIGURES} == {
        f"{prefix}gauge_a" for prefix in ("", "sigma_", "mean_", "bending_", "sigma_mean_")
    }


def test_a_figure_that_changes_has_a_curve_in_the_report() -> None:
    for one in (one for one in FIGURES if one.report):
        unit = UNITS[one.kind][0]
        values = {one.name: unit.one * np.array([1.0, 2.0, math.nan])}
        run: Any = SimpleNamespace(strain=SimpleNamespace(values=values, time_s=np.arange(3.0)))
        (plot,) = others(run)
        assert (plot.title, plot.y_label) == (one.label, f"{one.label}, {unit.name}")
        np.testing.assert_allclose(plot.curves[0].y, [1, 2, math.nan])
        values[one.name][:] = [1.0, 1.0 + 1e-15, 1.0]
        assert others(run) == [], "rounding is no change"
