"""A killed run leaves a file that opens and replays (a hundred of them: ``python -m tests.live.run.kill_program``)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.live.run.kill_program import kill_once, replays


@pytest.mark.slow
def test_a_killed_run_is_complete_and_replays(tmp_path: Path) -> None:
    remains = kill_once(tmp_path / "run", 0.3, fps=50.0)
    assert remains.gaps == 0 and remains.frames > 20 and remains.samples > 10
    # How young the newest frame is depends on the machine's load here; the script measures it.
    assert remains.frame_age_s < 2.0
    assert replays(tmp_path / "run" / "session.h5", tmp_path / "again")
