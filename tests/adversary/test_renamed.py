"""The folder of a test gets another name while the test runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from acquire.session import Session
from live.cli import main
from live.results.run_folder import open_run
from live.ui.terminal.screen import TerminalScreen
from live.ui.terminal.summary import print_summary
from tests.live.test_end_to_end import live_run

SIM = "sim:uniform?lockstep=yes&seconds=2&fps=15&width=160&height=128&bits=12"


@pytest.mark.skipif(sys.platform != "linux", reason="no other system tells the name of an open file")
@pytest.mark.parametrize("recorded", [True, False])
def test_the_data_and_the_summary_are_where_the_folder_is_then(tmp_path: Path, recorded: bool) -> None:
    def rename(live: Any, m: Any) -> None:
        if m.number == 2:
            (tmp_path / "run").rename(tmp_path / "elsewhere")

    outcome = live_run(tmp_path / "run", SIM, each=rename, **{"record.enabled": recorded})
    assert outcome.folder == tmp_path / "elsewhere" and not (tmp_path / "run").exists()
    assert (outcome.folder / "figures.json").is_file() and outcome.exit_code == 0
    counts = outcome.run_state.frame_counts
    assert counts.recorded == (counts.grabbed if recorded else 0)
    with open_run(outcome.folder) as run:
        assert run.strain.n == len(outcome.run_state.history.time_steps) > 3
    if recorded:
        with Session.open(outcome.folder) as session:
            assert session.recovered is None and len(session) == counts.grabbed
    print_summary(TerminalScreen(quiet=True), outcome.run_state, outcome.test, outcome.folder, [])


@pytest.mark.skipif(sys.platform != "linux", reason="no other system tells the name of an open file")
def test_the_summary_of_a_replay_is_where_its_folder_is_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_run(tmp_path / "run", SIM)

    def rename(screen: TerminalScreen, step: Any, number: int, *rest: Any) -> None:
        if number == 3:
            (tmp_path / "again").rename(tmp_path / "elsewhere")

    monkeypatch.setattr(TerminalScreen, "progress", rename)
    words = ["--no-view", "--no-rrd", "--out", str(tmp_path / "again")]
    assert main(["replay", str(tmp_path / "run"), *words]) == 0
    assert not (tmp_path / "again").exists() and (tmp_path / "elsewhere/figures.json").is_file()
    with open_run(tmp_path / "elsewhere") as run:
        assert run.strain.n > 3
