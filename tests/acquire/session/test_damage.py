"""A damaged session is refused or read right: never a hang, a crash or a wrong number.

Many more cases: ``python -m tests.acquire.session.fuzz --cases 20000``.
"""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import pytest

from acquire.errors import DataError
from acquire.hdf5 import child
from acquire.session import Session
from tests.acquire.session.fixtures import frame, writer
from tests.acquire.session.fuzz import fuzz, whole_session


def test_damaged_files_are_refused_or_right(tmp_path: Path) -> None:
    ends = fuzz(tmp_path, range(250))
    assert {end for _, end in ends} <= {"refused", "right"}, ends


def test_a_damaged_unfinished_file_is_tried_in_a_child_with_a_time_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = whole_session(tmp_path / "whole.h5", abandoned=True)
    path = tmp_path / "cut.h5"
    path.write_bytes(content[: len(content) * 2 // 5])
    with pytest.raises(DataError, match="does not come to an end"):
        child.probe(path, "acquire.session", timeout_s=2.0)
    monkeypatch.setattr(child, "PROBE_S", 2.0)
    with pytest.raises(DataError):
        Session.open(path)


@pytest.mark.parametrize("start", [math.nan, math.inf, 2e12])
def test_a_session_without_a_start_is_refused(tmp_path: Path, start: float) -> None:
    """All its times would be wrong, and its first clock reading would not be that of the start."""
    path = tmp_path / "session.h5"
    with writer(path) as session:
        session.write_frame(frame(0))
    with h5py.File(path, "r+") as file:
        file["entry/start_monotonic_s"][()] = start
    with pytest.raises(DataError, match=r"start_monotonic_s is .*; it must be -1e\+12 to 1e\+12"):
        Session.open(path)
