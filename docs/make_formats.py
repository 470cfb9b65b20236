"""Fills the tables of formats and of the settings of cameras: ``python -m docs.make_formats``.

The writers of the program make a new file of each kind, which is listed; the definitions come from the file, from
``live.results.quantities``, or from the declared settings. A page holds each table between ``<!-- table NAME ... -->``
and ``<!-- end -->``. The tests compare the pages with these tables.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from types import MappingProxyType

import h5py
import numpy as np

from acquire.camera import CAMERAS
from acquire.clock import ClockPair
from acquire.events import EventKind
from acquire.frame import CameraInfo
from acquire.load_sample import LoadFlag
from acquire.session import SessionInfo, SessionWriter
from acquire.settings import settings_of
from analysis import Roi, ZoiGrid
from analysis.field import Status
from live.config.figures import FIGURES
from live.results.finished.cycles import COLUMNS as CYCLES
from live.results.quantities import quantity_of
from live.results.row import ResultsInfo
from live.results.strain_csv import COLUMNS
from live.results.writer import Results

DOCS = Path(__file__).parent
HEIGHT, WIDTH, ROWS_OF_ZOIS, COLUMNS_OF_ZOIS = 64, 80, 3, 5
_SHAPES = {HEIGHT: "H", WIDTH: "W", HEIGHT * WIDTH // 8: "HW/8", ROWS_OF_ZOIS: "R", COLUMNS_OF_ZOIS: "C"}
_START = datetime(2026, 1, 1, tzinfo=UTC)
_CAMERA = CameraInfo("sim:", "camera", WIDTH, HEIGHT, 12, True, "device", 30.0, 0.008, "Y12", {}, ())
_INFO = ResultsInfo(
    0.0, _START.isoformat(), {}, {}, {}, _CAMERA, area_m2=1e-6, gauges={"NAME": {}}, lagged=True
)

MEANINGS: Mapping[str, str] = MappingProxyType({
    "start_time": "start of the test, UTC",
    "start_monotonic_s": "the same instant on the monotonic clock of the recording machine",
    "config": "JSON: configuration in force",
    "metadata": "JSON: free text of the user",
    "versions": "JSON: versions of the software",
    "instrument/camera/description": "JSON: identity, format and controls in force",
    "instrument/load_cell/description": "JSON: identity, settings, sign and calibration; null without one",
    "frames/image": "grey levels as grabbed; the attribute `bits` has the significant bits",
    "events": "one JSON object a row; a row that begins with `+` continues the row before",
    "ledger": "JSON: final frame counts; empty where the run did not come to its end",
    "active": "0 where the mask leaves the ZOI out",
    "size": "side of a ZOI",
    "step": "distance of neighbouring ZOIs",
})  # fmt: skip
"""Of datasets without a ``long_name``."""

Row = tuple[str, ...]


def table(head: Row, rows: Iterable[Row]) -> str:
    """A table in Markdown."""
    first, *others = ("| " + " | ".join(cells) + " |" for cells in (head, *rows))
    return "\n".join([first, "|" + "---|" * len(head), *others])


def session_layout() -> str:
    """Every dataset of a session file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.h5"
        about = SessionInfo(_CAMERA, None, ClockPair(0.0, _START), {}, {}, {})
        SessionWriter(path, about).close()
        with h5py.File(path) as file:
            return table(("`/entry/...`", "type", "unit", "meaning"), _listed(file["entry"]))


def strain_maps() -> str:
    """The maps and the grid of strain.h5; the columns of means are those of strain.csv."""
    grid = ZoiGrid.cover(Roi(0, 0, 16 * (COLUMNS_OF_ZOIS + 1), 16 * (ROWS_OF_ZOIS + 1)), size=32, step=16)
    with tempfile.TemporaryDirectory() as folder:
        Results(Path(folder), grid, _INFO).close()
        with h5py.File(Path(folder) / "strain.h5") as file:
            strain = file["entry/strain"]
            own = {
                name: strain[name] for name in strain if not _is_listed_elsewhere(name, file["entry/mean"])
            }
            rows = [
                row for name, item in own.items() for row in _described(name, item, quantity_of(name).words)
            ]
    return table(("`/entry/strain/...`", "type", "unit", "meaning"), rows)


