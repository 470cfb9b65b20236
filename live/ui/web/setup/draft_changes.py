"""The changes that a page can request during the set-up of a camera; a refusal is an exception."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from acquire.addresses import with_setting
from acquire.bounds import NotAllowed, as_number
from acquire.errors import ConfigError
from acquire.text import Message
from analysis.evaluate import GAUGE_KINDS
from live.config.new_files import free_name
from live.setup.scale import Board, from_points
from live.ui.web.setup.setup_session import OVERLAYS, SetupSession
from live.ui.web.setup.specimen_region import are_points

Request = Mapping[str, Any]
MAX_MM = 1e5
MIN_FPS, MAX_FPS = 0.01, 1e5
MAX_GAUGE_POINTS = 100
MAX_ADDRESS = 500  # letters


def draw(session: SetupSession, request: Request) -> None:
    """Draw strokes of a tool."""
    strokes = request.get("strokes")
    if not isinstance(strokes, list) or not 1 <= len(strokes) <= 500:
        raise ConfigError("strokes are a list")
    if not all(isinstance(one, dict) for one in strokes):
        raise ConfigError("a stroke has a tool and points")
    session.region.draw(strokes)


def overlay(session: SetupSession, request: Request) -> None:
    """Show or hide an overlay of the picture."""
    if request.get("name") not in OVERLAYS:
        raise ConfigError("the overlays are {listed}", ", ".join(OVERLAYS))
    session.overlays[str(request["name"])] = request.get("on") is True


def camera(session: SetupSession, request: Request) -> None:
    """Change a setting of the address of the camera, and open the camera again."""
    key, value = request.get("key"), request.get("value")
    info = session.preview.info
    keys = [] if info is None else [setting.key for setting in info.settings]
    if key not in keys:
        raise ConfigError("a number for one of {listed}", ", ".join(keys) or "the settings of an open camera")
    number = _number(str(key), value)
    session.preview.reopen(with_setting(session.draft.config.camera.address, str(key), number))


def option(session: SetupSession, request: Request) -> None:
    """Change the format or the rate in the address of the camera; an empty value leaves it to the camera."""
    key, value = request.get("key"), request.get("value")
    if key not in ("format", "fps") or not isinstance(value, str | int | float) or len(str(value)) > 40:
        raise ConfigError("the options of a camera are format and fps")
    if key == "fps" and value != "":
        value = f"{_number(Message('a rate in 1/s'), value, MIN_FPS, MAX_FPS):.12g}"
    session.preview.reopen(with_setting(session.draft.config.camera.address, key, str(value).strip()))


def _address(value: object) -> str:
    """The address of a device from a page: a text in one line."""
    if not isinstance(value, str) or not value or len(value) > MAX_ADDRESS or not value.isprintable():
        raise ConfigError("an address is a text of 1 to {MAX_ADDRESS} letters in one line", MAX_ADDRESS)
    return value


def set_key(session: SetupSession, request: Request) -> None:
    """Change a key of the configuration, such as specimen.width_mm."""
    key, value = request.get("key"), request.get("value")
    if (
        not isinstance(key, str)
        or key.startswith(("camera.", "gauges.", "load."))
        or key in ("measure.roi", "measure.mask")
    ):
        raise ConfigError("{key} cannot be changed like this", key)
    of_specimen = key.startswith(("specimen.", "metadata.")) and key != "specimen.axis"
    (session.shared if of_specimen else session.draft).change_all({key: None if value == "" else value})
    if key.startswith("measure."):
        session.region.changed()


def gauge(session: SetupSession, request: Request) -> None:
    """Make a gauge from a table or from points (``kind`` and ``points``), move it, rename it, or remove it.

    ``was`` is its former name; a new gauge without a name gets the usual one of its kind.
    """
    gauges, name = session.draft.config.gauges, request.get("name")
    was = request.get("was", name)
    before = dict(gauges[was]) if isinstance(was, str) and was in gauges else {}
    table = request.get("gauge", before)
    if "points" in request:
        kind = request.get("kind", before.get("kind"))
        table = before | {"kind": kind, **_parameters_at(kind, request["points"])}
        name = name or free_name(GAUGE_KINDS[kind].default_name, gauges.__contains__, "")
    if not isinstance(name, str) or not isinstance(table, dict | None):
        raise ConfigError("a gauge has a name and a table")
    if table is not None and "colour" in before:
        table = {"colour": before["colour"], **table}
    if before and was != name and name in gauges:
        raise ConfigError("there is already a gauge {name}", name)
    renamed = {name if before and key == was else key: known for key, known in gauges.items()}
    tables = {**renamed, name: table}
    session.region.set_gauges({key: known for key, known in tables.items() if known is not None})


def _parameters_at(kind: object, points: object) -> dict[str, Any]:
    """The parameters of a gauge of ``kind`` at the points that a page has sent."""
    if not isinstance(kind, str) or kind not in GAUGE_KINDS:
        raise ConfigError("there is no such kind of gauge; there are {listed}", ", ".join(GAUGE_KINDS))
    if not are_points(points, 1, MAX_GAUGE_POINTS):
        raise ConfigError("a gauge has 1 to {MAX_GAUGE_POINTS} points, x and y in px", MAX_GAUGE_POINTS)
    return GAUGE_KINDS[kind].from_handles([(float(x), float(y)) for x, y in points])


def scale(session: SetupSession, request: Request) -> None:
    """Take the scale from two points and their distance."""
    points = request.get("points")
    if not are_points(points):
        raise ConfigError("a scale is two points in px and their distance in mm")
    x1, y1, x2, y2 = (_number("a point", v) for point in points for v in point)
    mm = _number("a distance", request.get("mm"))
    session.draft.change_all(from_points((x1, y1, x2, y2), mm).changes())
    session.clear_remarks()
    session.region.changed()


def board(session: SetupSession, request: Request) -> None:
    """Take the scale from a board held at the place of the specimen; without ``marker`` a checkerboard."""
    columns, rows = request.get("columns"), request.get("rows")
    dictionary = request.get("dictionary", "4X4_50")
    if (
        type(columns) is not int
        or type(rows) is not int
        or not isinstance(dictionary, str)
        or len(dictionary) > 40
    ):
        raise ConfigError(
            "a board has whole numbers of columns and rows, and a dictionary where it has markers"
        )
    square = _number(Message("a square in mm"), request.get("square"), 0, MAX_MM)
    marker = _number(Message("a marker in mm"), request.get("marker", 0), 0, MAX_MM)
    calibration_board = Board(columns, rows, square, marker, dictionary)
    session.draft.change_all(session.scale_from(calibration_board).changes())
    session.region.changed()


def _number(what: str, value: object, low: float = -math.inf, high: float = math.inf) -> float:
    try:
        return as_number(value, low, high)
    except NotAllowed as allowed:
        raise ConfigError("{what} is {allowed}", what, allowed) from None


def whole_picture(session: SetupSession, request: Request) -> None:
    """Measure the whole picture."""
    session.region.replace(np.ones_like(session.region.known.mask), Message("the whole picture"))


CHANGES: dict[str, Callable[[SetupSession, Request], None]] = {
    "draw": draw,
    "undo": lambda session, _: session.region.undo(),
    "redo": lambda session, _: session.region.redo(),
    "find": lambda session, _: session.find(),
    "all": whole_picture,
    "overlay": overlay,
    "camera": camera,
    "option": option,
    "address": lambda session, request: session.preview.reopen(_address(request.get("value"))),
    "load": lambda session, request: session.open_load(_address(request.get("value"))),
    "devices": lambda session, _: session.devices.search(),
    "identify": lambda session, request: session.devices.identify(_address(request.get("port"))),
    "tare": lambda session, _: session.load.tare(),
    "untare": lambda session, _: session.load.undo_tare(),
    "set": set_key,
    "gauge": gauge,
    "place": lambda session, _: session.region.place_gauges(),
    "scale": scale,
    "board": board,
    "forget": lambda session, _: session.check.reset_peak(),
}
