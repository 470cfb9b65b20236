"""A burst judges its own pictures: one that is blank, as of a shutter, a flash or a lost line, falsifies the mean."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest

from acquire.burst import BurstAccumulator
from acquire.burst.memory import PictureMemory
from acquire.burst.summed import SumAccumulator
from acquire.frame import Frame, frozen
from acquire.session import Session
from live.cli import main

SHAPE = (240, 320)
BITS = 12
RNG = np.random.default_rng(1)
PATTERN = 1500 + 400 * RNG.standard_normal(SHAPE).cumsum(1) / np.sqrt(np.arange(1, SHAPE[1] + 1))


def frames(*levels: Any) -> list[Frame]:
    """Pictures of the pattern times ``factor``, or blank at a level."""
    found = []
    for k, (factor, level) in enumerate(levels):
        grey = factor * PATTERN + level + 10 * RNG.standard_normal(SHAPE)
        image = frozen(np.clip(np.rint(grey), 0, 2**BITS - 1).astype(np.uint16))
        found.append(Frame(image, k, k / 10, "host", 0, BITS, k / 10))
    return found


def blank_of(kind: Any, given: list[Frame]) -> int:
    made = None
    accumulator = kind(len(given), memory=PictureMemory())
    for frame in given:
        made = accumulator.add(frame)
    assert made is not None
    return int((made if kind is BurstAccumulator else made.burst(PictureMemory())).blank)


@pytest.mark.parametrize("kind", [BurstAccumulator, SumAccumulator])
@pytest.mark.parametrize("place", [0, 1, 3])
@pytest.mark.parametrize("blank", [(0.0, 0.0), (0.0, 4095.0), (0.0, 1500.0), (0.3, 900.0)])
def test_a_burst_knows_that_one_of_its_pictures_is_blank(
    kind: Any, place: int, blank: tuple[float, float]
) -> None:
    levels = [(1.0, 0.0)] * 4
    levels[place] = blank
    assert blank_of(kind, frames(*levels)) == place + 1


@pytest.mark.parametrize("kind", [BurstAccumulator, SumAccumulator])
def test_flicker_and_pictures_without_a_pattern_are_no_blank_pictures(kind: Any) -> None:
    assert not blank_of(kind, frames((1.0, 0.0), (0.7, 0.0), (1.2, 0.0), (1.0, 100.0)))
    assert not blank_of(kind, frames(*[(0.0, 500.0)] * 4)) and not blank_of(kind, frames((1.0, 0.0)))


def test_a_reference_with_a_blank_picture_is_refused_in_a_replay(tmp_path: Path, capsys: Any) -> None:
    write_pictures(tmp_path, (1.0, 0.0), (1.0, 0.0), (0.0, 0.0), *[(1.0, 0.0)] * 3)
    words = ["--reference-burst", "3", "--zoi", "48", "--step", "48", "--roi", "all", "--no-view", "--no-rrd"]
    assert main(["replay", f"files:{tmp_path}/*.png", *words, "--out", str(tmp_path / "run")]) == 4
    assert "picture 3 of 3 is blank" in capsys.readouterr().err


@pytest.mark.parametrize("mode", ["bursts", "all"])
def test_a_session_of_bursts_knows_its_blank_pictures(tmp_path: Path, mode: str, capsys: Any) -> None:
    write_pictures(tmp_path, *[(1.0, 0.0)] * 5, (0.0, 0.0), *[(1.0, 0.0)] * 4)
    words = ["--zoi", "48", "--step", "48", "--roi", "all", "--burst", "2", "--no-view", "--no-rrd"]
    run = [
        "run",
        "--camera",
        f"files:{tmp_path}/*.png?fps=10",
        "--reference-burst",
        "2",
        "--record",
        mode,
        *words,
    ]
    assert main([*run, "--out", str(tmp_path / "run")]) == 5
    assert main(["replay", str(tmp_path / "run"), *words, "--out", str(tmp_path / "again")]) == 5
    for folder in ("run", "again"):
        with h5py.File(tmp_path / folder / "strain.h5") as file:
            assert file["entry/strain/frame"][()].tolist() == [2, 6, 8]
    with Session.open(tmp_path / "run/session.h5") as session:
        assert [burst.blank for burst in map(session.burst, range(session.burst_count))] == (
            [0, 0, 2, 0, 0] if mode == "bursts" else []
        )


def write_pictures(folder: Path, *levels: tuple[float, float]) -> None:
    for k, frame in enumerate(frames(*levels)):
        cv2.imwrite(str(folder / f"{k:03d}.png"), frame.image << (16 - BITS))
