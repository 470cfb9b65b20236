"""The stages of the page: set-up, run, after, and again; what each shows, and which commands it accepts.

A command is the same line from the page as from the keyboard (``live.run.control``). Before and after a test there
are ``start``, ``next``, ``again`` and ``quit``. The page names the stage it shows, so that a press that comes late
does nothing in the next one.
"""

from __future__ import annotations

import queue
import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from acquire.errors import PhasedicError
from acquire.text import Message
from acquire.text.message import brief, printable
from analysis.evaluate import GAUGE_KINDS
from live.config.loading import Config
from live.config.new_files import free_name
from live.run.control import ONCE, Answer, carry_out, refusal
from live.ui.web.authorization import HttpError
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.map_view import as_png, map_choices
from live.ui.web.page_consumer import PageConsumer
from live.ui.web.page_consumers import PageConsumers
from live.ui.web.run_result import peaks
from live.ui.web.server import DEFAULT_PORT, REPORT_POLICY, PageServer, Response, jpeg_response
from live.ui.web.setup.config_draft import ConfigDraft, drafts_of, next_name
from live.ui.web.setup.draft_changes import CHANGES
from live.ui.web.setup.setup_session import SetupSession, SetupSessions
from live.ui.web.setup.specimen_region import DrawnRegion

if TYPE_CHECKING:
    from live.run.live_run import LiveRun

SET_UP, RUN, AFTER = "setup", "run", "after"
START, NEXT, AGAIN, QUIT = "start", "next", "again", "quit"
FIRST = "specimen-1"
GOODBYE_S = 0.5
OUTLINE = 500  # points of the specimen before


