"""A disk that is full: what is not there is a loss, and no part of a file stays behind."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.errors import DataError
from live.cli import main
from live.commands.map import save
from tests.analysis.speckle import picture


@contextmanager
def room_for(limit: int) -> Iterator[None]:
    """No file becomes longer, in bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_examples_appear_as_a_whole_or_not_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with room_for(3000):
        assert main(["examples", str(tmp_path / "new")]) == 4
    assert "new: cannot be written ([Errno 27] File too large); make room" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_map_that_finds_no_room_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "map.png"
    noise = np.random.default_rng(0).integers(0, 255, (40, 40, 3), np.uint8)
    with room_for(1000), pytest.raises(DataError, match="cannot be written"):
        save(noise, path)
    assert not path.exists()


@pytest.mark.parametrize("lost", ["figures", "report"])
def test_figures_and_reports_that_find_no_room_are_a_loss(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, lost: str
) -> None:
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), (picture(u=0.1 * k) / 16).astype(np.uint8))

    def full(*_: object) -> None:
        raise DataError("{path}: no room", "here")

    writer = {
        "figures": "live.results.finished.figures_file.FiguresFile.write",
        "report": "live.commands.report.save_page",
    }
    given = ["replay", str(tmp_path), "--roi", "all", "--zoi", "32", "--no-view", "--no-rrd", "--report"]
    assert main([*given, "--out", str(tmp_path / "whole")]) == 0
    monkeypatch.setattr(writer[lost], full)
    assert main([*given, "--out", str(tmp_path / lost)]) == 5
