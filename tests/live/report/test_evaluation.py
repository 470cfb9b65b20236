"""Instants, elastic line, still phase and noise floor of tests whose truth is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from analysis.field.strain_field import StrainField
from live.finished import open_run
from live.report.comparison import summary
from live.report.evaluation import Curve, instants, nearest_rows, noise_floor, still_rows
from tests.live.made_run import CONFIG, E_PA, PULLED, YIELD, make_run, noisy


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


def test_the_still_phase_ends_where_the_pull_begins(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        assert list(still_rows(run)) == list(range(8))


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_the_noise_floor_is_that_of_the_maps(tmp_path: Path, share: float) -> None:
    def field(number: int, strain: float) -> StrainField:
        return noisy(number, strain, sigma=1e-5, stated=share * 1e-5)

    with open_run(make_run(tmp_path, [0.0] * 60, session=False, field_of=field)) as run:
        found = {n.name: n for n in noise_floor(run, np.arange(60))}
    for name in ("u", "v", "exx", "eyy"):
        assert found[name].measured == pytest.approx(1e-5, rel=0.06), name
        assert found[name].predicted == pytest.approx(share * 1e-5, rel=1e-3)
    assert found["exy"].measured == pytest.approx(1e-5 / np.sqrt(2), rel=0.06)


def test_without_section_there_are_forces(tmp_path: Path) -> None:
    config = {**CONFIG, "specimen": {"axis": "y"}}
    with open_run(make_run(tmp_path, config=config)) as run:
        curve = Curve.of(run)
    assert not curve.is_stress
    assert curve.figures.E.value == pytest.approx(E_PA * 20e-6, rel=0.01)


def test_mean_and_scatter() -> None:
    mean, deviation, n = summary([1.0, float("nan"), 3.0])
    assert (mean, deviation, n) == (2.0, pytest.approx(np.sqrt(2)), 2)
