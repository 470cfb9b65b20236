"""Other people's programs: found where they are, left out with a word where they are not."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import tests.paper.others as others
import tests.paper.peers as peers
from live.setup.pattern.outcome import ExperimentContext
from tests.paper.peers import present


def test_what_is_not_installed_is_left_out_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(others, "find_spec", lambda name: None)
    assert others.installed() == {}
    assert "pip install pyvale sun-dic" in present()
    monkeypatch.setattr(others, "find_spec", lambda name: object() if name == "pyvale" else None)
    assert list(others.installed()) == ["pyvale, 33 px"]
    assert "left out: SUN-DIC" in present()


def test_empty_rim_is_cut_off() -> None:
    u = np.full((5, 6), np.nan)
    u[1:4, 2:5] = 1.0
    u[2, 3] = np.nan
    inner = others._inner(u)
    assert inner.shape == (3, 3)
    assert np.count_nonzero(np.isnan(inner)) == 1


def test_what_the_workers_inherit_is_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    monkeypatch.delenv("RAY_USAGE_STATS_ENABLED", raising=False)
    with pytest.raises(RuntimeError, match="ray"), others._worker_environment():
        assert os.environ["NUMBA_NUM_THREADS"] == "1"
        raise RuntimeError("ray")
    assert os.environ["NUMBA_NUM_THREADS"] == "2"
    assert "RAY_USAGE_STATS_ENABLED" not in os.environ


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(("module", "program"), others.PROGRAMS.values())
def test_a_known_shift(module: str, program: others.Program) -> None:
    if find_spec(module) is None:  # not imported here: pyvale opens a log file wherever that is done
        pytest.skip(f"{module} is not installed")
    from hw_mocks.deformation import Affine
    from tests.paper.truth import SensorModel, TrueScene

    pair = TrueScene((160, 200), 2.25, 3).pair(Affine(0.25), SensorModel(8))
    assert np.nanmean(program(*pair)) == pytest.approx(0.25, abs=5e-3)


@pytest.mark.slow
def test_a_program_that_fails_is_named_and_the_page_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(reference: np.ndarray, deformed: np.ndarray) -> np.ndarray:
        raise AttributeError("no such module")

    monkeypatch.setattr(peers, "installed", lambda: {"pyvale, 33 px": broken})
    monkeypatch.setattr(peers, "SHIFTS", np.array([0.25]))
    outcome = peers.peers(ExperimentContext(tmp_path, quick=True))
    assert "pyvale is installed but failed (AttributeError: no such module)" in outcome.text.replace(
        "\n", " "
    )
    engines = [row[0] for row in outcome.tables[0].rows]
    assert len(engines) == 4
    assert "pyvale, 33 px" not in engines
    assert "pyvale" in caplog.text
