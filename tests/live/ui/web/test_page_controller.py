"""The desk: which orders are taken when, and what a page may change; a real camera that is simulated, no browser."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from acquire.events import EventKind
from live.config.loading import Config, load_config
from live.pipeline.run_state import RunState
from live.ui.web.config_draft import ConfigDraft
from live.ui.web.page_controller import PageController
from tests.live.ui.web.test_server import ask

CAMERA = "sim:uniform?width=256&height=192&fps=15&seconds=30"
LONG_S = 60.0


class At:
    """A desk with a rig that is being set up by a thread, as ``phasedic page`` does."""

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
        self.until(lambda: self.controller.session is not None)

    def until(self, holds: Callable[[], bool]) -> None:
        end = time.monotonic() + LONG_S
        while not holds():
            assert time.monotonic() < end
            time.sleep(0.02)

    def post(self, path: str, value: dict[str, Any]) -> str:
        body = json.dumps(value).encode()
        answer = ask(self.controller.server, path, method="POST", body=body)
        return str(json.loads(answer.body)["answer"])

    def order(self, line: str) -> str:
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
def at(tmp_path: Path) -> Iterator[At]:
    found = At(tmp_path)
    yield found
    found.end()


def test_set_up_changed_saved_and_started(at: At, tmp_path: Path) -> None:
    session = at.controller.session
    assert session is not None
    at.until(lambda: session.drawn is not None and bool(session.draft.config.gauges))
    assert set(session.draft.config.gauges) == {"axial", "transverse", "area"}, "placed, as the rig asks for"
    assert at.order("tare").startswith("no:") and at.order("next").startswith("no:")
    assert at.change(do="draw", strokes=[{"tool": "rectangle", "points": [[20, 20], [200, 170]]}]) == "ok"
    assert at.change(do="draw", strokes=[{"tool": "brush", "points": []}]).startswith("no:")
    assert (
        at.change(do="undo") == "ok"
        and at.change(do="all") == "ok"
        and at.change(do="dance").startswith("no:")
    )
    assert at.change(do="draw", strokes=[{"tool": "rectangle", "points": [[20, 20], [30, 30]]}]) == "ok"
    assert at.order("start").startswith("no:"), "no ZOI fits into this"
    assert at.change(do="undo") == "ok"
    assert at.change(do="gauge", name="axial", gauge={"kind": "zoi", "at": [-900, 20]}) == "ok"
    assert "axial" in at.order("start"), "the gauge lies nowhere"
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
    assert at.order("start") == "ok"
    config = at.has_ended()
    assert config is not None and config.output.dir == str(tmp_path / "specimen-1")
    assert at.order("start").startswith("no:"), "it has been started"


def test_a_camera_setting_that_is_refused_leaves_the_camera_as_it_was(at: At) -> None:
    session = at.controller.session
    assert session is not None
    at.until(lambda: session.preview.info is not None)
    assert at.change(do="camera", key="exposure_us", value=3000) == "ok"
    assert session.preview.info is not None and session.preview.info.exposure_s == pytest.approx(3e-3)
    before = session.draft.config.camera.address
    assert at.change(do="camera", key="exposure_us", value=1e9).startswith("no:")
    assert at.change(do="camera", key="format", value=1).startswith("no:")
    assert session.draft.config.camera.address == before
    at.until(lambda: len(session.preview.recent()) > 2)


class Run:
    """A run that takes orders, and has nothing behind it."""

    paused = False

    def __init__(self) -> None:
        self.heard: list[str] = []
        self.run_state = RunState.new(0.5)

    def stop(self, reason: str) -> None:
        self.heard.append("quit")

    def command(self, kind: EventKind, note: str = "") -> str:
        self.heard.append(f"{kind} {note}".strip())
        return ""


def test_orders_during_a_run_and_after(at: At) -> None:
    at.controller.quit()
    assert at.has_ended() is None
    at.controller.begin(load_config(None, {}))
    assert at.order("tare") == "no: the test is being opened"
    run: Any = Run()
    at.controller.attach(run)
    assert at.order("tare") == "ok" and at.order("note a b") == "ok" and at.order("quit") == "ok"
    assert at.order("fly").startswith("no:") and at.post("/order", {"line": 3}).startswith("no:")
    assert run.heard == ["tare", "note a b", "quit"]
    assert at.change(do="all") == "no: nothing is set up now"
    assert at.post("/map", {"of": "e1"}) == "ok" and at.post("/map", {"of": "x"}).startswith("no:")
    opened: list[int] = []
    at.controller.viewer = lambda port: opened.append(port) or "ok"  # type: ignore[func-returns-value]
    assert at.post("/viewer", {}).startswith("no:"), "the view does not serve yet"
    run.run_state.health.view_port = 9999
    assert at.post("/viewer", {}) == "ok" and opened == [9999]
    at.controller.end({"figures": []})
    assert at.post("/viewer", {}).startswith("no:") and opened == [9999], "the view ends with the run"
    assert at.order("tare").startswith("no:") and at.order("next") == "ok"
    assert at.controller.after()
    assert at.controller.draft is not None and at.controller.draft.config.metadata["specimen"] == "specimen-2"
