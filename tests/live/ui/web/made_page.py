"""The page in a browser without a program: its files, made-up states, and what it sends."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from live.ui.web.map_view import as_jpeg
from live.ui.web.setup.config_draft import kinds_of_devices
from live.words.language import entries
from tests.live.ui.web.browser import Page
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
KINDS = [
    {"kind": "line", "label": "Line", "hint": "Drag a line.", "gesture": "line"},
    {"kind": "area", "label": "Area", "hint": "Drag a box.", "gesture": "box"},
    {"kind": "zoi", "label": "Point", "hint": "Click a place.", "gesture": "click"},
]
STAGE = {"n": 1, "words": "", "alone": False, "components": ["exx", "eyy"], "kinds": KINDS}
WIDTH, HEIGHT = 640, 480


def set_up(**changed: Any) -> dict[str, Any]:
    """A state of the set-up: a camera of 640 x 480 px, a region, a line from 200, 100 to 200, 300."""
    line = {
        "kind": "line",
        "colour": 2,
        "handles": [[200, 100], [200, 300]],
        "outline": [[[200, 100], [200, 300]]],
    }
    return {
        "side": "", "trouble": "", "doubt": "", "busy": "", "sharpness": 0.3, "peak": 0.3, "saturated": 0.0,
        "sigma": 1e-4,
        "camera": {"name": "a camera", "width": WIDTH, "height": HEIGHT, "bits": 8, "fps": 20.0, "sliders": [],
                   "formats": [], "format": "", "rates": [], "warnings": []},
        "region": {"words": "as drawn", "box": [0, 0, 9, 9], "edition": 1}, "zois": 100, "file": "rig.toml",
        "unsaved": [], "picture": 1, "gauges": {"axial": line}, "plates": {}, "can": ["undo"], "remarks": [],
        "measure": {"zoi": 64, "step": 16, "burst": 8}, "overlays": {"saturated": True, "quality": False},
        "specimen": {"width_mm": 20.0, "thickness_mm": 1.5, "diameter_mm": None, "gauge_length_mm": None,
                     "axis": "auto", "area_mm2": 30.0},
        "metadata": {"specimen": "bar-6"}, "scale": {"px_per_mm": None, "sigma": None}, "address": "sim:?fps=20",
        "devices": {"cameras": [], "loads": [], "finding": ""}, "checking": False, "go": None, "lines": [],
        "table": None,
        "load": {"address": "sim:", "name": "a cell", "trouble": "", "force_N": 1.0, "noise_N": 0.5, "rate": 80.0,
                 "zero_N": 0.0},
        **changed,
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
