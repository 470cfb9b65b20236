"""The stages of the page without a browser, and one test after the other."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.errors import EXIT_INTERRUPTED, LOSS, DataError, DeviceError
from acquire.text.message import from_json
from live.commands import page as page_command
from live.commands.run import finish
from live.config.loading import load_config
from live.pipeline.consumer import Screen
from live.ui.web import page_controller
from live.ui.web.authorization import HttpError
from live.ui.web.page_controller import PageController
from live.ui.web.setup.config_draft import ConfigDraft
from tests.live.screens import RecordingScreen


@pytest.fixture
def at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[PageController]:
    """A page whose set-up is not open."""
    monkeypatch.setattr(page_controller, "GOODBYE_S", 0.0)
    rig = tmp_path / "rig.toml"
    rig.write_text('[camera]\naddress = "sim:"\n')
    given = {"output.dir": str(tmp_path / "runs")}
    with PageController(ConfigDraft(load_config(rig, given), rig, given), 0) as controller:
        yield controller


def published(controller: PageController, kind: str) -> Any:
    return json.loads(controller._broadcaster._newest[kind])


def test_a_specimen_has_a_folder_of_its_name(at: PageController, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    for name, folder in (
        ("bar 7/µ", "bar_7_µ"),
        ("../..", "specimen-1"),
        ("x" * 99, "x" * 80),
        ("_a.b-", "a.b"),
    ):
        assert at._folder_of(name) == runs / folder, name
    (runs / "bar-1").mkdir(parents=True)
    (runs / "bar-2").mkdir()
    assert at._free_name("bar-1") == "bar-3" and at._free_name("bar-7") == "bar-7"
    config = load_config(None, {"metadata.specimen": "bar-1"})
    sessions: Any = SimpleNamespace(configs=lambda folder: [config, "another"])
    assert at._to_run(sessions).output.dir == str(runs / "bar-1_2") and at.others == ["another"]
    sessions.configs = lambda folder: [load_config(None, {"metadata.specimen": "bar-9"})]
    assert at._to_run(sessions).output.dir == str(runs / "bar-9") and at.others == []


def test_each_stage_has_its_commands(at: PageController) -> None:
    assert at._answer_to("start").line == "no: the test is being opened", "the set-up is not open"
    asked: list[Any] = []
    at.sessions = SimpleNamespace(ready=asked.append)  # type: ignore[assignment]
    assert (
        at._answer_to(" start ").line == "ok"
        and asked == [Path(at._folder.name)]
        and at._requests.get(timeout=1) == "start"
    )
    assert at._answer_to("next").line == "no: the commands of this stage are start, quit"

    def refuses(folder: Path) -> None:
        raise DataError("no ZOI\x1b lies in the region")

    at.sessions.ready = refuses  # type: ignore[assignment, method-assign, union-attr]
    answer = at._answer_to("start").line
    assert answer.startswith("no: no ZOI") and "\x1b" not in answer and at._requests.empty()
    at.sessions = None
    at.end({"figures": [1]})
    assert at._answer_to("start").line == "no: the commands of this stage are next, again, quit"
    for command, follows in (("next", True), ("again", True), ("quit", False)):
        assert at._answer_to(command).line == "ok" and at.after() is follows
    assert at._command({"line": "quit", "stage": "run"})["text"].startswith("the stage has changed")
    assert at._command({"line": None})["text"] == "a command is a line"


def test_the_next_specimen_and_the_same_again(at: PageController, tmp_path: Path) -> None:
    at.draft.change_all({"metadata.specimen": "bar-009"})
    (tmp_path / "runs" / "bar-010").mkdir(parents=True)
    at.end({"figures": []})
    after = published(at, "after")
    assert (after["again"], after["next"], after["report"]) == ("bar-009", "bar-011", None)
    at._requests.put("again")
    assert at.after() and at.draft.config.metadata["specimen"] == "bar-009"
    at._requests.put("next")
    assert at.after() and at.draft.config.metadata["specimen"] == "bar-011"


def test_the_report_is_shown_once_there_is_one(at: PageController, tmp_path: Path) -> None:
    with pytest.raises(HttpError) as refused:
        at._show_report({})
    assert refused.value.status == 404
    at.end({"figures": []})
    for why, told in (("a full disk\x07", "a full disk"), ("", "no report was made")):
        at.reported(None, why)
        assert from_json(published(at, "after")["report"]).startswith(told)
    (tmp_path / "report.html").write_bytes(b"<html>")
    at.reported(tmp_path / "report.html")
    assert published(at, "after")["report"] is True
    response = at._show_report({})
    assert (response.content, response.kind) == (
        b"<html>",
        "text/html; charset=utf-8",
    ) and "sandbox" in response.policy
    at.end({"figures": []})
    with pytest.raises(HttpError):
        at._show_report({})


def test_pictures_and_masks_of_the_set_up(at: PageController) -> None:
    empty = at._picture({})
    assert empty.kind == "image/png" and cv2.imdecode(np.frombuffer(empty.content, np.uint8), 0).tolist() == [
        [0]
    ]
    with pytest.raises(HttpError):
        at._mask({})
    shown = SimpleNamespace(picture=b"a jpeg", region=SimpleNamespace(shade=lambda: b"a png"))
    asked: list[Any] = []
    at.sessions = SimpleNamespace(of=lambda side: asked.append(side) or shown)  # type: ignore[assignment, func-returns-value]
    assert (at._picture({"side": "back"}).content, at._picture({}).kind) == (b"a jpeg", "image/jpeg")
    assert at._mask({"side": "back"}).content == b"a png" and asked == ["back", None, "back"]
    at.sessions = None


def test_changes_are_of_the_camera_that_is_named(at: PageController, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[Any] = []
    monkeypatch.setitem(page_controller.CHANGES, "undo", lambda session, request: done.append(session))
    sessions: Any = SimpleNamespace(
        of=lambda side: f"session {side}", check=lambda: done.append("check"), save=lambda: done.append("save"),
        refresh=lambda: done.append("refresh"),
    )  # fmt: skip
    at.sessions = sessions
    for request in ({"do": "undo", "side": "back"}, {"do": "check"}, {"do": "save"}):
        assert not at._change(request)["refused"]
    assert done == ["session back", "refresh", "check", "refresh", "save", "refresh"]
    assert at._change({"do": "fly"})["text"].startswith("the changes are draw, ")

    def fails() -> None:
        raise DataError("not possible")

    sessions.save = fails
    assert at._change({"do": "save"})["text"] == "not possible" and len(done) == 6
    at.sessions = None


def test_a_page_of_a_run_alone_makes_no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_controller, "GOODBYE_S", 0.0)
    with PageController(None, 0) as alone:
        assert alone.stage == "run" and published(alone, "stage")["alone"] is True
        assert alone._answer_to("start").line == "no: the test is being opened"
        alone.end({"figures": []})
        after, stage = published(alone, "after"), published(alone, "stage")
        assert (after["again"], after["next"]) == (None, None) and "makes no report" in from_json(
            after["report"]
        )
        assert stage["stage"] == "after" and stage["n"] == 1
        assert alone._answer_to("next").refused


# -- test after test ------------------------------------------------------------------------------


class Controller:
    """A page that is set up so often, and then ended."""

    def __init__(self, times: int, follows: bool = True) -> None:
        self.left, self.follows = times, follows
        self.messages: list[str] = []
        self.reports: list[tuple[Path | None, str]] = []

    def set_up(self, message: str) -> str | None:
        self.messages.append(message)
        self.left -= 1
        return "a config" if self.left >= 0 else None

    def reported(self, report: Path | None, why: str) -> None:
        self.reports.append((report, why))

    def after(self) -> bool:
        return self.follows


def served(
    monkeypatch: pytest.MonkeyPatch, controller: Controller, folder: Path, codes: list[Any], made: bool
) -> threading.Event:
    interrupted = threading.Event()

    def run(*_: Any) -> tuple[Path, int]:
        code = codes.pop(0)
        if isinstance(code, Exception):
            raise code
        return folder, code

    def written(place: Path, screen: Screen) -> str:
        if made:
            (place / "report.html").touch()
        return "" if made else "why not"

    monkeypatch.setattr(page_command, "run_with_page", run)
    monkeypatch.setattr(page_command, "camera_configs", lambda config, given, others: {"": config})
    controller.others = []  # type: ignore[attr-defined]
    monkeypatch.setattr(page_command, "write_report", written)
    page_command.serve(controller, {}, RecordingScreen(), interrupted)  # type: ignore[arg-type]
    return interrupted


def test_one_test_after_the_other_with_its_report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    controller = Controller(3)
    stopped = served(monkeypatch, controller, tmp_path, [0, DataError("no camera"), 5], True)
    assert controller.messages == ["", "", "no camera", ""]
    assert controller.reports == [(tmp_path / "report.html", "")] * 2 and not stopped.is_set()
    last = Controller(5, follows=False)
    (tmp_path / "report.html").unlink()
    served(monkeypatch, last, tmp_path, [0], False)
    assert last.reports == [(None, "why not")] and len(last.messages) == 1


def test_without_a_camera_the_page_opens_with_what_there_is(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    draft, said = ConfigDraft(load_config(None, {}), tmp_path / "rig.toml", {}), RecordingScreen()

    def nothing(given: dict[str, object], screen: Screen) -> None:
        raise DeviceError("no camera can be used (none is plugged in)")

    monkeypatch.setattr(page_command, "find_devices", nothing)
    page_command.choose_devices(draft, {}, said)
    assert not draft.config.camera.address and "or choose one on the page" in said.lines[0]
    found = SimpleNamespace(camera="sim:", load="none:")
    monkeypatch.setattr(page_command, "find_devices", lambda given, screen: found)
    page_command.choose_devices(draft, {}, said)
    assert (draft.config.camera.address, draft.config.load.address) == ("sim:", "none:")


def test_an_interrupted_test_ends_the_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    controller = Controller(3)
    assert served(monkeypatch, controller, tmp_path, [EXIT_INTERRUPTED], True).is_set()
    assert len(controller.messages) == 1 and controller.reports == []


@pytest.mark.parametrize(
    ("code", "fails", "found"), [(0, False, 0), (0, True, LOSS), (130, True, 130), (130, False, 130)]
)
def test_two_cameras_are_put_together_at_the_end(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, code: int, fails: bool, found: int
) -> None:
    screen, joined = RecordingScreen(), list[Any]()

    def put(*given: Any) -> None:
        joined.append(given[:3])
        if fails:
            raise DataError("not of one test")

    def summary(screen: Screen, *given: Any, **named: Any) -> None:
        assert not named["with_report"], "there is one report, of all cameras"
        screen.print("a summary")

    monkeypatch.setattr("live.commands.consumers.put_together", put)
    monkeypatch.setattr("live.commands.consumers.print_summary", summary)
    monkeypatch.setattr("live.commands.run.trouble_lines", lambda *_, **named: [])
    monkeypatch.setattr(
        "live.commands.report.write_report", lambda folder, screen: screen.print(f"report {folder}")
    )
    side: Any = SimpleNamespace(run_state=None, test=None, outputs=SimpleNamespace(reports=()), folder=tmp_path,
                                config=SimpleNamespace(specimen=None, output=SimpleNamespace(report=True)))  # fmt: skip
    (tmp_path / "figures.json").touch()
    outcome: Any = SimpleNamespace(folder=tmp_path, exit_code=code, cameras={"front": side, "back": side})
    assert finish(outcome, screen) == found
    assert joined == [(tmp_path / "front", tmp_path / "back", tmp_path / "strain.csv")]
    assert (
        screen.lines[:3] == ["front: a summary", "back: a summary", ""]
        and f"report {tmp_path}" in screen.lines
    )
    assert any("were not put together: not of one test" in line for line in screen.lines) is fails
    assert (f"exit code {found}: " in screen.lines[-1]) is bool(found)
    outcome.cameras = {"first": side, "second": side}
    assert finish(outcome, screen) == code and len(joined) == 1, "fields are not put together"
