"""Changes of the set-up, by value: what each draft gets, and the region with its undo."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.frame import Frame, frozen
from live.config.gauges import with_colours
from live.config.loading import load_config
from live.setup.pictures import read_mask
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.map_view import gauge_shapes
from live.ui.web.setup.config_draft import drafts_of
from live.ui.web.setup.draft_changes import CHANGES
from live.ui.web.setup.setup_session import SetupSession, SetupSessions
from live.ui.web.setup.specimen_region import DrawnRegion, SpecimenRegion
from tests.live.made_up import make_grid
from tests.live.ui.web.test_setup_values import INFO, draft_of, figures

# -- drafts ---------------------------------------------------------------------------------------


def test_a_second_camera_has_a_draft_of_its_own(tmp_path: Path) -> None:
    assert list(drafts_of(draft_of(tmp_path))) == [""]
    text = '[camera]\naddress = "sim:a"\nback = "sim:b"\n[measure]\nzoi = 40\n[specimen]\nwidth_mm = 9.0\n'
    first, found = drafts_of(draft_of(tmp_path, text)).values()
    assert first.path == tmp_path / "rig.toml" and found.path == tmp_path / "rig-back.toml"
    assert found.config.camera.address == "sim:b" and found.config.measure.zoi == 40
    assert found.changes == {"camera.address": "sim:b", "measure.zoi": 40}
    (tmp_path / "b.toml").write_text('[camera]\naddress = "sim:c"\n[measure]\nzoi = 48\n')
    found = drafts_of(draft_of(tmp_path, text.replace("sim:b", f"{tmp_path}/b.toml")))["back"]
    assert found.path == tmp_path / "b.toml" and found.changes == {}
    assert (found.config.camera.address, found.config.measure.zoi) == ("sim:c", 48)


@pytest.fixture
def both(tmp_path: Path) -> Iterator[SetupSessions]:
    text = '[camera]\naddress = "sim:a"\nback = "sim:b"\n'
    draft = draft_of(tmp_path, text)
    sessions = SetupSessions(drafts_of(draft), Broadcaster(), {})
    yield sessions
    for session in sessions.by_name.values():
        session._folder.cleanup()


def test_specimen_and_metadata_are_those_of_the_first_camera(both: SetupSessions) -> None:
    front, back = both.by_name.values()
    assert (both.of("back"), both.of("front"), both.of("x"), both.of(3)) == (back, front, front, front)
    for key, value in (("specimen.width_mm", 12.5), ("metadata.note", "a"), ("specimen.axis", "x")):
        CHANGES["set"](back, {"key": key, "value": value})
    assert front.draft.config.specimen.width_mm == 12.5 and front.draft.config.metadata["note"] == "a"
    assert (front.draft.config.specimen.axis, back.draft.config.specimen.axis) == ("auto", "x")
    assert back.draft.config.specimen.width_mm is None
    state = back.state()
    assert (state["specimen"]["width_mm"], state["specimen"]["axis"], state["side"]) == (12.5, "x", "back")
    CHANGES["set"](back, {"key": "specimen.width_mm", "value": ""})
    assert front.draft.config.specimen.width_mm is None
    edition = back.region.edition
    CHANGES["set"](back, {"key": "measure.step", "value": 12})
    assert back.region.edition == edition + 1 and front.region.edition == 0
    for key in ("camera.address", "gauges.a", "load.zero_N", "measure.roi", "measure.mask", 3):
        with pytest.raises(ConfigError, match="cannot be changed like this"):
            CHANGES["set"](back, {"key": key, "value": 1})
    assert back.load is front.load and back.devices is front.devices


def test_all_cameras_are_checked(both: SetupSessions, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []
    for name, session in both.by_name.items():
        monkeypatch.setattr(session.check, "begin", lambda name=name: begun.append(name))
    both.check()
    assert begun == ["front", "back"]


def test_the_rig_file_of_the_first_names_those_of_all_others(tmp_path: Path) -> None:
    draft = draft_of(tmp_path, '[camera]\naddress = "sim:a"\nbeside = ["sim:b", "sim:c"]\n')
    sessions = SetupSessions(drafts_of(draft), Broadcaster(), {})
    for session in sessions.by_name.values():
        session._folder.cleanup()
    CHANGES["set"](sessions.of("third"), {"key": "measure.zoi", "value": 48})
    sessions.save()
    own = tmp_path / "rig-second.toml", tmp_path / "rig-third.toml"
    assert load_config(tmp_path / "rig.toml", {}).camera.beside == tuple(map(str, own))
    second, third = (load_config(path, {}) for path in own)
    assert (second.camera.address, second.measure.zoi) == ("sim:b", 64)
    assert (third.camera.address, third.measure.zoi) == ("sim:c", 48)
    again = drafts_of(draft_of(tmp_path, (tmp_path / "rig.toml").read_text()))
    assert [one.path for one in again.values()] == [draft.path, *own]


def test_another_load_cell_has_no_zero_yet(both: SetupSessions) -> None:
    front, back = both.by_name.values()
    front.draft.change_all({"load.zero_N": 5.0})
    back.check.values["go"] = True
    CHANGES["load"](back, {"value": "sim:?noise_N=1"})
    assert (front.draft.config.load.address, front.draft.config.load.zero_N) == ("sim:?noise_N=1", 0.0)
    assert back.check.values["go"] is None


class Preview:
    """Opens the camera of any address."""

    trouble = ""

    def __init__(self) -> None:
        self.opened: list[str] = []
        self.info: Any = SimpleNamespace(settings=[SimpleNamespace(key="gain")])

    def reopen(self, address: str) -> None:
        self.opened.append(address)


@pytest.fixture
def session(tmp_path: Path) -> Iterator[SetupSession]:
    made = SetupSession(draft_of(tmp_path, '[camera]\naddress = "sim:?fps=5&gain=2"\n'), Broadcaster())
    made.preview = Preview()  # type: ignore[assignment]
    yield made
    made._folder.cleanup()


def test_settings_of_the_camera_are_in_its_address(session: SetupSession) -> None:
    for name, request in (
        ("camera", {"key": "gain", "value": 7}), ("option", {"key": "fps", "value": 12.5}),
        ("option", {"key": "fps", "value": ""}), ("option", {"key": "format", "value": "Y12"}),
        ("address", {"value": "sim:hole"}),
    ):  # fmt: skip
        CHANGES[name](session, request)
    opened: Any = session.preview
    assert opened.opened == ["sim:?fps=5&gain=7", "sim:?fps=12.5&gain=2", "sim:?gain=2", "sim:?fps=5&gain=2&format=Y12",
                             "sim:hole"]  # fmt: skip
    for name, request, words in (
        ("camera", {"key": "fps", "value": 3}, "one of gain"),
        ("option", {"key": "gain", "value": "3"}, "format and fps"),
        ("option", {"key": "fps", "value": "1" * 41}, "format and fps"),
        ("option", {"key": "format", "value": None}, "format and fps"),
        ("option", {"key": "fps", "value": "20,5"}, "a rate in 1/s is a number from 0.01 to 100000"),
        ("option", {"key": "fps", "value": 0}, "a rate in 1/s is a number"),
        ("option", {"key": "fps", "value": True}, "a rate in 1/s is a number"),
        ("set", {"key": "specimen.width_mm", "value": "20,5"}, "specimen.width_mm"),
        ("set", {"key": "specimen.width_mm", "value": "20"}, "specimen.width_mm"),
        ("set", {"key": "specimen.width_mm", "value": -1}, "specimen.width_mm"),
        ("scale", {"points": [[1, 2], [50, 2]], "mm": "10"}, "a distance is a number"),
        ("overlay", {"name": "x", "on": True}, "the overlays are saturated, quality"),
        ("scale", {"points": [[9, 9], [9, 9]], "mm": 3}, "more than 1 px apart"),
        ("scale", {"points": [[9, 9], [10**400, 9]], "mm": 3}, "two points"),
        ("board", {"columns": 5, "rows": 4, "square": -1}, "a square in mm is a number from 0 to 100000"),
        ("gauge", {"kind": ["line"], "points": [[1, 2], [3, 4]]}, "kind"),
        ("gauge", {"kind": "line", "points": [[1, "a"]]}, "1 to 100 points"),
        ("gauge", {"kind": "line", "points": None}, "1 to 100 points"),
        ("gauge", {"name": "long", "was": ["a"], "gauge": 3}, "gauge"),
        ("draw", {"strokes": []}, "strokes are a list"), ("draw", {"strokes": [{}] * 501}, "strokes are a list"),
        ("draw", {"strokes": ["a"]}, "a stroke has"), ("scale", {"points": [[1, 2]], "mm": 3}, "two points"),
    ):  # fmt: skip
        with pytest.raises(ConfigError, match=words):
            CHANGES[name](session, request)
    CHANGES["overlay"](session, {"name": "quality", "on": True})
    CHANGES["overlay"](session, {"name": "saturated", "on": 1})
    assert session.overlays == {"saturated": False, "quality": True}


def test_gauges_are_made_at_points_and_named(session: SetupSession) -> None:
    for number in (1, 2, 3):
        CHANGES["gauge"](session, {"kind": "line", "points": [[10, 20], [10, 60 + number]]})
    gauges = session.draft.config.gauges
    first, second, third = gauges
    assert (second, third) == (f"{first}2", f"{first}3") and gauges[third]["end"] == (10, 63)
    CHANGES["gauge"](session, {"name": "mine", "was": first})
    assert set(session.draft.config.gauges) == {second, third, "mine"}
    with pytest.raises(ConfigError, match=f"already a gauge {second}"):
        CHANGES["gauge"](session, {"name": second, "was": "mine"})
    with pytest.raises(ConfigError, match="1 to 100 points"):
        CHANGES["gauge"](session, {"kind": "line", "points": [[1, 2]] * 101})
    CHANGES["undo"](session, {})
    assert list(session.draft.config.gauges) == [first, second, third] or set(
        session.draft.config.gauges
    ) == set(gauges)


def test_the_picture_shows_what_is_saturated_and_how_noisy_the_zois_are(session: SetupSession) -> None:
    image = np.full((96, 128), 1000, np.uint16)
    image[80:, :20] = 4095
    frame = Frame(frozen(image), 0, 0.0, "nominal", 0, 12, 0.0)
    session.preview.info = None
    session.show(frame)
    assert session.picture == b"" and session.state()["picture"] == 0, "no page is open"
    session._broadcaster.open()
    session.check.figures = figures()

    def shown(**overlays: bool) -> np.ndarray:
        session.overlays.update(overlays)
        session.show(frame)
        return cv2.imdecode(np.frombuffer(session.picture, np.uint8), cv2.IMREAD_COLOR).astype(int)

    plain = shown(saturated=False, quality=False)
    assert np.ptp(plain[50, 64]) < 8 and np.ptp(plain[90, 10]) < 8
    red = shown(saturated=True)
    assert red[90, 8, 2] - red[90, 8, 0] > 150 and np.ptp(red[50, 64]) < 8
    green = shown(quality=True)
    x, y = int(make_grid().x[4]), int(make_grid().y[1])
    assert green[y, x, 1] - green[y, x, 2] > 30 and session.state()["picture"] == 3


def test_drawing_takes_at_most_a_third_of_the_time(
    session: SetupSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fifth of a second apart, or twice as long as it took."""
    session.preview.info = None
    for took, due in ((0.05, 10.2), (1.0, 13.0)):
        times = iter((10.0, 10.0 + took, 10.0 + took))
        monkeypatch.setattr("live.ui.web.setup.setup_session.time.monotonic", lambda times=times: next(times))
        monkeypatch.setattr(session, "refresh", lambda: None)
        frame = Frame(frozen(np.zeros((4, 4), np.uint8)), 0, 0.0, "nominal", 0, 8, 0.0)
        assert session.show(frame) == pytest.approx(due)


