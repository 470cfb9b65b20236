"""Fills the tables of formats and of the settings of devices: ``python -m docs.make_formats``.

They list what files and settings are declared to be. A page holds each table between ``<!-- table NAME ... -->`` and
``<!-- end -->``. The tests compare the pages with these tables.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from acquire.events import EventKind
from acquire.frame import CameraInfo
from acquire.hdf5 import NO_UNIT, Declared
from acquire.load_sample import LoadFlag
from acquire.session import layout
from acquire.settings import settings_of
from analysis.field import Status
from live.config.figures import FIGURES, columns
from live.results import stored_response
from live.results.finished.cycles import COLUMNS as CYCLES
from live.results.layout import COLUMNS
from live.results.quantities import quantity_of
from live.setup.devices import camera_settings, load_settings

DOCS = Path(__file__).parent
HEIGHT, WIDTH, ZOIS = 64, 80, (3, 5)
_SHAPES = {None: "N", HEIGHT: "H", WIDTH: "W", HEIGHT * WIDTH // 8: "HW/8", 3: "R", 5: "C"}
_CAMERA = CameraInfo("sim:", "camera", WIDTH, HEIGHT, 12, True, "device", 30.0, 0.008, "Y12", {}, ())
Row = tuple[str, ...]


def table(head: Row, rows: Iterable[Row]) -> str:
    """A table in Markdown."""
    first, *others = ("| " + " | ".join(cells) + " |" for cells in (head, *rows))
    return "\n".join([first, "|" + "---|" * len(head), *others])


def listed(place: str, items: Mapping[str, Declared]) -> str:
    """Datasets by their paths below ``/entry``."""
    head = (f"`/entry/{place}...`", "type", "unit", "meaning")
    return table(head, (_described(path, one) for path, one in sorted(items.items())))


def session_layout() -> str:
    """Every dataset of a session file."""
    groups = layout.groups(_CAMERA, "u4").items()
    below = {f"{group}/{name}": one for group, form in groups for name, one in form.items.items()}
    return listed("", layout.ENTRY | layout.NOTES | below)


def response() -> str:
    """The datasets of the group response."""
    return listed("response/", stored_response.items("stress", ZOIS))


def means() -> str:
    """The columns of strain.csv."""
    names = (*COLUMNS, *columns(["section", "lag"]), "gauge_NAME", "sigma_gauge_NAME", "share_gauge_NAME")
    quantities = ((name, quantity_of(name)) for name in names)
    return table(
        ("column", "unit", "meaning"),
        ((f"`{n}`", q.unit, q.words) for n, q in quantities if "sigma_" not in n),
    )


def channels() -> str:
    """The channels of alarms and strain output that are no columns of strain.csv."""
    rows = (
        (f"`{one.name}`", one.unit, one.words)
        for one in FIGURES
        if one.channel and one.words and one.name not in COLUMNS
    )
    return table(("channel", "unit", "meaning"), rows)


def cycles() -> str:
    """The columns of cycles.csv."""
    return table(
        ("column", "unit", "meaning"),
        ((f"`{n}`", *about) for n, about in CYCLES.items() if "sigma_" not in n),
    )


def statuses() -> str:
    """The values of the map of statuses."""
    rows = ((str(int(status)), status.name, status.text) for status in Status)
    return table(("value", "name", "meaning"), rows)


def flags() -> str:
    """The bits of a load sample's flags, and the kinds of events."""
    bits = ", ".join(f"{flag.value} {flag.name}" for flag in LoadFlag)
    return f"Bits of `load/flags`: {bits}.\n\nKinds of events: {', '.join(EventKind)}."


def settings(kinds: Mapping[str, type]) -> str:
    """The settings of the addresses of each kind of device."""
    return "\n\n".join(
        f"### {_named(name)}\n\n{_settings(kind)}" for name, kind in kinds.items() if any(settings_of(kind))
    )


def _named(kind: str) -> str:
    return f"`{kind}`" if "=" in kind else f"`{kind}:`" if kind else "`/dev/...`"


def _settings(kind: type) -> str:
    rows = (
        (
            f"`{one.key}`" if one.key else "others",
            one.unit,
            "; ".join(filter(None, (one.words, one.allowed * ("one of" in one.allowed), one.stands))),
        )
        for one in settings_of(kind)
    )
    return table(("setting", "unit", "meaning"), rows)


def _described(path: str, one: Declared) -> Row:
    free = one.shape[:1] == (None,)
    sizes = [_SHAPES.get(size, str(size)) for size in one.shape]
    kind = np.dtype(one.dtype)
    named = (f"text, {kind.itemsize} B" if free else "text") if kind.kind == "S" else kind.name
    unit = "" if one.unit in (None, NO_UNIT) else one.unit
    return (f"`{path}`", named + f" ({', '.join(sizes)})" * bool(sizes), unit, one.meaning)


TABLES: Mapping[str, Callable[[], str]] = MappingProxyType({
    "cameras": lambda: settings(camera_settings()), "load_cells": lambda: settings(load_settings()),
    "session": session_layout, "flags": flags, "means": means, "status": statuses,
    "response": response, "cycles": cycles, "channels": channels,
})  # fmt: skip
PAGES = tuple(DOCS / f"{name}.md" for name in ("strain-format", "control", "data/settings", "data/datasets"))
_TABLE = re.compile(r"(<!-- table (\w+)[^>]*-->\n).*?(\n<!-- end -->)", re.DOTALL)


def filled(page: str) -> str:
    """The page with tables made from the code."""
    return _TABLE.sub(lambda found: found[1] + "\n" + TABLES[found[2]]() + "\n" + found[3], page)


if __name__ == "__main__":
    for target in PAGES:
        target.write_text(filled(target.read_text(encoding="utf-8")), encoding="utf-8")
