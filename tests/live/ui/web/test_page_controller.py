"""The stages of the page: accepted commands and changes; with a simulated camera, without a browser."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from acquire.events import EventKind
from live.config.loading import Config, load_config
from live.pipeline.run_state import RunState
from live.ui.web.config_draft import ConfigDraft
from live.ui.web.page_controller import PageController
from tests.live.ui.waiting import LONG_S, until
from tests.live.ui.web.test_server import fetch

CAMERA = "sim:uniform?width=256&height=192&fps=15&seconds=30"


class PageSession:
    """A page controller with a rig, set up by a thread as ``phasedic page`` does it."""

    def __init__(self, folder: Path) -> None:
        self.rig = folder / "rig.toml"
        self.rig.write_text(
            f'# bench 3\n[camera]\naddress = "{CAMERA}"\n[measure]\nzoi = 32\ngauges = "auto"\n'
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
        return str(json.loads(answer.body)["answer"])

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
    assert session is not None
    until(lambda: session.drawn is not None and bool(session.draft.config.gauges))
    assert set(session.draft.config.gauges) == {"axial", "transverse", "area"}, "placed, as the rig asks for"
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
    assert at.change(do="gauge", name="axial", gauge={"kind": "zoi", "at": [-900, 20]}) == "ok"
    assert "axial" in at.command("start"), "the gauge lies nowhere"
    assert at.change(do="place") == "ok"
    assert at.change(do="gauge", name="tip", was="area", gauge={"kind": "zoi", "at": [100, 90]}) == "ok"
    assert at.change(do="gauge", name="tip", was="axial", gauge={"kind": "zoi", "at": [1, 1]}).startswith(
        "no:"
    )
    assert at.change(do="gauge", kind="line", points=[[50.04, 40], [50, 120]]) == "ok"
    assert at.change(do="gauge", name="axial2", points=[[60, 40], [60, 130]]) == "ok", "moved by its handles"
    assert at.change(do="gauge", name="long", was="axial2") == "ok"
    assert session.draft.config.gauges["long"] == {"kind": "line", "start": (60, 40), "end": (60, 130)}
    drawn = session.state()["gauges"]["long"]
    assert drawn["handles"] == ((60, 40), (60, 130)) and drawn["outline"][0] == [(60, 40), (60, 130)]
    for wrong in (
        {"kind": "spiral"},
        {"kind": ["line"]},
        {"points": [[1, "a"]]},
        {"points": []},
        {"points": None},
    ):
        assert at.change(do="gauge", **{"kind": "line", "points": [[1, 2], [3, 4]], **wrong}).startswith(
            "no:"
        )
    assert at.change(do="gauge", name="long", was=["axial"], gauge=3).startswith("no:")
    assert at.change(do="gauge", name="long", gauge=None) == "ok"
    assert at.change(do="set", key="measure.zoi", value=4).startswith("no:")
    assert at.change(do="set", key="output.dir", value="/").startswith("no:")
    assert at.change(do="scale", points=[[10, 10], [110, 10]], mm=5) == "ok"
    assert at.change(do="scale", points=[[10, 10], [10, 10]], mm=5).startswith("no:")
    assert at.change(do="scale", points=[[10, 10], [110, 10**400]], mm=5).startswith("no:")
    assert at.change(do="scale", points=[[10, 10], [110, 10]], mm=True) == "no: a distance is a number"
    board = {"do": "board", "columns": 5, "rows": 4}
    assert at.change(**board, square=-1) == "no: a square in mm is a number from 0 to 100000"
    assert at.change(do="overlay", name="quality", on=True) == "ok"
    assert at.change(do="save") == "ok"
    saved = load_config(at.rig, {})
    assert saved.output.dir is None, "where the files go today is not of the rig"
    assert "# bench 3" in at.rig.read_text() and set(saved.gauges) == {"axial", "transverse", "tip"}
    assert saved.scale.px_per_mm == pytest.approx(20) and saved.measure.roi is not None
    assert at.command("start") == "ok"
    config = at.has_ended()
    assert config is not None and config.output.dir == str(tmp_path / "specimen-1")
    assert at.command("start").startswith("no:"), "it has been started"


def test_a_camera_setting_that_is_refused_leaves_the_camera_as_it_was(at: PageSession) -> None:
    session = at.controller.session
    assert session is not None
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

    def stop(self, reason: str) -> None:
        self.received.append("quit")

    def command(self, kind: EventKind, note: str = "") -> str:
        self.received.append(f"{kind} {note}".strip())
        return ""


def test_commands_during_a_run_and_after(at: PageSession) -> None:
    at.controller.quit()
    assert at.has_ended() is None
    at.controller.begin(load_config(None, {}))
    assert at.command("tare") == "no: the test is being opened"
    run: Any = Run()
    at.controller.attach(run)
    assert at.command("tare") == "ok" and at.command("note a b") == "ok" and at.command("quit") == "ok"
    assert at.command("fly").startswith("no:") and at.post("/order", {"line": 3}).startswith("no:")
    assert run.received == ["tare", "note a b", "quit"]
    assert at.change(do="all") == "no: nothing is set up now"
    assert at.post("/map", {"of": "e1"}) == "ok" and at.post("/map", {"of": "x"}).startswith("no:")
    opened: list[int] = []
    at.controller.viewer = lambda port: opened.append(port) or "ok"  # type: ignore[func-returns-value]
    assert at.post("/viewer", {}).startswith("no:"), "the view does not serve yet"
    run.run_state.health.view_port = 9999
    assert at.post("/viewer", {}) == "ok" and opened == [9999]
    at.controller.end({"figures": []})
    assert at.post("/viewer", {}).startswith("no:") and opened == [9999], "the view ends with the run"
    assert at.command("tare").startswith("no:") and at.command("next") == "ok"
    assert at.controller.after()
    assert at.controller.draft is not None and at.controller.draft.config.metadata["specimen"] == "specimen-2"