# -- the region -----------------------------------------------------------------------------------


def region_of_box(folder: Path, box: tuple[int, int, int, int] = (20, 30, 100, 90)) -> SpecimenRegion:
    x, y, w, h = box
    draft = draft_of(folder, f"[measure]\nzoi = 32\nstep = 16\nroi = [{x}, {y}, {w}, {h}]\n")
    region = SpecimenRegion(draft, None, lambda: None)
    region.begin(INFO, np.zeros((1, 192, 256), np.float32))
    return region


def test_what_is_not_measured_is_darkened(tmp_path: Path) -> None:
    region = region_of_box(tmp_path)
    shade = cv2.imdecode(np.frombuffer(region.shade(), np.uint8), cv2.IMREAD_UNCHANGED)
    assert shade.shape == (192, 256, 4)
    assert shade[30, 20].tolist() == shade[119, 119].tolist() == [0, 0, 0, 0]
    assert shade[29, 20].tolist() == shade[119, 120].tolist() == [60, 20, 0, 150]
    before = SpecimenRegion(draft_of(tmp_path), None, lambda: None)
    assert cv2.imdecode(np.frombuffer(before.shade(), np.uint8), cv2.IMREAD_UNCHANGED).tolist() == [[[0] * 4]]


def test_one_undo_for_region_and_gauges(tmp_path: Path) -> None:
    region = region_of_box(tmp_path)
    gauge = {"kind": "zoi", "at": [60, 60]}
    region.set_gauges({"a": gauge})
    region.draw([{"tool": "rectangle", "points": [[0, 0], [49, 39]]}])
    assert region.can == ["undo"]
    region.set_gauges({"b": gauge})
    assert region.known.box == (0, 0, 50, 40) and set(region._draft.config.gauges) == {"b"}
    region.undo()
    assert region.known.box == (0, 0, 50, 40) and set(region._draft.config.gauges) == {"a"}
    edition = region.edition
    region.undo()
    assert region.known.box == (20, 30, 100, 90) and region.edition == edition + 1
    assert region.can == ["undo", "redo"]
    region.redo()
    assert region.known.box == (0, 0, 50, 40) and region.edition == edition + 2
    region.redo()
    assert set(region._draft.config.gauges) == {"b"} and region.can == ["undo"]
    with pytest.raises(ConfigError, match="nothing to make again"):
        region.redo()
    for _ in range(3):
        region.undo()
    assert not region._draft.config.gauges and region.can == ["redo"]
    with pytest.raises(ConfigError, match="nothing to undo"):
        region.undo()
    region.redo()
    for k in range(15):
        assert k == 0 or region.can == ["undo"], "a new edit ends what could be made again"
        region.draw([{"tool": "rectangle", "points": [[0, 0], [10 + k, 9]]}])
    for _ in range(12):
        region.undo()
    assert region.known.box == (0, 0, 13, 10), "the first three cannot be undone"


