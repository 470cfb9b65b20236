"""Changes during set-up: the scale from a calibration board, the draft of the rig file, the drawn region."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.frame import Frame, frozen
from live.config.loading import load_config
from live.setup.pictures import read_mask
from live.setup.scale import from_board
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.setup import load_preview
from live.ui.web.setup.camera_preview import RECENT, CameraPreview
from live.ui.web.setup.config_draft import ConfigDraft, next_name
from live.ui.web.setup.draft_changes import CHANGES
from live.ui.web.setup.setup_session import SetupSession
from live.ui.web.setup.specimen_region import DrawnRegion, SpecimenRegion
from tests.live.setup.test_scale import CHARUCO, CHECKER, seen
from tests.live.ui.waiting import until
from tests.live.ui.web.test_setup_values import INFO, draft_of

PX_PER_MM = 9.0
AS_CHECKER = {"columns": 9, "rows": 6, "square": 5, "marker": 0, "dictionary": "4X4_50"}
AS_CHARUCO = {"columns": 8, "rows": 6, "square": 6, "marker": 4.5, "dictionary": "4X4_50"}


class FixedPreview:
    """A camera preview with always the same picture."""

    info, trouble, collecting = None, "", False

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def recent(self, least: int = 8) -> list[Frame]:
        return self.frames


Opened = tuple[SetupSession, FixedPreview]


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Opened]:
    draft = draft_of(tmp_path, "[scale]\nstand_off_mm = 400\n")
    session, preview = SetupSession(draft, Broadcaster()), FixedPreview()
    session.preview = preview  # type: ignore[assignment]
    yield session, preview
    session._folder.cleanup()


def show(preview: FixedPreview, picture: np.ndarray) -> None:
    preview.frames = [Frame(frozen(picture), k, k / 10, "nominal", 0, 8, k / 10) for k in range(3)]


@pytest.fixture
def slow_camera(tmp_path: Path) -> Iterator[CameraPreview]:
    """A camera that gives a picture of a board, and the next one half a minute later."""
    (tmp_path / "shots").mkdir()
    for k in range(9):
        cv2.imwrite(str(tmp_path / "shots" / f"{k}.png"), seen(CHARUCO, PX_PER_MM))
    draft = draft_of(tmp_path, f'[camera]\naddress = "files:{tmp_path}/shots?fps=0.03"\n')
    watched = SimpleNamespace(
        opened=lambda info: None, show=lambda frame: 0.0, frames_needed=lambda info: RECENT
    )
    preview = CameraPreview(draft, watched)
    preview.start()
    yield preview
    preview.close()


def test_the_first_picture_of_a_slow_camera_gives_the_scale(
    opened: Opened, slow_camera: CameraPreview
) -> None:
    session, _ = opened
    session.preview = slow_camera
    until(lambda: bool(slow_camera.recent(1)))
    CHANGES["board"](session, AS_CHARUCO)
    assert session.draft.config.scale.px_per_mm == pytest.approx(PX_PER_MM, rel=1e-3)


@pytest.mark.parametrize(
    ("board", "said"), [(CHECKER, AS_CHECKER), (CHARUCO, AS_CHARUCO)], ids=["checker", "charuco"]
)
def test_a_board_gives_the_scale(opened: Opened, board: Any, said: dict[str, Any]) -> None:
    session, preview = opened
    picture = seen(board, PX_PER_MM)
    show(preview, picture)
    CHANGES["board"](session, said)
    scale = session.draft.config.scale
    assert scale.px_per_mm == pytest.approx(PX_PER_MM, rel=1e-3)
    assert scale.mm_per_px == pytest.approx(from_board(picture.astype(np.float32), board).mm_per_px, rel=1e-6)
    assert scale.method is not None and "corners" in scale.method and scale.sigma_mm_per_px
    assert session.state()["remarks"] == []


def test_a_tilt_is_shown_until_the_scale_is_taken_again(opened: Opened) -> None:
    session, preview = opened
    show(preview, seen(CHECKER, PX_PER_MM, degrees=12.0))
    CHANGES["board"](session, {"columns": 9, "rows": 6, "square": 5})
    (remark,) = session.state()["remarks"]
    assert "the board is tilted by 11 degrees" in remark
    CHANGES["scale"](session, {"points": [[10, 10], [110, 10]], "mm": 5})
    assert session.state()["remarks"] == []


def test_no_board_no_scale(opened: Opened) -> None:
    session, preview = opened
    with pytest.raises(DataError, match="no picture yet"):
        CHANGES["board"](session, AS_CHECKER)
    show(preview, np.full((200, 200), 90, np.uint8))
    with pytest.raises(DataError, match="no checkerboard of 9 x 6 inner corners"):
        CHANGES["board"](session, AS_CHECKER)
    assert session.draft.config.scale.px_per_mm is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"columns": 2}, {"columns": 9.5}, {"rows": "6"}, {"columns": True}, {"columns": 10**9},
        {"square": 0}, {"square": -1}, {"square": float("nan")}, {"square": 10**400}, {"square": None},
        {"marker": 7}, {"marker": "x"}, {"dictionary": 3}, {"dictionary": "__class__", "marker": 3},
    ],
)  # fmt: skip
def test_what_is_no_board_is_refused(opened: Opened, wrong: dict[str, Any]) -> None:
    session, preview = opened
    show(preview, seen(CHECKER, PX_PER_MM))
    with pytest.raises(ConfigError):
        CHANGES["board"](session, AS_CHECKER | wrong)
    assert not session.draft.changes


RIG = """# the rig of bench 3
[camera]
address = "sim:hole?bits=12"  # the blue one
[measure]
zoi = 48  # found by trial
"""


@pytest.fixture
def draft(tmp_path: Path) -> ConfigDraft:
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    return ConfigDraft(load_config(path, {"measure.step": 12}), path, {"measure.step": 12})


def test_saved_with_its_comments_and_loaded_again(draft: ConfigDraft) -> None:
    draft.change_all(
        {"measure.burst": 8, "gauges.axial": {"kind": "line", "start": [10, 20], "end": [10, 90]}}
    )
    mask = np.zeros((40, 50), bool)
    mask[5:20, 10:30] = True
    draft.save(mask)
    text = draft.path.read_text()
    assert "# the rig of bench 3" in text and "# the blue one" in text and "# found by trial" in text
    assert draft.path.with_name("rig.toml.bak").read_text() == RIG
    config = load_config(draft.path, {})
    assert (config.measure.zoi, config.measure.step, config.measure.burst) == (48, 12, 8)
    assert config.gauges["axial"]["end"] == (10, 90)
    assert np.array_equal(read_mask(config.measure.mask, 50, 40), mask)
    assert draft.changes == {} and draft.config == config


def test_a_second_mask_is_a_file_of_its_own(draft: ConfigDraft) -> None:
    first, second = np.eye(40, dtype=bool), ~np.eye(40, dtype=bool)
    draft.save(first)
    before = load_config(draft.path, {}).measure.mask
    draft.save(second)
    assert np.array_equal(read_mask(before, 40, 40), first)
    assert np.array_equal(read_mask(load_config(draft.path, {}).measure.mask, 40, 40), second)


@pytest.mark.parametrize(
    "changes",
    [
        {"measure.zoi": 4},
        {"measure.zoi": 32, "measure.step": "wide"},
        {"gauges.1a": {"kind": "line"}},
        {"gauges.a": {"kind": "spiral"}},
        {"record.enabled": False},
        {"output.dir": "/etc"},
        {"measure.nothing": 1},
        {"nothing.at": 1},
    ],
)
def test_what_is_impossible_changes_nothing(draft: ConfigDraft, changes: dict[str, object]) -> None:
    before, file = draft.config, draft.path.read_text()
    with pytest.raises(ConfigError):
        draft.change_all(changes)
    assert draft.config == before and draft.path.read_text() == file


def test_keys_are_removed(draft: ConfigDraft) -> None:
    draft.change_all({"gauges.a": {"kind": "zoi", "at": [5, 5]}, "specimen.width_mm": 20})
    draft.save(None)
    draft.change_all({"gauges.a": None, "specimen.width_mm": None})
    draft.save(None)
    config = load_config(draft.path, {})
    assert config.gauges == {} and config.specimen.width_mm is None


@pytest.mark.parametrize(
    ("name", "following"),
    [("bar-6", "bar-7"), ("bar-009", "bar-010"), ("B7", "B8"), ("bar", "bar-2"), ("3", "4")],
)
def test_next_name(name: str, following: str) -> None:
    assert next_name(name) == following


SHAPE = (60, 80)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)


def drawn(*strokes: dict[str, object], start: bool = False) -> DrawnRegion:
    found = DrawnRegion(np.full(SHAPE, start), "as given")
    found.draw(strokes)
    return found


def test_a_rectangle_from_any_corner() -> None:
    for points in ([[10.4, 20.2], [30.6, 40.0]], [[30.6, 20.2], [10.4, 40.0]]):
        found = drawn({"tool": "rectangle", "points": points})
        assert np.array_equal(found.mask, (X >= 10.4) & (X <= 30.6) & (Y >= 20.2) & (Y <= 40.0))
        assert found.box == (11, 21, 20, 20) and found.is_box and found.origin == "as drawn"


def test_a_rectangle_is_the_region_alone_unless_it_is_added() -> None:
    first = {"tool": "rectangle", "points": [[0, 0], [9, 9]]}
    other = {"tool": "rectangle", "points": [[20, 20], [29, 29]]}
    assert drawn(first, other).box == (20, 20, 10, 10)
    both = drawn(first, other | {"add": True})
    assert both.box == (0, 0, 30, 30) and not both.is_box and both.mask.sum() == 200


def test_a_polygon() -> None:
    found = drawn({"tool": "polygon", "points": [[10, 10], [50, 10], [10, 50]]})
    inside = (X > 10) & (Y > 10) & (X + Y < 60)
    edge = (np.abs(X - 10) < 1) | (np.abs(Y - 10) < 1) | (np.abs(X + Y - 60) < 1)
    assert np.array_equal(found.mask[~edge], inside[~edge])


def test_outside_the_picture_nothing_is_drawn() -> None:
    found = drawn({"tool": "rectangle", "points": [[-100, -100], [-50, -50]]})
    assert found.box is None and not found.is_box
    assert drawn({"tool": "brush", "points": [[-3, 10]], "radius": 5}).box == (0, 6, 3, 9)


def test_undo_goes_back_to_what_was_given() -> None:
    found = drawn({"tool": "rectangle", "points": [[0, 0], [9, 9]]}, start=True)
    found.undo()
    found.undo()
    assert found.mask.all() and found.origin == "as given"


@pytest.mark.parametrize(
    "stroke",
    [
        {},
        {"tool": "axe", "points": [[1, 1], [2, 2]]},
        {"tool": "rectangle", "points": [[1, 1]]},
        {"tool": "rectangle", "points": "ab"},
        {"tool": "rectangle", "points": [[1, 1], [2, float("nan")]]},
        {"tool": "rectangle", "points": [[1, 1], [2, 1e300]]},
        {"tool": "rectangle", "points": [[1, 1], [True, 2]]},
        {"tool": "polygon", "points": [[1, 1], [2, 2]]},
        {"tool": "brush", "points": [[1, 1]], "radius": 0},
        {"tool": "brush", "points": [[1, 1]], "radius": "5"},
        {"tool": "brush", "points": [[1, 1]] * 5001},
    ],
)
def test_what_is_no_stroke_changes_nothing(stroke: dict[str, object]) -> None:
    found = drawn({"tool": "rectangle", "points": [[0, 0], [9, 9]]})
    with pytest.raises(ConfigError):
        found.draw([{"tool": "rectangle", "points": [[20, 20], [29, 29]]}, stroke])
    assert found.box == (0, 0, 10, 10)


@pytest.mark.parametrize("address", ["", 7, None, "sim:\nmore", "/dev/ttyUSB0\x1b[2J", "x" * 501])
@pytest.mark.parametrize(("change", "key"), [("address", "value"), ("load", "value"), ("identify", "port")])
def test_an_address_is_a_text_in_one_line(change: str, key: str, address: object) -> None:
    with pytest.raises(ConfigError, match="an address is a text of 1 to 500 letters in one line"):
        CHANGES[change](Mock(), {key: address})


def test_the_region_is_seen_when_its_automatic_gauges_are_placed(tmp_path: Path) -> None:
    """Else an edit of the page between the two is lost."""
    draft = draft_of(tmp_path, '[measure]\nzoi = 32\nstep = 16\nroi = [20, 20, 180, 150]\ngauges = "auto"\n')
    seen_at_changes: list[DrawnRegion | None] = []

    def spied(*changes: Mapping[str, Any]) -> None:
        seen_at_changes.append(region.drawn)
        ConfigDraft.replace_gauges(draft, *changes)

    draft.replace_gauges = spied  # type: ignore[assignment]
    region = SpecimenRegion(draft, None, lambda: None)
    region.begin(INFO, np.zeros((1, 192, 256), np.float32))
    assert seen_at_changes == [None] and list(draft.config.gauges) == ["extension", "width", "area"]
    assert draft.config.gauges["area"]["box"] == (27.0, 27.0, 161.0, 129.0)
    assert region.drawn is not None and region.drawn.box == (20, 20, 180, 150)
    region.undo()
    assert not draft.config.gauges


def test_a_region_too_small_for_gauges_is_shown(tmp_path: Path) -> None:
    draft = draft_of(tmp_path, '[measure]\nzoi = 32\nstep = 16\nroi = [20, 20, 180, 40]\ngauges = "auto"\n')
    region = SpecimenRegion(draft, None, lambda: None)
    with pytest.raises(ConfigError, match="1 rows of ZOIs"):
        region.begin(INFO, np.zeros((1, 192, 256), np.float32))
    assert region.drawn is not None and region.drawn.box == (20, 20, 180, 40)


def test_a_load_cell_that_is_missing_stays_so_while_it_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a check at that moment is GO."""
    troubles: list[str] = []

    def missing(address: str, *_: object) -> None:
        troubles.append(preview.trouble)
        raise DataError(f"{address}: there is no such port")

    monkeypatch.setattr(load_preview, "open_load", missing)
    monkeypatch.setattr(load_preview, "RETRY_S", 0.01)
    draft = draft_of(tmp_path, load__address="/dev/one?protocol=ascii")
    preview = load_preview.LoadPreview(draft)
    preview.start()
    try:
        until(lambda: len(troubles) > 3)
        draft.change_all({"load.address": "/dev/two?protocol=ascii"})
        until(lambda: "two" in troubles[-1])
    finally:
        preview.close()
    one, two = ("/dev/one: there is no such port", "/dev/two: there is no such port")
    assert troubles[:3] == ["", one, one] and set(troubles[3:]) == {one, "", two}
    assert troubles.count("") == 2, "none while the first try of each runs"


