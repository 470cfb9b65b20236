"""The scale from a board, as the page asks for it: the same as ``phasedic scale`` takes from that picture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.frame import Frame, frozen
from live.serve.bench import Bench
from live.serve.changes import CHANGES
from live.serve.draft import Draft
from live.serve.web import Hub
from live.setup import load_config
from live.specimen import from_board
from tests.live.specimen.test_scale import CHARUCO, CHECKER, seen

PX_PER_MM = 9.0
AS_CHECKER = {"columns": 9, "rows": 6, "square": 5, "marker": 0, "dictionary": "4X4_50"}
AS_CHARUCO = {"columns": 8, "rows": 6, "square": 6, "marker": 4.5, "dictionary": "4X4_50"}


class Looking:
    """The camera, which sees one picture for ever."""

    info, trouble, collecting = None, "", False

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def recent(self) -> list[Frame]:
        return self.frames


@pytest.fixture
def looking(tmp_path: Path) -> Iterator[tuple[Bench, Looking]]:
    rig = tmp_path / "rig.toml"
    rig.write_text("[scale]\nstand_off_mm = 400\n")
    bench, eye = Bench(Draft(load_config(rig, {}), rig, {}), Hub()), Looking()
    bench.eye = eye  # type: ignore[assignment]
    yield bench, eye
    bench._folder.cleanup()


def show(eye: Looking, picture: np.ndarray) -> None:
    eye.frames = [Frame(frozen(picture), k, k / 10, "nominal", 0, 8, k / 10) for k in range(3)]


@pytest.mark.parametrize(
    ("board", "said"), [(CHECKER, AS_CHECKER), (CHARUCO, AS_CHARUCO)], ids=["checker", "charuco"]
)
def test_a_board_gives_the_scale(looking: tuple[Bench, Looking], board: Any, said: dict[str, Any]) -> None:
    bench, eye = looking
    picture = seen(board, PX_PER_MM)
    show(eye, picture)
    CHANGES["board"](bench, said)
    scale = bench.draft.config.scale
    assert scale.px_per_mm == pytest.approx(PX_PER_MM, rel=1e-3)
    assert scale.mm_per_px == pytest.approx(from_board(picture.astype(np.float32), board).mm_per_px, rel=1e-6)
    assert scale.method is not None and "corners" in scale.method and scale.sigma_mm_per_px
    assert bench.state()["remarks"] == []


def test_a_tilt_is_told_until_the_scale_is_taken_anew(looking: tuple[Bench, Looking]) -> None:
    bench, eye = looking
    show(eye, seen(CHECKER, PX_PER_MM, degrees=12.0))
    CHANGES["board"](bench, {"columns": 9, "rows": 6, "square": 5})
    (remark,) = bench.state()["remarks"]
    assert "the board is tilted, about 11 degrees" in remark
    CHANGES["scale"](bench, {"points": [[10, 10], [110, 10]], "mm": 5})
    assert bench.state()["remarks"] == []


def test_no_board_no_scale(looking: tuple[Bench, Looking]) -> None:
    bench, eye = looking
    with pytest.raises(DataError, match="no picture yet"):
        CHANGES["board"](bench, AS_CHECKER)
    show(eye, np.full((200, 200), 90, np.uint8))
    with pytest.raises(DataError, match="no checkerboard of 9 x 6 inner corners"):
        CHANGES["board"](bench, AS_CHECKER)
    assert bench.draft.config.scale.px_per_mm is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"columns": 2}, {"columns": 9.5}, {"rows": "6"}, {"columns": True}, {"columns": 10**9},
        {"square": 0}, {"square": -1}, {"square": float("nan")}, {"square": 10**400}, {"square": None},
        {"marker": 7}, {"marker": "x"}, {"dictionary": 3}, {"dictionary": "__class__", "marker": 3},
    ],
)  # fmt: skip
def test_what_is_no_board_is_refused(looking: tuple[Bench, Looking], wrong: dict[str, Any]) -> None:
    bench, eye = looking
    show(eye, seen(CHECKER, PX_PER_MM))
    with pytest.raises(ConfigError):
        CHANGES["board"](bench, AS_CHECKER | wrong)
    assert not bench.draft.changes