def test_a_gauge_keeps_place_and_colour_when_it_is_renamed_and_saved(session: SetupSession) -> None:
    session.region.drawn = DrawnRegion(np.ones((192, 256), bool), "all")
    for name, x in (("a", 40), ("b", 90), ("c", 140)):
        CHANGES["gauge"](session, {"name": name, "gauge": {"kind": "zoi", "at": [x, 60]}})
    CHANGES["gauge"](session, {"name": "a", "gauge": None})
    CHANGES["gauge"](session, {"name": "first", "was": "b"})
    CHANGES["gauge"](session, {"kind": "zoi", "points": [[200, 60]]})

    def seen() -> list[tuple[str, int]]:
        return [(name, shape["colour"]) for name, shape in gauge_shapes(session.draft.config).items()]

    now = [("first", 1), ("c", 2), ("point", 0)]
    assert seen() == now, "the colour that is free is taken again"
    CHANGES["gauge"](session, {"name": "first", "points": [[95, 60]]})
    assert seen() == now and session.draft.config.gauges["first"]["at"] == (95, 60)
    CHANGES["undo"](session, {})
    CHANGES["undo"](session, {})
    CHANGES["undo"](session, {})
    assert seen() == [("b", 1), ("c", 2)]
    CHANGES["redo"](session, {})
    assert seen() == now[:2]
    session.region.save()
    CHANGES["gauge"](session, {"name": "again", "was": "first"})
    session.region.save()
    saved = load_config(session.draft.path, {}).gauges
    assert [(name, table["colour"]) for name, table in saved.items()] == [("again", 1), ("c", 2)]
    assert session.draft.changes == {}