def response() -> str:
    """The datasets of the group response."""
    grid = ZoiGrid.cover(Roi(0, 0, 16 * (COLUMNS_OF_ZOIS + 1), 16 * (ROWS_OF_ZOIS + 1)), size=32, step=16)
    with tempfile.TemporaryDirectory() as folder:
        Results(Path(folder), grid, replace(_INFO, response="stress")).close()
        with h5py.File(Path(folder) / "strain.h5") as file:
            group = file["entry/response"]
            rows = [row for name in group if name not in "xy" for row in _described(name, group[name])]
    return table(("`/entry/response/...`", "type", "unit", "meaning"), rows)


def means() -> str:
    """The columns of strain.csv."""
    names = (*COLUMNS, *_INFO.extras, "gauge_NAME", "sigma_gauge_NAME", "share_gauge_NAME")
    quantities = ((name, quantity_of(name)) for name in names)
    return table(("column", "unit", "meaning"), ((f"`{n}`", q.unit, q.words) for n, q in quantities))


def channels() -> str:
    """The channels of alarms and strain output."""
    rows = (
        (f"`{one.name}`", one.unit, one.words or quantity_of(one.name).words)
        for one in FIGURES
        if one.channel
    )
    return table(("channel", "unit", "meaning"), rows)


def cycles() -> str:
    """The columns of cycles.csv."""
    return table(("column", "unit", "meaning"), ((f"`{name}`", *about) for name, about in CYCLES.items()))


def statuses() -> str:
    """The values of the map of statuses."""
    rows = ((str(int(status)), status.name, status.text) for status in Status)
    return table(("value", "name", "meaning"), rows)


def flags() -> str:
    """The bits of a load sample's flags, and the kinds of events."""
    bits = ", ".join(f"{flag.value} {flag.name}" for flag in LoadFlag)
    return f"Bits of `load/flags`: {bits}.\n\nKinds of events: {', '.join(EventKind)}."


def camera_settings(scheme: str) -> str:
    """The settings of an address of a kind of camera."""
    rows = (
        (
            f"`{one.key}`" if one.key else "others",
            one.unit,
            one.allowed,
            one.words + f"; {one.stands}" * bool(one.stands),
        )
        for one in settings_of(dict(CAMERAS.settings())[scheme])
    )
    return table(("setting", "unit", "allowed", "meaning"), rows)


def _listed(group: h5py.Group, place: str = "") -> Iterator[Row]:
    for name, item in group.items():
        path = f"{place}{name}"
        if isinstance(item, h5py.Group):
            yield from _listed(item, f"{path}/")
        elif name != "title":
            yield from _described(path, item)


def _described(path: str, item: h5py.Dataset, words: str = "") -> Iterator[Row]:
    """The row of a dataset; KeyError where neither the file nor ``MEANINGS`` has a meaning of it."""
    meaning = MEANINGS.get(path) or words or _text(item.attrs.get("long_name")) or MEANINGS[path]
    unit = _text(item.attrs.get("units", ""))
    free = item.shape != item.maxshape
    sizes = [("N" if free and not n else _SHAPES.get(size, str(size))) for n, size in enumerate(item.shape)]
    shape = f" ({', '.join(sizes)})" if sizes else ""
    kind = np.dtype(item.dtype)
    named = (f"text, {kind.itemsize} B" if free else "text") if kind.kind == "S" else kind.name
    yield (f"`{path}`", named + shape, "" if unit == "none" else unit, meaning)


def _is_listed_elsewhere(name: str, mean: h5py.Group) -> bool:
    """A second name of a column or of an uncertainty, or the uncertainty of a map."""
    return (
        (name in mean and name not in ("exx", "eyy", "exy")) or name.startswith("sigma_") or "_errors" in name
    )


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value or "")


TABLES: Mapping[str, Callable[[], str]] = MappingProxyType({
    "session": session_layout, "flags": flags, "maps": strain_maps, "means": means, "status": statuses,
    "response": response, "cycles": cycles, "channels": channels,
    **{name or "v4l2": partial(camera_settings, name) for name, _ in CAMERAS.settings()},
})  # fmt: skip
PAGES = tuple(
    DOCS / f"{name}.md"
    for name in ("session-format", "strain-format", "control", "cameras", "machine-vision")
)
_TABLE = re.compile(r"(<!-- table (\w+)[^>]*-->\n).*?(\n<!-- end -->)", re.DOTALL)


def filled(page: str) -> str:
    """The page with tables made from the code."""
    return _TABLE.sub(lambda found: found[1] + "\n" + TABLES[found[2]]() + "\n" + found[3], page)


if __name__ == "__main__":
    for target in PAGES:
        target.write_text(filled(target.read_text(encoding="utf-8")), encoding="utf-8")
