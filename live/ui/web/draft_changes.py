"""What a page may change while the rig is set up; each a word, checked, and refused in a sentence."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from itertools import count
from typing import Any, TypeGuard

import numpy as np

from acquire.bounds import NotAllowed, as_number
from acquire.errors import ConfigError, DataError
from analysis.evaluate import GAUGE_KINDS
from live.setup.scale import Board, from_points
from live.ui.web.config_draft import with_setting
from live.ui.web.drawn_region import DrawnRegion
from live.ui.web.setup_session import OVERLAYS, SetupSession

Said = Mapping[str, Any]
LONGEST_MM = 1e5
MOST_POINTS = 100  # of a gauge


def _drawn(session: SetupSession) -> DrawnRegion:
    if session.drawn is None:
        raise DataError("the camera has given no picture yet")
    return session.drawn


def draw(session: SetupSession, said: Said) -> None:
    """Strokes of a tool."""
    strokes = said.get("strokes")
    if not isinstance(strokes, list) or not 1 <= len(strokes) <= 500:
        raise ConfigError("strokes are a list")
    if not all(isinstance(one, dict) for one in strokes):
        raise ConfigError("a stroke has a tool and points")
    _drawn(session).draw(strokes)
    session.region_changed()


def undo(session: SetupSession, said: Said) -> None:
    """The region as it was before."""
    _drawn(session).undo()
    session.region_changed()


def find(session: SetupSession, said: Said) -> None:
    """The specimen in the picture."""
    session.find()


def everything(session: SetupSession, said: Said) -> None:
    """The whole picture."""
    drawn = _drawn(session)
    drawn.take(np.ones_like(drawn.mask), "the whole picture")
    session.region_changed()


def overlay(session: SetupSession, said: Said) -> None:
    """Something laid over the picture, or taken off."""
    if said.get("name") not in OVERLAYS:
        raise ConfigError(f"there are {', '.join(OVERLAYS)}")
    session.overlays[str(said["name"])] = said.get("on") is True


def camera(session: SetupSession, said: Said) -> None:
    """A setting of the camera's address; the camera is opened anew and tells what is in force."""
    key, value = said.get("key"), said.get("value")
    info = session.preview.info
    known = [] if info is None else [setting.key for setting in info.settings]
    if key not in known:
        raise ConfigError(f"a number for one of {', '.join(known) or 'the settings of an open camera'}")
    number = _number(str(key), value)
    session.preview.reopen(with_setting(session.draft.config.camera.address, str(key), number))


def address(session: SetupSession, said: Said) -> None:
    """Another camera."""
    if not isinstance(said.get("value"), str):
        raise ConfigError("an address is a text")
    session.preview.reopen(said["value"])


def put(session: SetupSession, said: Said) -> None:
    """A key of the configuration, such as specimen.width_mm."""
    key, value = said.get("key"), said.get("value")
    if (
        not isinstance(key, str)
        or key.startswith(("camera.", "gauges."))
        or key in ("measure.roi", "measure.mask")
    ):
        raise ConfigError(f"{key} is not changed like this")
    session.draft.change_all({key: None if value == "" else value})
    if key.startswith("measure."):
        session.region_changed()


def gauge(session: SetupSession, said: Said) -> None:
    """A gauge made of a table or of places (``kind`` and ``points``), moved to others, or taken away.

    ``was`` is its name so far; a new one without a name gets the usual one of its kind.
    """
    gauges, name = session.draft.config.gauges, said.get("name")
    was = said.get("was", name)
    before = dict(gauges[was]) if isinstance(was, str) and was in gauges else {}
    table = said.get("gauge", before)
    if "points" in said:
        kind = said.get("kind", before.get("kind"))
        table = before | {"kind": kind, **_placed(kind, said["points"])}
        name = name or _unused(GAUGE_KINDS[kind].default_name, gauges)
    if not isinstance(name, str) or not isinstance(table, dict | None):
        raise ConfigError("a gauge has a name and a table")
    changes: dict[str, Any] = {}
    if before and was != name:
        if name in gauges:
            raise ConfigError(f"there is a gauge {name} already")
        changes[f"gauges.{was}"] = None
    session.draft.change_all(changes | {f"gauges.{name}": table})


def _placed(kind: object, points: object) -> dict[str, Any]:
    """The parameters of a gauge of ``kind`` at the places that a page has sent."""
    if not isinstance(kind, str) or kind not in GAUGE_KINDS:
        raise ConfigError(f"there is no such kind of gauge; there are {', '.join(GAUGE_KINDS)}")
    if not _are_points(points, 1, MOST_POINTS):
        raise ConfigError(f"a gauge has 1 to {MOST_POINTS} places, x and y in px")
    return GAUGE_KINDS[kind].from_handles([(float(x), float(y)) for x, y in points])


def _unused(usual: str, taken: Container[str]) -> str:
    """The first of axial, axial2 ... that is free."""
    names = (usual if n == 1 else f"{usual}{n}" for n in count(1))
    return next(name for name in names if name not in taken)


def place(session: SetupSession, said: Said) -> None:
    """Gauges that place themselves on the region; others stay."""
    session.place_gauges()


def scale(session: SetupSession, said: Said) -> None:
    """mm per px from two points and their distance."""
    points = said.get("points")
    if not _are_points(points):
        raise ConfigError("a scale is two points in px and their distance in mm")
    x1, y1, x2, y2 = (_number("a point", v) for point in points for v in point)
    mm = _number("a distance", said.get("mm"))
    session.draft.change_all(from_points((x1, y1, x2, y2), mm).changes())
    session.scaled()
    session.region_changed()


def board(session: SetupSession, said: Said) -> None:
    """mm per px from a board that is held where the specimen will be; without ``marker`` a checkerboard."""
    columns, rows = said.get("columns"), said.get("rows")
    words = said.get("dictionary", "4X4_50")
    if type(columns) is not int or type(rows) is not int or not isinstance(words, str) or len(words) > 40:
        raise ConfigError(
            "a board has whole numbers of columns and rows, and a dictionary where it has markers"
        )
    square = _number("a square in mm", said.get("square"), 0, LONGEST_MM)
    marker = _number("a marker in mm", said.get("marker", 0), 0, LONGEST_MM)
    seen = Board(columns, rows, square, marker, words)
    session.draft.change_all(session.scale_from(seen).changes())
    session.region_changed()


def _number(what: str, value: object, low: float = -math.inf, high: float = math.inf) -> float:
    try:
        return as_number(value, low, high)
    except NotAllowed as allowed:
        raise ConfigError(f"{what} is {allowed}") from None


def _are_points(said: object, fewest: int = 2, most: int = 2) -> TypeGuard[list[list[Any]]]:
    return (
        isinstance(said, list)
        and fewest <= len(said) <= most
        and all(isinstance(p, list) and len(p) == 2 and all(map(_is_place, p)) for p in said)
    )


def _is_place(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6


def check(session: SetupSession, said: Said) -> None:
    """The whole check, with its table."""
    session.check()


def forget(session: SetupSession, said: Said) -> None:
    """The peak of the sharpness."""
    session.forget_peak()


def save(session: SetupSession, said: Said) -> None:
    """Into the rig file."""
    session.save()


CHANGES: dict[str, Callable[[SetupSession, Said], None]] = {
    "draw": draw,
    "undo": undo,
    "find": find,
    "all": everything,
    "overlay": overlay,
    "camera": camera,
    "address": address,
    "set": put,
    "gauge": gauge,
    "place": place,
    "scale": scale,
    "board": board,
    "check": check,
    "forget": forget,
    "save": save,
}
