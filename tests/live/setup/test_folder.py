"""The folder of a run: made anew, never overwritten."""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest

from acquire.errors import ConfigError
from live.setup import make_folder


def test_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    now = datetime.datetime(2026, 5, 9, 7, 35, 25, tzinfo=datetime.UTC)
    first, second = make_folder(None, now), make_folder(None, now)
    assert first == Path("runs/20260509T073525Z")
    assert second == Path("runs/20260509T073525Z-2")
    (tmp_path / "mine").mkdir()
    assert make_folder("mine", now) == Path("mine")
    (tmp_path / "mine" / "strain.h5").touch()
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        make_folder("mine", now)
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="cannot be made"):
        make_folder("file/below", now)
