"""A map that lost a block of ZOIs: means, gauges and curves are marked with the share of the area that is left."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.text.printable import share_text
from analysis import Status, StrainField
from analysis.evaluate import AreaGauge, Gauge, GaugeSet
from analysis.field import ZoiGrid
from live.pipeline.history import History
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results import Results, ResultsInfo, Strain
from live.results.report.curves import others, parts
from live.results.summary import StatusCard, summary_lines
from live.ui.rerun.drawing.large_figures import paint
from live.ui.rerun.messages import LargeFigures
from live.ui.terminal.status_line import gauge_texts, status_line
from tests.live.made_run import finished
from tests.live.made_up import START, make_grid, make_measurement

GRID = make_grid(256, 192)
HALF = AreaGauge("half", box=(0.0, 0.0, 128.0, 192.0))
FAR = AreaGauge("far", box=(128.0, 0.0, 128.0, 192.0))
INFO = ResultsInfo(START, "2026-11-23T00:00:00Z", {}, {}, {}, None, gauges={"half": {}, "far": {}})


def field(lost: bool) -> StrainField:
    whole = make_measurement(0, grid=GRID).field
    status = np.where(GRID.active, 0, Status.NOT_MEASURED)
    if lost:
        status[:6, :4] = np.where(GRID.active, Status.LOST, Status.NOT_MEASURED)[:6, :4]
    values = {name: np.nan_to_num(whole.value(name)) for name in ("u", "v", "du_dx", "dv_dy")}
    return StrainField.from_values(GRID, values, 1e-5, status=status)


def measured(number: int, lost: bool) -> Measurement:
    burst, found = make_measurement(number, grid=GRID).burst, field(lost)
    return Measurement.of(number, burst, found, 10.0, gauges=GaugeSet([HALF, FAR]).read(found))


def share_of(grid: ZoiGrid, gauge: Gauge | None) -> float:
    """By counting."""
    there = grid.active.copy() if gauge is None else gauge.zois(grid)[0]
    block = np.zeros(grid.shape, bool)
    block[:6, :4] = True
    return 1 - (there & block).sum() / there.sum()


def test_each_value_has_the_share_of_its_own_area() -> None:
    step = measured(0, lost=True).time_step
    assert step.area_share == pytest.approx(share_of(GRID, None))
    assert step.gauges["half"].share == pytest.approx(share_of(GRID, HALF)) == pytest.approx(step.least_share)
    assert step.gauges["half"].share < step.area_share < 1 == step.gauges["far"].share
    whole = measured(0, lost=False).time_step
    assert whole.area_share == whole.least_share == 1


def test_the_share_in_words() -> None:
    assert share_text(1.0) == ""
    assert share_text(0.834) == "of 83 % of the area"
    assert share_text(0.9995) == "of 99 % of the area"


def test_it_is_kept_in_the_history() -> None:
    history = History()
    history.add(measured(0, lost=True).time_step)
    kept, step = history.time_steps[0], measured(0, lost=True).time_step
    assert (kept.area_share, kept.least_share) == pytest.approx((step.area_share, step.least_share), rel=1e-6)
    assert kept.gauges.keys() == step.gauges.keys()
    for name, gauge in step.gauges.items():
        assert replace(kept.gauges[name], share=gauge.share) == gauge
        assert kept.gauges[name].share == pytest.approx(gauge.share, rel=1e-6)


@pytest.mark.parametrize("lost", [False, True])
def test_status_line_card_summary_and_view_are_marked(lost: bool) -> None:
    run_state, step = RunState.new(1.0), measured(0, lost).time_step
    run_state.history.add(step)
    run_state.health.began_t = 0.0
    now = run_state.snapshot(0.0, step)
    card = StatusCard(run_state.specimen, run_state.loads).written(now, run_state.history)
    summary = "\n".join(summary_lines(run_state, finished(run_state)))
    mean, least = (f"of {math.floor(100 * share_of(GRID, gauge))} % of the area" for gauge in (None, HALF))
    assert (mean in status_line(now, 300)) == lost
    assert (least in card) == (least in summary) == lost
    shown, whole = (LargeFigures.of(one) for one in (now, replace(now, area_share=1.0)))
    assert (paint(shown).tobytes() != paint(whole).tobytes()) == lost


def test_only_the_gauge_over_the_block_is_marked() -> None:
    half, far = gauge_texts(measured(0, lost=True).time_step)
    assert half.endswith(f"of {math.floor(100 * share_of(GRID, HALF))} % of the area")
    assert "area" not in far


def test_table_and_maps_have_the_shares(tmp_path: Path) -> None:
    results = Results(tmp_path, GRID, INFO)
    for number, lost in enumerate((False, True)):
        results.add(measured(number, lost))
    results.close()
    with (tmp_path / "strain.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    columns = {"area_share": None, "share_gauge_half": HALF, "share_gauge_far": FAR}
    with Strain.open(tmp_path / "strain.h5") as strain:
        for column, gauge in columns.items():
            wanted = [1.0, share_of(GRID, gauge)]
            assert [float(row[column]) for row in rows] == pytest.approx(wanted)
            assert strain.values[column] == pytest.approx(wanted)


def run_with(**values: list[float]) -> Any:
    known = {name: np.array(column) for name, column in values.items()}
    return SimpleNamespace(strain=SimpleNamespace(values=known, time_s=np.array([0.0, 1.5, 3.0])))


def test_the_curves_of_the_report_are_marked() -> None:
    text = parts(run_with(area_share=[1.0, 0.9, 0.84], share_gauge_axial=[1.0, 1.0, 0.7]))
    assert "2 of 3 instants, from 1.5 to 3 s" in text and "at least 70 %" in text
    assert parts(run_with(area_share=[1.0, 1.0, 1.0])) == ""
    (plot,) = others(run_with(area_share=[1.0, 0.9, 0.84]))
    assert plot.curves[0].y.tolist() == pytest.approx([100, 90, 84]) and "share of the area, %" in str(plot)
    assert others(run_with(area_share=[1.0, 1.0, math.nan])) == []
    assert parts(run_with(n_valid=[3.0, 2.0, 1.0])) == ""  # a file of an earlier version
