"""A reference that cannot be measured is not a still one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.session import Session
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.tell import Ledger

SHAPE = (128, 160)


def shots(folder: Path, places: Sequence[float], seeds: Sequence[int] | None = None) -> Path:
    """Pictures of a pattern that has moved down by each of ``places``, px, each with noise of its own."""
    folder.mkdir()
    noise = np.random.default_rng(0)
    for number, place in enumerate(places):
        speckle = Speckle((400, 400), radius=2.0, seed=3 if seeds is None else seeds[number])
        picture = 20 + 200 * speckle.render(Affine(v=place), SHAPE) + noise.normal(0, 2, SHAPE)
        cv2.imwrite(str(folder / f"a{number:02}.png"), np.clip(np.rint(picture), 0, 255).astype(np.uint8))
    return folder


def run(camera: Path, out: Path) -> int:
    bursts = ["--reference-burst", "4", "--burst", "2", "--zoi", "48", "--step", "24"]
    return main(["run", "--camera", str(camera), *bursts, "--no-view", "--no-rrd", "--out", str(out)])


@pytest.mark.parametrize("speed", [0.3, 5.0, 20.0, 37.0])
def test_the_reference_is_taken_once_the_picture_is_still(tmp_path: Path, speed: float) -> None:
    fast = [speed * k for k in range(4)]
    assert run(shots(tmp_path / "shots", [*fast, *[fast[-1]] * 26]), tmp_path / "out") == 0
    with Session.open(tmp_path / "out" / "session.h5") as session:
        references = [
            event for event in session.events() if "first" in event.data and "force_N" in event.data
        ]
        assert session.ledger is not None
        assert Ledger(**{key: session.ledger[key] for key in Ledger().as_dict()}).adds_up
    assert [event.data["first"] >= 4 for event in references] == [True]


def test_another_pattern_in_every_picture_gives_no_reference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(shots(tmp_path / "shots", [0.0] * 24, range(24)), tmp_path / "out") == 5
    assert "nothing was measured: no reference could be measured" in capsys.readouterr().out
    with Session.open(tmp_path / "out" / "session.h5") as session:
        assert len(session) == 24
        assert session.ledger is not None
        assert Ledger(**{key: session.ledger[key] for key in Ledger().as_dict()}).adds_up
        warned = [event for event in session.events() if "cannot be measured" in event.text]
    assert [event.level for event in warned] == ["warning", "warning", "error"]