class PageController:
    """The page and its server.

    Parameters
    ----------
    draft : ConfigDraft or None
        None: there is no set-up, the page only shows a run.
    port : int

    Attributes
    ----------
    stage : str
    sessions : SetupSessions or None
        During set-up.
    others : list of Config
        Of the further cameras of the test that ``set_up`` has begun.
    server : PageServer
    viewer : callable
        Opens a viewer at the port of the view; returns the answer for the page.
    """

    def __init__(self, draft: ConfigDraft | None, port: int = DEFAULT_PORT) -> None:
        self.draft = draft
        self.stage = RUN if draft is None else SET_UP
        self.sessions: SetupSessions | None = None
        self.others: list[Config] = []
        self._drafts: Mapping[str, ConfigDraft] = {}
        self._drawn: Mapping[str, DrawnRegion] = {}
        self._broadcaster = Broadcaster()
        self._consumers = PageConsumers(self._broadcaster, {}, {})
        self._live: LiveRun | None = None
        self._report: Path | None = None
        self._result: dict[str, Any] = {}
        self._stages, self._last_pictures = 0, dict[str, bytes]()
        self._requests: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._folder = TemporaryDirectory(prefix="phasedic-")
        self._message = ""
        self._what: dict[str, Any] | None = None
        self._before: dict[str, Any] | None = None
        self._maps: tuple[str, ...] = ()
        self.viewer: Callable[[int], Answer] = lambda port: refusal("there is no viewer here")
        gets = {
            "/points": lambda query: self._consumers.points(query),
            "/picture": self._picture,
            "/mask": self._mask,
            "/value": lambda query: self._consumers.value(query),
            "/report": self._show_report,
        }
        posts = {
            "/order": self._command,
            "/setup": self._change,
            "/map": lambda request: self._consumers.select_map(request),
            "/viewer": self._viewer,
        }
        self.server = PageServer(self._broadcaster, gets, posts, port)
        self._publish_stage()

    def __enter__(self) -> PageController:
        return self

    def __exit__(self, *_: object) -> None:
        self._broadcaster.publish("gone", True)  # a separate kind: it must not replace the last stage
        threading.Event().wait(GOODBYE_S)
        self.server.close()
        self._folder.cleanup()

    @property
    def address(self) -> str:
        """The address that a person opens in a browser."""
        return self.server.address

    @property
    def session(self) -> SetupSession | None:
        """The set-up of the first camera; None outside it."""
        return None if self.sessions is None else self.sessions.first

    def quit(self) -> None:
        """End the set-up, or the stage after a test."""
        self._requests.put(QUIT)

    # -- the stages ---------------------------------------------------------------------------

    def set_up(self, message: str = "") -> Config | None:
        """Set up the rig until a test is started; its configuration, or None to quit.

        Parameters
        ----------
        message : str
            A message to the operator, such as why the last test did not begin.
        """
        assert self.draft is not None
        if not self.draft.config.metadata.get("specimen"):
            self.draft.change_all({"metadata.specimen": self._free_name(FIRST)})
        self._drafts = self._drafts or drafts_of(self.draft)
        with SetupSessions(self._drafts, self._broadcaster, self._drawn) as sessions:
            self.sessions = sessions
            self._enter(SET_UP, message)
            started = self._requests.get() == START
        self.sessions, self._drawn, self._last_pictures = None, sessions.drawn, sessions.pictures
        return self._to_run(sessions) if started else None

    def _to_run(self, sessions: SetupSessions) -> Config:
        config, *self.others = sessions.configs(Path(self._folder.name))
        wanted = self._folder_of(str(config.metadata["specimen"]))
        name = free_name(wanted.name, lambda name: wanted.with_name(name).exists(), "_")
        return replace(config, output=replace(config.output, dir=str(wanted.with_name(name))))

    def _folder_of(self, name: str) -> Path:
        """The folder for the files of a specimen."""
        assert self.draft is not None
        folder = re.sub(r"[^\w.-]+", "_", name).strip("._-")[:80]
        return Path(self.draft.config.output.dir or "runs") / (folder or FIRST)

    def _free_name(self, name: str) -> str:
        """The first name from ``name`` on whose folder does not exist."""
        while self._folder_of(name).exists():
            name = next_name(name)
        return name

    def begin(self, configs: Mapping[str, Config]) -> Mapping[str, PageConsumer]:
        """Begin the stage of a run with these cameras, by name; the consumers of their data."""
        config = next(iter(configs.values()))
        what = _described(config)
        self._before, self._what, self._maps = self._outline(what), what, map_choices(config)
        self._consumers, self._live = PageConsumers(self._broadcaster, configs, self._last_pictures), None
        self._enter(RUN, "")
        return self._consumers.by_name

    def _outline(self, what: Mapping[str, Any]) -> dict[str, Any] | None:
        """The curve of the specimen before; None where nothing was measured, or where it was of another material."""
        before = self._consumers.first
        is_same = self._what is not None and self._what["material"] == what["material"]
        if before is None or self._what is None or not (is_same and before.curve.position[1]):
            return None
        return before.curve.outline(OUTLINE) | {"specimen": self._what["specimen"]}

    def attach(self, live: LiveRun) -> None:
        """Pass commands to ``live`` from now on, and show it."""
        self._live = live
        self._consumers.attach(live)

    def end(self, result: Mapping[str, Any]) -> None:
        """Begin the stage after the run and show its ``result``."""
        self._live, self._report = None, None
        self._result = {**peaks(self._consumers.by_name), **result, "report": None, **self._names()}
        self._broadcaster.publish("after", self._result)
        self._enter(AFTER, "")
        if self.draft is None:
            self.reported(None, Message("this run makes no report; phasedic report makes one of its folder"))

    def _names(self) -> dict[str, str | None]:
        """The names of this specimen and of the next one; None where no other test follows."""
        if self.draft is None:
            return {"again": None, "next": None}
        name = str(self.draft.config.metadata.get("specimen", FIRST))
        return {"again": name, "next": self._free_name(next_name(name))}

    def reported(self, report: Path | None, why: str = "") -> None:
        """Show that the report of the last run can be opened, or (None) why there is none."""
        self._report = report
        self._result |= {
            "report": True if report is not None else printable(why) or Message("no report was made")
        }
        self._broadcaster.publish("after", self._result)

    def after(self) -> bool:
        """Wait for the operator; whether another test follows, of the next specimen or of the same."""
        assert self.draft is not None
        request = self._requests.get()
        if request == NEXT:
            self.draft.change_all({"metadata.specimen": self._result["next"]})
        return request in (NEXT, AGAIN)

    def _enter(self, stage: str, message: str) -> None:
        self.stage, self._message = stage, printable(message)
        self._stages += 1
        self._requests = queue.SimpleQueue()
        self._publish_stage()

    def _publish_stage(self) -> None:
        stage = {
            "stage": self.stage,
            "n": self._stages,
            "words": self._message,
            "alone": self.draft is None,
            "cameras": [*(self._consumers if self.sessions is None else self.sessions).by_name] or [""],
            "what": self._what,
            "before": self._before if self.stage == RUN else None,
        }
        kinds = [
            {"kind": name, "label": one.label, "hint": one.hint, "gesture": one.gesture}
            for name, one in GAUGE_KINDS.items()
        ]
        self._broadcaster.publish("stage", stage | {"components": self._maps, "kinds": kinds})

    # -- requests of the page -----------------------------------------------------------------

    def _picture(self, query: Mapping[str, str]) -> Response:
        sessions = self.sessions
        if sessions is None:
            picture = self._consumers.picture(query)
        else:
            picture = sessions.of(query.get("side")).picture
        if picture:
            return (
                Response(picture, "image/png") if picture.startswith(b"\x89PNG") else jpeg_response(picture)
            )
        return Response(as_png(np.zeros((1, 1, 4), np.uint8)), "image/png")  # nothing is seen

    def _mask(self, query: Mapping[str, str]) -> Response:
        sessions = self.sessions
        if sessions is None:
            raise HttpError(404, Message("nothing is set up"))
        return Response(sessions.of(query.get("side")).region.shade(), "image/png")

    def _show_report(self, query: Mapping[str, str]) -> Response:
        if self._report is None:
            raise HttpError(404, Message("there is no report yet"))
        return Response(self._report.read_bytes(), "text/html; charset=utf-8", REPORT_POLICY)

    def _viewer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Open the viewer at the actual port of the view, which may differ from the configured one."""
        port = None if self._live is None else self._live.run_state.health.view_port
        if port is None:
            why = refusal("the view is switched off or not ready yet; after a test open its view.rrd")
            return why._asdict()
        return self.viewer(port)._asdict()

    def _command(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Run a command line."""
        line, stage = request.get("line"), request.get("stage", self.stage)
        if not isinstance(line, str):
            return refusal("a command is a line")._asdict()
        if stage != self.stage:
            return refusal("the stage has changed meanwhile; press again")._asdict()
        return self._answer_to(line)._asdict()

    def _answer_to(self, line: str) -> Answer:
        live, command = self._live, line.strip()
        if live is not None:
            # Two pages must not confirm one another: the page that asks forces the tare.
            return carry_out(f"{command} {ONCE}" if command in ("t", "tare") else line, live)
        if self.stage == RUN or (self.stage == SET_UP and self.sessions is None):
            return refusal("the test is being opened")
        allowed = (START, QUIT) if self.stage == SET_UP else (NEXT, AGAIN, QUIT)
        if command not in allowed or self.draft is None:
            return refusal("the commands of this stage are {allowed}", ", ".join(allowed))
        try:
            if command == START and self.sessions is not None:
                self.sessions.ready(Path(self._folder.name))
        except PhasedicError as error:
            return refusal(printable(brief(error)))
        self._requests.put(command)
        return Answer()

    def _change(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Run a change of the set-up."""
        sessions, do = self.sessions, str(request.get("do"))
        if sessions is None:
            return refusal("nothing is set up now")._asdict()
        change, of_all = CHANGES.get(do), {"check": sessions.check, "save": sessions.save}
        if change is None and do not in of_all:
            return refusal("the changes are {allowed}", ", ".join((*CHANGES, *of_all)))._asdict()
        try:
            if change is None:
                of_all[do]()
            else:
                change(sessions.of(request.get("side")), request)
        except PhasedicError as error:
            return refusal(printable(brief(error)))._asdict()
        sessions.refresh()
        return Answer()._asdict()


def _described(config: Config) -> dict[str, Any]:
    """The specimen of a test, as the head of the page names it."""
    specimen, names = config.specimen, config.metadata
    return {
        "specimen": str(names.get("specimen", "")),
        "material": str(names.get("material", "")),
        "width_mm": specimen.width_mm,
        "thickness_mm": specimen.thickness_mm,
        "diameter_mm": specimen.diameter_mm,
        "area_mm2": None if specimen.area_m2 is None else specimen.area_m2 * 1e6,
        "along": f"e{2 * specimen.first_axis}",
    }
