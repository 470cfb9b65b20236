"""The row of a test in the table of a campaign: each column has what its name says."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from live.config.loading import load_config
from live.pipeline.run_state import RunState
from live.replay.batch import row as module
from live.replay.batch.row import COLUMNS, BatchRow, failed, row_of, row_of_chunk
from tests.live.made_run import finished
from tests.live.made_up import make_measurement

SETTINGS = {"measure.zoi": 48, "measure.step": 12, "measure.order": 2, "specimen.area_mm2": 40.0}


def replayed(code: int, *, measured: bool = True) -> Any:
    """Three bursts of 8 frames; 5 frames were lost, 2 pictures left out."""
    run_state = RunState.new(1.0)
    run_state.frame_counts.add(measured=24, lost=5)
    for k in range(3 if measured else 0):
        run_state.history.add(make_measurement(k).time_step)
    return SimpleNamespace(
        run_state=run_state, exit_code=code, lines=["5 frames lost", "and more"], left_out=2,
        config=load_config(None, SETTINGS), folder=Path("nowhere"), test=finished(run_state),
    )  # fmt: skip


@pytest.fixture(autouse=True)
def figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """E is known with its interval, nothing else."""

    def table(figures: Any, *, stresses: bool) -> dict[str, Any]:
        assert stresses
        known = SimpleNamespace(value=70.0, low=69.0, high=72.0)
        none = SimpleNamespace(value=float("nan"), low=float("nan"), high=float("nan"))
        columns = {"E": "E_GPa", "nu": "nu", "Rp02": "Rp0.2_MPa", "Rm": "Rm_MPa", "r": "r", "n": "n"}
        return {
            key: SimpleNamespace(column=column, figure=known if key == "E" else none)
            for key, column in columns.items()
        }

    monkeypatch.setattr(module, "tensile_table", table)
    monkeypatch.setattr(
        module, "_noise_floor", lambda path: {"still_instants": 9, "strain_noise_measured": None}
    )


def test_the_row_of_a_test() -> None:
    row = row_of("one", "a/session.h5", replayed(0), 1.23456)
    step = make_measurement(0).time_step
    expected = {
        "test": "one", "source": "a/session.h5", "outcome": "done", "exit_code": 0, "error": "", "zoi_px": 48,
        "step_px": 12, "burst": 8, "order": 2, "window": "gaussian", "estimator": "spectral",
        "strain": "engineering", "instants": 3, "zois": step.n_zoi, "valid_last": step.n_valid, "E_GPa": 70.0,
        "E_GPa_low": 69.0, "E_GPa_high": 72.0, "nu": None, "Rm_MPa_low": None, "noise_GL": 2.5,
        "strain_noise": pytest.approx(step.zoi_sigma), "mean_strain_noise": pytest.approx(step.sigma_eyy),
        "still_instants": 9, "strain_noise_measured": None, "frames_lost": 5, "pictures_left_out": 2,
        "seconds": 1.235,
    }  # fmt: skip
    assert list(row.values) == list(COLUMNS)
    assert {name: row.values[name] for name in expected} == expected
    assert row.is_well and row.is_done


def test_a_test_with_loss_has_results_and_is_not_well() -> None:
    row = row_of("one", "a", replayed(5), 1.0)
    assert (row.values["outcome"], row.values["error"]) == ("with loss", "5 frames lost")
    assert (row.is_well, row.is_done, row.words) == (False, True, "one: with loss: 5 frames lost")
    nothing = row_of("one", "a", replayed(5, measured=False), 1.0)
    assert (nothing.values["error"], nothing.values["instants"]) == ("nothing was measured", 0)
    assert nothing.values["zois"] is None and nothing.values["burst"] is None


def test_a_test_that_failed_has_no_results() -> None:
    row = failed("one", "a", "no such file\x1b[2J", 4)
    assert (row.is_well, row.is_done, row.values["exit_code"]) == (False, False, 4)
    assert "\x1b" not in row.words and row.values["E_GPa"] is None
    assert [row_of_chunk("c", "a", same, 1.0).values["outcome"] for same in (True, False)] == [
        "done",
        "renewed",
    ]


def test_a_value_of_another_type_is_left_empty() -> None:
    values = BatchRow.of({"test": None, "zoi_px": 48.0, "r": True, "n": 1, "seconds": float("inf")}).values
    assert (values["test"], values["zoi_px"], values["r"], values["n"], values["seconds"]) == (
        "",
        48,
        None,
        1.0,
        None,
    )
