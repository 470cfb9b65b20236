"""Made-up states of the page, as the server sends them, and how the page is made to show one."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from analysis.evaluate import GAUGE_KINDS
from live.config.loading import load_config
from live.pipeline.snapshot import Snapshot
from live.ui.web.broadcaster import plain
from live.ui.web.page_consumer import fact
from live.ui.web.page_controller import PageController
from tests.live.made_up import figures as made_figures
from tests.live.ui.web.browser import Page

KINDS = [{"kind": n, "label": k.label, "hint": k.hint, "gesture": k.gesture} for n, k in GAUGE_KINDS.items()]
WHAT = {
    "specimen": "bar-6", "material": "AlMg3", "width_mm": 20.0, "thickness_mm": 1.5, "diameter_mm": None,
    "area_mm2": 30.0,
}  # fmt: skip
STAGE = {
    "stage": "run", "n": 7, "words": "", "alone": False, "components": ["eyy"], "kinds": KINDS, "what": WHAT,
    "before": None,
}  # fmt: skip
POINTS = [[0.0, 0.0, 0.0, 0.0], [1.0, 100e6, 1500e-6, 1490e-6], [2.0, 267.84e6, 19.988e-2, 19.994e-2]]
"""Rows of the curve: time s, stress Pa, axial strain, a gauge."""
COUNTS = {"recorded": 876, "skipped": 0, "lost": 3, "unrecorded": 2, "without_force": 0}
MAP = {
    "n": 5, "of": "eyy", "range": "automatic", "width": 256, "height": 192, "low": 0.185, "high": 0.215,
    "strain": True, "unit": "", "histogram": [0] * 23 + [9], "gauges": {},
}  # fmt: skip
_SHOW = """async ([module, name, ...values]) => { const { [name]: show } = await import(`/static/${module}.js`);
    await show(...values); }"""
UNITS = {"N": 1.0, "kN": 1e3, "MPa": 1e6, "µm/m": 1e-6, "%": 1e-2, "mm": 1e-3, "": 1.0}


def figure(value: float | None, sigma: float | None = None, **more: Any) -> dict[str, Any]:
    """A figure that is live unless ``more`` says otherwise."""
    found = {"state": "live", "value": value, "sigma": sigma, "last": value, "age_s": 0.1, "why": ""}
    return found | {"limit": None} | more


def facts(delay_s: float = 0.044, cycle: float = math.nan, **counts: int) -> list[dict[str, Any]]:
    """The small figures, as the program sends them."""
    now = made_figures(fps=10.0, disk=960 * 60.0, burst=1.0)
    more: Any = {"frames": COUNTS | counts, "latency_p95_s": delay_s, "cycles": {"cycle": cycle}}
    snapshot = Snapshot(0.0, figures=now, **more)
    return plain([fact(row) for row in snapshot.rows("page")])  # type: ignore[no-any-return]


def run_state(**more: Any) -> dict[str, Any]:
    """A test that measures."""
    axial = {"name": "area", "value": 19.988e-2, "sigma": 2e-5, "assumed": ""}
    return {
        "side": "", "state": "measuring", "elapsed_s": 88.0, "recording": True, "peak_N": 8044.7, "troubles": [],
        "figures": {
            "force": figure(8035.3, 0.9), "stress": figure(267.84e6, 3e4), "axial": figure(19.988e-2, 2e-5),
        },
        "axial": axial, "gauges": [{"name": "width", "value": -7.703e-2, "sigma": 2e-6, "reason": "", "part": ""}],
        "strain_rate": [3.1e-3, 2e-4], "elongation": {"kind": "length", "value": 6.33e-3, "sigma": 18e-6},
        "points": [1, len(POINTS)], "picture": MAP, "events": [],
        "facts": facts(), "sides": None, "valid": 3000, "zois": 3000,
        "part": "",
    } | more  # fmt: skip


def setup_state(**more: Any) -> dict[str, Any]:
    """A rig that is set up and checked."""
    lines = [{"what": "disk", "value": "room for 960 min", "good": True, "advice": "", "measured": True}]
    table = {
        "bursts": [1, 4],
        "rows": [{"zoi": 32, "order": 1, "vsg": 80.0, "l10": 90.0, "noise": [150e-6, 75e-6]}],
    }
    load = {
        "address": "sim:", "name": "cell", "force_N": -12.3, "noise_N": 0.5, "rate": 80.0, "zero_N": 0.0, "trouble": "",
    }  # fmt: skip
    return {
        "side": "", "remarks": [], "trouble": "", "doubt": "", "busy": "", "camera": None, "address": "sim:",
        "load": load, "devices": {"cameras": [], "loads": [], "finding": ""}, "picture": 0,
        "overlays": {"saturated": True, "quality": False}, "region": None, "gauges": {}, "plates": {},
        "measure": {"zoi": 32, "step": 16, "burst": 4}, "metadata": {"specimen": "bar-6"},
        "specimen": {
            "width_mm": 20.0, "thickness_mm": 1.5, "diameter_mm": None, "gauge_length_mm": None, "axis": "auto",
            "area_mm2": 30.0,
        },
        "scale": {"px_per_mm": 24.0, "sigma": 2e-5}, "unsaved": [], "file": "rig.toml", "lines": lines, "table": table,
        "go": True, "checking": False, "sharpness": 0.36, "peak": 0.4, "saturated": 0.0123, "sigma": 75e-6,
        "zois": 3000, "light": 0.88,
    } | more  # fmt: skip


def result(**more: Any) -> dict[str, Any]:
    """What comes after a test."""
    strength, strain = {"kind": "stress", "digits": 2}, {"kind": "strain", "digits": 2, "unit": "%"}
    figures = [
        {"name": "E", "text": strength | {"value": 69.905e9, "sigma": 0.057e9}, "head": True},
        {"name": "Rm", "text": strength | {"value": 268.16e6, "sigma": 0.10e6}, "head": True},
        {"name": "Agt", "text": strain | {"value": 18.9e-2, "sigma": 0.47e-2}},
    ]
    gauges = [{"name": "width", "value": -7.703e-2, "sigma": 2e-6, "reason": "", "part": ""}]
    marks = [
        {"points": [[0.0, 0.0], [2e-3, 140e6]]},
        {"points": [[0.19, 268.16e6]], "words": {"name": "Rm", "value": 268.16e6}},
    ]
    return {
        "figures": figures, "gauges": gauges, "troubles": [], "words": "", "folder": "runs/bar-6",
        "ledger": "",
        "belief": {"kind": "good", "words": {"say": "{sure} can be believed.", "with": {"sure": "E, Rm"}}},
        "report": True, "lines": marks, "again": "bar-6",
        "next": "bar-7", "peak": MAP | {"picture": "/picture?after=1", "s": 85.0}, "atpeak": "at the highest force",
        "points": [1, len(POINTS)],
    } | more  # fmt: skip


@contextmanager
def opened(
    browser: Any,
    change: Callable[[Any], None] = lambda page: None,
    colours: Sequence[int | None] = (None,),
    **wanted: Any,
) -> Iterator[Page]:
    """A page of a program that has nothing to show; ``change`` is made before it opens."""
    names = ["t", "stress", "axial", "width"]
    points = {"names": names, "colours": [*colours], "edition": 1, "first": 0, "rows": POINTS}
    viewport = {"width": 1280, "height": 800}
    with PageController(None, port=0) as controller:
        controller.begin({"": load_config(None, {})})
        context = browser.new_context(**{"viewport": viewport, "locale": "en-US", **wanted})
        page = Page(context.new_page())
        page.page.route("**/points?*", lambda route: route.fulfill(json=points))
        change(page.page)
        page.goto(controller.address)
        page.until(lambda: page.stage() == "run", "the page is there")
        yield page
        context.close()


def show(page: Page, module: str, name: str, *values: Any) -> None:
    """Call a function of the page with made-up values."""
    page.page.evaluate(_SHOW, [module, name, *values])


def show_run(page: Page, stage: Mapping[str, Any] = STAGE, **more: Any) -> None:
    """The stage of a run in a made-up state."""
    page.page.evaluate("() => { document.body.dataset.stage = 'run'; }")
    show(page, "run", "beginRun", stage)
    show(page, "run", "showRun", run_state(**more))


def show_setup(page: Page, **more: Any) -> None:
    """The set-up in a made-up state."""
    page.page.evaluate("() => { document.body.dataset.stage = 'setup'; }")
    show(page, "setup", "beginSetup", STAGE)
    show(page, "setup", "showSetup", setup_state(**more))


def show_after(page: Page, **more: Any) -> None:
    """The stage after a made-up test."""
    page.page.evaluate("() => { document.body.dataset.stage = 'after'; }")
    show(page, "after", "showAfter", result(**more))


def number(text: str) -> float:
    """A number as a person reads it: groups by narrow spaces, a true minus, point or comma."""
    plain = text.strip().replace("\u202f", "").replace("−", "-").replace(",", ".")
    found = re.fullmatch(r"[+-]?\d+(\.\d+)?(e[+-]\d+)?", plain)
    assert found, f"no number: {text!r}"
    return float(plain)


def quantity(text: str) -> float:
    """A number with its unit, in SI units."""
    value, _, unit = text.strip().rpartition(" ")
    return number(value) * UNITS[unit]


def tile(page: Page, id_: str) -> float:
    """The figure of a tile in SI units."""
    return number(page.text(id_)) * UNITS[page.text(f"{id_}unit")]
