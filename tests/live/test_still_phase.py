"""Report, batch and study find the same in the same run: still phase, noise floor, tensile figures."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from live.cli import main
from live.replay.batch.task import Task, perform
from live.replay.opening import open_source
from live.replay.source import ReplayRequest
from live.replay.study import still_window
from live.results import still_phase_of
from live.results.figures import headline
from live.results.report.evaluation import EvaluatedCurve
from live.results.report.report import ReportRequest, make_report
from live.results.run_folder import open_run
from live.ui.terminal.screen import TerminalScreen
from tests.live.made_run import make_run, noisy

CAMERA = "sim:hole?lockstep=yes&seconds=6&fps=10&width=320&height=288&bits=12&hole=24&hold=2&end=1"
SETTINGS = {"measure.zoi": 32, "measure.step": 16, "measure.burst": 2, "measure.reference_burst": 6}


def reported(folder: Path) -> tuple[int, str]:
    """Still instants, and the noise of eyy in um/m, as the page has them."""
    with open_run(folder) as run:
        html = make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
    time_steps = re.search(r"in the first (\d+) instants", html)
    eyy = re.search(r"<td>eyy</td><td[^>]*>([\d.]+)</td>", html)
    assert time_steps is not None and eyy is not None
    return int(time_steps[1]), eyy[1]


@pytest.mark.slow
def test_one_still_phase_and_one_table_in_report_batch_and_study(tmp_path: Path) -> None:
    words = ["--zoi", "32", "--step", "16", "--burst", "2", "--reference-burst", "6", "--no-view", "--no-rrd"]
    assert main(["run", "--camera", CAMERA, "--load", "sim:", *words, "--out", str(tmp_path / "run")]) == 0
    session = str(tmp_path / "run" / "session.h5")
    row = perform(Task("again", str(tmp_path), session, overrides=SETTINGS)).values
    with open_source(ReplayRequest(session, None, SETTINGS)) as (material, _):
        low, high = (material.start.monotonic + limit for limit in still_window(material))
        studied = np.count_nonzero((material.times >= low) & (material.times <= high))
    with open_run(tmp_path / "again") as run:
        found = headline(EvaluatedCurve.of(run).figures, stresses=False)
    for figure in found:
        value = pytest.approx(figure.figure.value) if figure.figure.known else None
        assert row[figure.column] == value, figure.name
    assert [figure.name for figure in found if figure.figure.known] == ["Fm"]
    time_steps, noise = reported(tmp_path / "again")
    assert time_steps == row["still_instants"] == studied == 7
    assert reported(tmp_path / "run") == (time_steps, noise)
    assert isinstance(row["strain_noise_measured"], float)
    assert float(noise) == pytest.approx(1e6 * row["strain_noise_measured"], rel=5e-3)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_the_noise_floor_is_that_of_the_maps(tmp_path: Path, share: float) -> None:
    """A rig that shakes, and strain that varies later, are not taken for noise."""
    strains = (*[0.0] * 60, *np.linspace(1e-4, 3e-3, 20))
    folder = make_run(
        tmp_path, strains, session=False, field_of=lambda k, strain: noisy(k, strain, 1e-5, share * 1e-5)
    )
    with open_run(folder) as run:
        still = still_phase_of(run.strain)
    assert still.time_steps == 60
    for name in ("u", "v", "exx", "eyy"):
        assert still.floors[name].measured == pytest.approx(1e-5, rel=0.06), name
        assert still.floors[name].predicted == pytest.approx(share * 1e-5, rel=2e-3)  # as it is stored
    assert still.floors["exy"].measured == pytest.approx(1e-5 / np.sqrt(2), rel=0.06)


def test_without_a_force_the_strains_tell(tmp_path: Path) -> None:
    """The made noise is not correlated as that of overlapping ZOIs is, so a smaller one is drawn than stated."""
    strains = (*[0.0] * 10, *np.linspace(1e-4, 3e-3, 20))
    folder = make_run(
        tmp_path, strains, session=False, field_of=lambda k, strain: noisy(k, strain, 1e-6, 1e-5)
    )
    with open_run(folder) as run:
        run.strain.values["force_N"][:] = np.nan
        assert still_phase_of(run.strain).time_steps == 10


def test_one_still_instant_gives_no_floor(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0, *np.linspace(1e-4, 3e-3, 20)], session=False)) as run:
        still = still_phase_of(run.strain)
    assert (still.time_steps, still.floors) == (1, {})