def test_gauges_of_a_file_without_colours_have_those_of_their_places() -> None:
    tables = {"a": {"kind": "zoi"}, "b": {"kind": "zoi", "colour": 0}, "c": {"kind": "zoi"}}
    assert [one["colour"] for one in with_colours(tables).values()] == [1, 0, 2]


def test_a_region_holds_for_pictures_of_its_size(tmp_path: Path) -> None:
    region = region_of_box(tmp_path)
    region.opened(INFO)
    assert region.drawn is not None
    region.opened(replace(INFO, width=192, height=256))
    assert region.drawn is None
    for ask in (region.undo, lambda: region.known, lambda: region.config(tmp_path), region.place_gauges):
        with pytest.raises((ConfigError, DataError)):
            ask()
    region.save()  # writes the rest


def test_a_region_that_is_no_rectangle_is_measured_by_its_mask(tmp_path: Path) -> None:
    region = region_of_box(tmp_path)
    config = region.config(tmp_path)
    assert (config.measure.roi, config.measure.mask) == ((20, 30, 100, 90), None)
    region.draw([{"tool": "eraser", "points": [[70, 75]], "radius": 10}])
    config = region.config(tmp_path)
    assert config.measure.roi == (20, 30, 100, 90)
    mask = read_mask(config.measure.mask, 256, 192)
    assert mask is not None and np.array_equal(mask, region.known.mask) and not mask[75, 70] and mask[30, 20]
    region.save()
    saved = load_config(region._draft.path, {})
    assert saved.measure.roi == (20, 30, 100, 90)
    assert np.array_equal(read_mask(saved.measure.mask, 256, 192), mask)
    thin = {"tool": "rectangle", "points": [[0, 0], [99, 3]]}
    region.draw([thin, {"tool": "rectangle", "points": [[0, 0], [3, 99]], "add": True}])
    with pytest.raises(DataError, match="no ZOI lies in the region"):
        region.ready(tmp_path)
    region.replace(np.zeros((192, 256), bool), "nothing")
    with pytest.raises(DataError, match="no region is drawn yet"):
        region.config(tmp_path)