def test_a_load_cell_that_is_not_open_yet_is_no_recorded_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A check between the choice of a cell and its opening is NO-GO; a cell that was open before is no excuse."""
    draft = draft_of(tmp_path, load__address="sim:")
    opening, go_on, real = threading.Event(), threading.Event(), load_preview.open_load

    def slow(address: str, *others: Any) -> Any:
        if "two" in address:
            opening.set()
            go_on.wait()
            address = "sim:"
        return real(address, *others)

    monkeypatch.setattr(load_preview, "open_load", slow)
    preview = load_preview.LoadPreview(draft)

    def said() -> list[tuple[str, bool]]:
        return [(line.value, line.good) for line in preview.lines(preview.report())]

    preview.start()
    try:
        until(lambda: preview.report() is not None)
        assert said() == []
        draft.change_all({"load.address": "/dev/two?protocol=ascii"})
        assert said() == [("not open yet", False)], "the thread still reads the cell before"
        preview.reopen()
        opening.wait()
        assert said() == [("not open yet", False)]
        go_on.set()
        until(lambda: preview.report() is not None)
        assert said() == []
        for address, line in (("session:", "recorded, "), ("none:", "none: ")):
            draft.change_all({"load.address": address})
            assert [(text.startswith(line), good) for text, good in said()] == [(True, True)]
    finally:
        go_on.set()
        preview.close()
