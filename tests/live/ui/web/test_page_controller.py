"""The stages of the page: accepted commands and changes; with a simulated camera, without a browser."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import EventKind
from acquire.files.picture import write_picture
from acquire.frame import Frame
from acquire.text.message import from_json
from live.config.cameras import camera_configs
from live.config.loading import Config, load_config
from live.pipeline.run_state import RunState
from live.run.control import Answer
from live.setup.devices import at_rest, open_rig
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.page_controller import PageController
from live.ui.web.setup.camera_preview import CameraPreview
from live.ui.web.setup.config_draft import ConfigDraft
from live.ui.web.setup.setup_session import SetupSession
from tests.live.ui.waiting import LONG_S, until
from tests.live.ui.web.test_server import fetch

CAMERA = "sim:uniform?width=256&height=192&fps=15&seconds=30"


class PageSession:
    """A page controller with a rig, set up by a thread as ``phasedic page`` does it."""

    def __init__(self, folder: Path, camera: str = "") -> None:
        self.rig = folder / "rig.toml"
        self.rig.write_text(
            f'# bench 3\n[camera]\naddress = "{CAMERA}"\n{camera}[measure]\nzoi = 32\ngauges = "auto"\n'
        )
        said = {"output.dir": str(folder)}
        self.controller = PageController(ConfigDraft(load_config(self.rig, said), self.rig, said), port=0)
        self.started: list[Config | None] = []
        self._thread = threading.Thread(
            target=lambda: self.started.append(self.controller.set_up()), daemon=True
        )
        self._thread.start()
        until(lambda: self.controller.session is not None)

    def post(self, path: str, value: dict[str, Any]) -> str:
        body = json.dumps(value).encode()
        answer = fetch(self.controller.server, path, method="POST", body=body)
        return Answer(**json.loads(answer.body, object_hook=from_json)).line

    def command(self, line: str) -> str:
        return self.post("/order", {"line": line})

    def change(self, **value: Any) -> str:
        return self.post("/setup", value)

    def end(self) -> None:
        self.controller.quit()
        self._thread.join(LONG_S)
        self.controller.__exit__()

    def has_ended(self) -> Config | None:
        self._thread.join(LONG_S)
        return self.started[0]


@pytest.fixture
def at(tmp_path: Path) -> Iterator[PageSession]:
    found = PageSession(tmp_path)
    yield found
    found.end()


def test_set_up_changed_saved_and_started(at: PageSession, tmp_path: Path) -> None:
    session = at.controller.session
    until(lambda: session.region.drawn is not None and bool(session.draft.config.gauges))
    assert set(session.draft.config.gauges) == {"extension", "width", "area"}, "placed, as the rig asks for"
    assert at.command("tare").startswith("no:") and at.command("next").startswith("no:")
    assert at.change(do="draw", strokes=[{"tool": "rectangle", "points": [[20, 20], [200, 170]]}]) == "ok"
    assert at.change(do="draw", strokes=[{"tool": "brush", "points": []}]).startswith("no:")
    assert (
        at.change(do="undo") == "ok"
        and at.change(do="all") == "ok"
        and at.change(do="dance").startswith("no:")
    )
    assert at.change(do="draw", strokes=[{"tool": "rectangle", "points": [[20, 20], [30, 30]]}]) == "ok"
    assert at.command("start").startswith("no:"), "no ZOI fits into this"
    assert at.change(do="undo") == "ok"
    assert at.change(do="gauge", name="extension", gauge={"kind": "zoi", "at": [-900, 20]}) == "ok"
    assert "extension" in at.command("start"), "the gauge lies nowhere"
    assert at.change(do="place") == "ok"
    assert at.change(do="gauge", name="tip", was="area", gauge={"kind": "zoi", "at": [100, 90]}) == "ok"
    assert at.change(do="gauge", name="tip", was="extension", gauge={"kind": "zoi", "at": [1, 1]}).startswith(
        "no:"
    )
    assert at.change(do="gauge", kind="line", points=[[50.04, 40], [50, 120]]) == "ok"
    assert at.change(do="gauge", name="axial", points=[[60, 40], [60, 130]]) == "ok", "moved by its handles"
    assert at.change(do="gauge", name="long", was="axial") == "ok"
    assert session.draft.config.gauges["long"] == {
        "kind": "line", "start": (60, 40), "end": (60, 130), "colour": 3,
    }  # fmt: skip
    drawn = session.state()["gauges"]["long"]
    assert drawn["handles"] == ((60, 40), (60, 130)) and drawn["outline"][0] == [(60, 40), (60, 130)]
    assert at.change(do="gauge", name="long", gauge=None) == "ok"
    assert at.change(do="scale", points=[[10, 10], [110, 10]], mm=5) == "ok"
    assert at.change(do="scale", points=[[10, 10], [110, 10]], mm=True) == "no: a distance is a number"
    assert at.change(do="overlay", name="quality", on=True) == "ok"
    assert at.change(do="save") == "ok"
    saved = load_config(at.rig, {})
    assert saved.output.dir is None, "where the files go today is not of the rig"
    assert "# bench 3" in at.rig.read_text() and set(saved.gauges) == {"extension", "width", "tip"}
    assert saved.scale.px_per_mm == pytest.approx(20) and saved.measure.roi is not None
    assert at.command("start") == "ok"
    config = at.has_ended()
    assert config is not None and config.output.dir == str(tmp_path / "specimen-1")
    assert at.command("start").startswith("no:"), "it has been started"


@pytest.mark.slow
def test_two_cameras_are_set_up_checked_saved_and_started_together(tmp_path: Path) -> None:
    at = PageSession(tmp_path, f'back = "{CAMERA}&side=back&seed=3"\n')
    try:
        sessions = at.controller.sessions
        assert sessions is not None and list(sessions.by_name) == ["front", "back"]
        front, back = sessions.by_name.values()
        until(lambda: front.region.drawn is not None and back.region.drawn is not None)
        box = {"tool": "rectangle", "points": [[20, 20], [200, 170]]}
        assert at.change(do="draw", side="back", strokes=[box]) == "ok"
        assert front.region.drawn != back.region.drawn
        assert at.change(do="place", side="back") == "ok"
        assert (
            at.change(do="gauge", side="back", name="behind", kind="line", points=[[60, 40], [60, 130]])
            == "ok"
        )
        assert at.change(do="set", side="back", key="measure.step", value=12) == "ok"
        assert at.change(do="load", side="back", value="sim:") == "ok"
        pictures = {side: fetch(at.controller.server, f"/mask?side={side}").body for side in sessions.by_name}
        assert pictures["front"] != pictures["back"]
        assert at.change(do="check") == "ok"
        until(lambda: all(one.check.values["go"] is not None for one in sessions.by_name.values()))
        assert any(line["what"] == "load cell" for line in front.check.values["lines"])
        assert not any(line["what"] == "load cell" for line in back.check.values["lines"])
        assert at.change(do="save") == "ok"
        own = load_config(tmp_path / "rig-back.toml", {})
        assert load_config(at.rig, {}).camera.back == str(tmp_path / "rig-back.toml")
        assert (own.camera.address, own.measure.step) == (f"{CAMERA}&side=back&seed=3", 12)
        assert own.measure.roi == (20, 20, 181, 151) and "behind" in own.gauges
        assert at.command("start") == "ok"
        config, others = at.has_ended(), at.controller.others
        assert config is not None and len(others) == 1
        configs = camera_configs(config, {}, others)
        assert configs["back"].measure.roi == (20, 20, 181, 151) and configs["back"].load.address == "sim:"
        assert configs["front"].measure.roi != (20, 20, 180, 150)
    finally:
        at.end()


def test_a_camera_setting_that_is_refused_leaves_the_camera_as_it_was(at: PageSession) -> None:
    session = at.controller.session
    until(lambda: session.preview.info is not None)
    assert at.change(do="camera", key="exposure_us", value=3000) == "ok"
    assert session.preview.info is not None and session.preview.info.exposure_s == pytest.approx(3e-3)
    before = session.draft.config.camera.address
    assert at.change(do="camera", key="exposure_us", value=1e9).startswith("no:")
    assert at.change(do="camera", key="format", value=1).startswith("no:")
    assert session.draft.config.camera.address == before
    until(lambda: len(session.preview.recent()) > 2)


class Run:
    """A run that only records its commands."""

    paused = False

    def __init__(self) -> None:
        self.received: list[str] = []
        self.run_state = RunState.new(0.5)
        self.states, self.cameras = {"": self.run_state}, {"": self}

    def stop(self, reason: str) -> None:
        self.received.append("quit")

    def command(self, kind: EventKind, note: str = "") -> str:
        self.received.append(f"{kind} {note}".strip())
        return ""


def test_commands_during_a_run_and_after(at: PageSession) -> None:
    at.controller.quit()
    assert at.has_ended() is None
    at.controller.begin({"": load_config(None, {})})
    assert at.command("tare") == "no: the test is being opened"
    run: Any = Run()
    at.controller.attach(run)
    assert at.command("tare") == "ok" and at.command("note a b") == "ok" and at.command("quit") == "ok"
    assert at.command("fly").startswith("no:") and at.post("/order", {"line": 3}).startswith("no:")
    assert run.received == ["tare once", "note a b", "quit"], "two pages cannot confirm one another's tare"
    assert at.post("/order", {"line": "quit", "stage": "after"}).startswith("no: the stage has changed")
    assert at.post("/order", {"line": "quit", "stage": "run"}) == "ok"
    assert at.change(do="all") == "no: nothing is set up now"
    assert at.post("/map", {"of": "e1"}) == "ok" and at.post("/map", {"of": "x"}).startswith("no:")
    opened: list[int] = []
    at.controller.viewer = lambda port: opened.append(port) or Answer()  # type: ignore[func-returns-value]
    assert at.post("/viewer", {}).startswith("no:"), "the view does not serve yet"
    run.run_state.health.view_port = 9999
    assert at.post("/viewer", {}) == "ok" and opened == [9999]
    at.controller.end({"figures": []})
    assert at.post("/viewer", {}).startswith("no:") and opened == [9999], "the view ends with the run"
    assert at.command("tare").startswith("no:") and at.command("next") == "ok"
    assert at.controller.after()
    assert at.controller.draft is not None and at.controller.draft.config.metadata["specimen"] == "specimen-2"


def recorded(folder: Path, count: int) -> Path:
    """A folder with pictures of the simulated specimen."""
    shots = folder / "shots"
    shots.mkdir()
    rig = open_rig(at_rest(CAMERA), "none:")
    with rig.camera as camera:
        for k, frame in zip(range(count), camera, strict=False):
            write_picture(shots / f"{k:02}.png", frame.image)
    rig.close()
    return shots


@pytest.mark.parametrize("count", [3, pytest.param(12, marks=pytest.mark.slow)])
def test_recorded_pictures_are_checked_too(tmp_path: Path, count: int) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(
        f'[camera]\naddress = "files:{recorded(tmp_path, count)}"\n[measure]\nzoi = 32\nroi = "all"\n'
    )
    draft = ConfigDraft(load_config(rig, {}), rig, {})
    with SetupSession(draft, Broadcaster()) as session:
        until(lambda: session.state().get("sigma") is not None)
        session.check.begin()
        until(lambda: session.state()["go"] is not None)
        lines = {line["what"]: line for line in session.state()["lines"]}
        assert lines["load cell"]["value"].startswith("none") and not lines["load cell"]["measured"]
        assert lines["drift"]["measured"] is (count >= 8)
        draft.change_all({"measure.gauges": "given"})
        session.region.set_gauges({"axial": {"kind": "zoi", "at": [-900, 20]}})
        session.check.begin()
        until(lambda: session.state()["go"] is False and not session.state()["checking"])
        assert any("no ZOI is there" in line["value"] for line in session.state()["lines"]), "and why"


def test_a_check_begun_before_the_first_frame_of_a_recording_gets_its_frames(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(f'[camera]\naddress = "files:{recorded(tmp_path, 5)}"\n')
    preview = CameraPreview(
        ConfigDraft(load_config(rig, {}), rig, {}),
        SimpleNamespace(
            opened=lambda info: preview.collect(), show=lambda frame: 0.0, frames_needed=lambda info: 4
        ),
    )
    preview.start()
    try:
        frames: list[Frame] = []
        until(lambda: bool(frames.extend(preview.collected() or []) or frames))
        assert [frame.index for frame in frames] == [0, 1, 2, 3] and not preview.collecting
    finally:
        preview.close()


def test_a_zero_taken_in_the_set_up_holds_in_the_test(at: PageSession) -> None:
    session = at.controller.session
    assert at.change(do="tare").startswith("no: not tared"), "there is no load cell"
    assert at.change(do="untare") == "no: there is no tare to undo"
    assert at.change(do="load", value="sim:?noise_N=0.5") == "ok"
    until(lambda: session.load.state()["rate"] is not None)
    assert session.load.trouble == ""
    until(lambda: at.change(do="tare") == "ok")
    zero = session.draft.config.load.zero_N
    assert 0 < abs(zero) < 5 * 0.5 and "load.zero_N" not in session.draft.changes, (
        "of one test, not of the rig"
    )
    folder = at.rig.parent
    until(lambda: session.region.drawn is not None)
    assert session.ready(folder).load.zero_N == zero
    assert at.change(do="untare") == "ok" and session.draft.config.load.zero_N == 0


@pytest.mark.parametrize(
    "address", ["sim:?width=wide", "a\x00b", "", 3, "x" * 600, "files:/no/such", "/dev/video99", "nonsense:1"]
)
def test_a_bad_address_is_refused_in_words(at: PageSession, address: Any) -> None:
    session = at.controller.session
    before = session.draft.config.camera.address
    answer = at.change(do="address", value=address)
    assert (
        answer.startswith("no: ") and len(answer) > 15 and "defect" not in answer and "Error(" not in answer
    )
    assert session.draft.config.camera.address == before