def test_a_mask_of_the_rig_is_within_its_box(tmp_path: Path) -> None:
    mask = np.zeros((192, 256), np.uint8)
    mask[40:150, 10:80] = 255
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    text = f'[measure]\nzoi = 32\nstep = 16\nroi = [20, 30, 100, 90]\nmask = "{tmp_path}/mask.png"\n'
    region = SpecimenRegion(draft_of(tmp_path, text), None, lambda: None)
    region.begin(INFO, np.zeros((1, 192, 256), np.float32))
    assert region.known.box == (20, 40, 60, 80)


def test_a_region_goes_back_as_often_as_it_may() -> None:
    found = DrawnRegion(np.ones((4, 4), bool), "first")
    for k in range(20):
        found.replace(np.full((4, 4), k % 2 == 0), str(k))
    for _ in range(20):
        found.undo()
    assert found.origin == "7"


def test_a_brush_follows_its_path() -> None:
    """Within 3 px of a path that bends; an eraser takes the same."""
    path = [[10, 10], [30, 40], [50, 25], [50, 25]]
    found = DrawnRegion(np.zeros((60, 70), bool), "nothing")
    found.draw([{"tool": "brush", "points": path, "radius": 3}])
    rows, columns = np.mgrid[:60, :70].astype(float)
    near = np.zeros((60, 70), bool)
    for (x0, y0), (x1, y1) in itertools.pairwise(path[:3]):
        for share in np.linspace(0, 1, 2001):
            near |= np.hypot(columns - x0 - share * (x1 - x0), rows - y0 - share * (y1 - y0)) <= 3
    assert np.count_nonzero(near != found.mask) <= 2, "but for rounding"
    found.draw([{"tool": "eraser", "points": path, "radius": 3}])
    assert not found.mask.any()


def test_the_noise_of_a_mean_is_that_of_the_differences_of_frames(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 4 frames with 3 GL each: 3 / sqrt(4); one frame does not tell."""
    told: list[Any] = []
    found = SimpleNamespace(inside=lambda *_: np.ones((192, 256), bool), words="found")

    def spied(config: Any, picture: Any, noise: Any) -> Any:
        told.append((config.measure.roi, float(picture.mean()), noise))
        return found

    monkeypatch.setattr("live.ui.web.setup.specimen_region.region_of", spied)
    region = region_of_box_without(tmp_path)
    rng = np.random.default_rng(1)
    region.find(INFO, (100 + rng.normal(0, 3, (4, 192, 256))).astype(np.float32))
    region.find(INFO, np.full((1, 192, 256), 100, np.float32))
    region.find(INFO, np.full((3, 192, 256), 100, np.float32))
    (roi, mean, noise), *others = told
    assert roi is None and mean == pytest.approx(100, abs=0.1) and noise == pytest.approx(1.5, rel=0.01)
    assert [one[2] for one in others] == [None, None] and region.known.origin == "found"


def region_of_box_without(folder: Path) -> SpecimenRegion:
    return SpecimenRegion(draft_of(folder), DrawnRegion(np.zeros((192, 256), bool), "as drawn"), lambda: None)
