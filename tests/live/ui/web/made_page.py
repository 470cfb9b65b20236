"""The page in a browser without a program: its files, made-up states, and what it sends."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from live.ui.web.map_view import as_jpeg
from live.ui.web.setup.config_draft import kinds_of_devices
from live.words.language import entries
from tests.live.ui.web.browser import Page
from tests.live.ui.web.made_up import KINDS, setup_state
from tests.live.ui.web.page_texts import STATIC

ADDRESS = "http://made.test/"
SOURCE = """window.EventSource = class { constructor() { this.heard = {}; window.made = this; }
    addEventListener(kind, hear) { this.heard[kind] = hear; } close() {} };
    const [fetched, sent] = [window.fetch, []];
    window.answers = [];
    window.taken = () => sent.splice(0);
    window.fetch = (path, options) => {
      if (options?.method !== "POST") return fetched(path, options);
      sent.push(JSON.parse(options.body));
      return Promise.resolve(new Response(JSON.stringify(window.answers.shift() ?? { text: "", refused: false })));
    };
    window.emit = (kind, value) => window.made.heard[kind]({ data: JSON.stringify(value) });
    setInterval(() => window.made?.heard.beat?.({ data: "{}" }), 500);"""
TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}
STAGE = {"n": 1, "words": "", "alone": False, "components": ["exx", "eyy"], "kinds": KINDS}
WIDTH, HEIGHT = 640, 480


def set_up(**changed: Any) -> dict[str, Any]:
    """A state of the set-up: a camera of 640 x 480 px, a region, a line from 200, 100 to 200, 300."""
    ends = [[200, 100], [200, 300]]
    camera = {"name": "a camera", "width": WIDTH, "height": HEIGHT, "bits": 8, "fps": 20.0, "sliders": [],
              "formats": [], "format": "", "rates": [], "warnings": []}  # fmt: skip
    return setup_state() | {
        "camera": camera, "address": "sim:?fps=20", "picture": 1, "can": ["undo"], "zois": 100, "saturated": 0.0,
        "region": {"words": "as drawn", "box": [0, 0, 9, 9], "edition": 1}, "scale": {"px_per_mm": None, "sigma": None},
        "gauges": {"axial": {"kind": "line", "colour": 2, "handles": ends, "outline": [ends]}},
        "measure": {"zoi": 64, "step": 16, "burst": 8}, "go": None, "lines": [], "table": None, **changed,
    }  # fmt: skip


class MadePage(Page):
    """The page with states of ``emit``."""

    def __init__(self, browser: Any, language: str = "en", **wanted: Any) -> None:
        context = browser.new_context(viewport={"width": 1280, "height": 800}, locale=language, **wanted)
        super().__init__(context.new_page())
        self.page.add_init_script(SOURCE)
        self.page.route(f"{ADDRESS}**", self._answer)
        self.page.goto(ADDRESS)
        self.page.wait_for_function("window.made?.heard.stage && document.body.dataset.stage === 'opening'")

    def _answer(self, route: Any) -> None:
        path = route.request.url.removeprefix(ADDRESS).partition("?")[0] or "static/index.html"
        if path.startswith("static/"):
            file = STATIC / path.removeprefix("static/")
            route.fulfill(body=file.read_bytes(), content_type=TYPES.get(file.suffix, "text/plain"))
        elif path.startswith("words/"):
            route.fulfill(body=json.dumps(dict(entries(path[6:8]))), content_type="application/json")
        elif path == "settings.json":
            route.fulfill(body=json.dumps(kinds_of_devices()), content_type="application/json")
        else:
            grey = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
            route.fulfill(body=as_jpeg(grey), content_type="image/jpeg")

    def emit(self, kind: str, value: dict[str, Any]) -> None:
        """As if the program had sent it."""
        self.page.evaluate("([kind, value]) => window.emit(kind, value)", [kind, value])

    def set_up(self, **changed: Any) -> None:
        """Show a state of the set-up, entering that stage where it is not shown."""
        if self.stage() != "setup":
            self.emit("stage", {"stage": "setup", **STAGE})
        self.emit("setup", set_up(**changed))

    def answer(self, text: str, *, refused: bool = True) -> None:
        """What the next request is answered."""
        self.page.evaluate("(answer) => window.answers.push(answer)", {"text": text, "refused": refused})

    def sent(self) -> list[dict[str, Any]]:
        """What was posted since the last call."""
        return [one for one in self.page.evaluate("() => window.taken()") if one.get("do") != "devices"]
