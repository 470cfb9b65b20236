"""A killed recorder loses no finished frame (many more kills: ``python -m tests.acquire.session.kill_recorder``)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.acquire.session.kill_recorder import kill_once


@pytest.mark.parametrize("after_s", [0.0, 0.113, 0.351])
def test_nothing_finished_is_lost(tmp_path: Path, after_s: float) -> None:
    remains = kill_once(tmp_path, after_s, fps=100, size=256)
    assert remains.complete, remains
