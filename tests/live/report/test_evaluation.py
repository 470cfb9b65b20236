"""Instants and elastic line of tests whose truth is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from live.finished import open_run
from live.report.comparison import summary
from live.report.evaluation import Curve, instants, nearest_rows
from tests.live.made_run import CONFIG, E_PA, PULLED, YIELD, make_run


def test_the_line_and_the_instants(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        curve = Curve.of(run)
        found = instants(run, curve)
    assert pytest.approx(E_PA, rel=0.01) == curve.figures.E.value
    assert curve.figures.Rp02.value == pytest.approx(E_PA * YIELD, rel=3e-3)
    # The line goes through the origin of a curve that does.
    assert abs(curve.intercept) < 0.005 * E_PA * YIELD
    words = {word: row for row, name in found.items() for word in name.split(", ")}
    assert words["first"] == 0
    assert words["last"] == len(PULLED) - 1
    assert 0.1 * YIELD <= PULLED[words["elastic"]] <= 0.6 * YIELD
    # 0.2 % of plastic strain beyond the yield of an ideally plastic curve.
    step = PULLED[-1] - PULLED[-2]
    assert YIELD + 0.002 - step <= PULLED[words["yield (0.2 %)"]] <= YIELD + 0.002 + 2 * step


def test_chosen_instants(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        assert nearest_rows(run, (2.04, 0.0)) == {0: "chosen", 20: "chosen"}


def test_without_section_there_are_forces(tmp_path: Path) -> None:
    config = {**CONFIG, "specimen": {"axis": "y"}}
    with open_run(make_run(tmp_path, config=config)) as run:
        curve = Curve.of(run)
    assert not curve.is_stress
    assert curve.figures.E.value == pytest.approx(E_PA * 20e-6, rel=0.01)


def test_mean_and_scatter() -> None:
    mean, deviation, n = summary([1.0, float("nan"), 3.0])
    assert (mean, deviation, n) == (2.0, pytest.approx(np.sqrt(2)), 2)
