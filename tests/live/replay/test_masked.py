"""A mask given to a replay, or kept by a run: ZOIs lie where it is not black, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from live.cli import main
from live.results import Strain
from tests.live.shots import write_shots

SHAPE = (128, 160)
WORDS = ["--zoi", "32", "--step", "16", "--burst", "1", "--no-view", "--no-rrd"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with three pictures, a mask of their left half, and one of their upper half."""
    folder = tmp_path_factory.mktemp("masked")
    write_shots(folder / "shots", SHAPE, (0.0, 1e-3, 2e-3))
    left, upper = np.zeros(SHAPE, np.uint8), np.zeros(SHAPE, np.uint8)
    left[:, :80], upper[:64] = 255, 255
    cv2.imwrite(str(folder / "left.png"), left)
    cv2.imwrite(str(folder / "upper.png"), upper)
    return folder


def measured(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Centres (x, y) of the ZOIs that have a value."""
    with Strain.open(folder / "strain.h5") as strain:
        valid = np.isfinite(strain.maps("u", 0))
        x, y = np.meshgrid(strain.grid.x, strain.grid.y)
        return x[valid], y[valid]


def test_of_a_replay(made: Path, tmp_path: Path) -> None:
    main(["replay", str(made / "shots"), *WORDS, "--out", str(tmp_path / "all")])
    everywhere = len(measured(tmp_path / "all")[0])
    mask = ["--mask", str(made / "left.png")]
    assert main(["replay", str(made / "shots"), *WORDS, *mask, "--out", str(tmp_path / "left")]) == 0
    x, _ = measured(tmp_path / "left")
    assert 0.3 * everywhere < len(x) < 0.7 * everywhere
    assert x.max() < 80 + 32 / 2


def test_of_a_run_and_another_one_of_its_replay(made: Path, tmp_path: Path) -> None:
    run = ["run", "--camera", f"files:{made / 'shots'}", *WORDS, "--mask", str(made / "left.png")]
    assert main([*run, "--out", str(tmp_path / "run")]) == 0
    session = str(tmp_path / "run" / "session.h5")
    assert main(["replay", session, *WORDS, "--out", str(tmp_path / "same")]) == 0
    assert measured(tmp_path / "same")[0].max() < 80 + 32 / 2
    mask = ["--mask", str(made / "upper.png")]
    assert main(["replay", session, *WORDS, *mask, "--out", str(tmp_path / "other")]) == 0
    x, y = measured(tmp_path / "other")
    assert x.max() > 80 + 32 / 2 and y.max() < 64 + 32 / 2
