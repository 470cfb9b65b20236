"""Draws the rooms and the imports between them: ``python -m docs.make_architecture``.

Arrows and words come from the sources; ``tests/house`` checks that the picture is that of today. An arrow that
follows from others is left out; what a room takes of the other packages stands in it instead.
"""

from __future__ import annotations

import ast
import html
import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from docs.layers import Places, layers, placed, reduced
from tests.house.rooms import PACKAGES, ROOMS
from tests.house.sources import House, read_house, room_of

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "images" / "architecture.svg"
COLOURS = {"live": "#dbe9f6", "hw_mocks": "#eeeeee", "analysis": "#e2f0d9", "acquire": "#fdebd3"}
WIDTHS = {"live": 290, "hw_mocks": 330, "analysis": 148, "acquire": 148}  # of a room, px
NAMES = {"acquire": "the ground floor", "analysis": "the face", "hw_mocks": "one flat room"}
BESIDE, UNDER, LINE, LETTER, MARGIN, HEAD, GAP = 14, 34, 12, 5.4, 16, 32, 40

Arrows = Mapping[str, frozenset[str]]
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """A room as it is drawn: its name, what it is, what it takes of other packages."""

    name: str
    about: list[str]
    takes: list[str]

    @property
    def tall(self) -> int:
        return 24 + LINE * (len(self.about) + len(self.takes))


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One package: its rooms, their columns and rows, and the height at which each row begins, px."""

    package: str
    title: str
    boxes: Mapping[str, Box]
    arrows: Arrows
    places: Places
    rows: list[int]

    @property
    def column(self) -> int:
        return WIDTHS[self.package] + BESIDE

    @property
    def width(self) -> float:
        return self.column * (max(x for x, _ in self.places.values()) + 1) + BESIDE

    @property
    def tall(self) -> int:
        return self.rows[-1]

    def spot(self, node: str, corner: Point) -> Point:
        """The middle of a room's upper edge."""
        x, row = self.places[node]
        return corner[0] + BESIDE / 2 + self.column * (x + 0.5), corner[1] + self.rows[int(row)]

    def passage(self, node: str, corner: Point) -> tuple[Point, Point]:
        """Where an arrow that passes a row enters and leaves it."""
        x, y = self.spot(node, corner)
        below = self.rows[int(self.places[node][1]) + 1]
        return (x, y), (x, corner[1] + below - UNDER)


def arrows_between(house: House) -> Arrows:
    """Room -> rooms that it imports, for whatever purpose."""
    found: dict[str, set[str]] = {room_of(name, ROOMS): set() for name in house}
    for name, module in house.items():
        room = room_of(name, ROOMS)
        targets = {room_of(one.module, ROOMS) for one in module.imports if one.module in house}
        found[room] |= targets - {room, "live"}  # the version is everybody's
    return {room: frozenset(targets) for room, targets in sorted(found.items()) if room != "live"}


def drawing(house: House) -> str:
    """The picture as SVG: live above; below it analysis beside acquire, the mocks between live and acquire."""
    live, analysis, mocks, acquire = (
        _panel(house, name) for name in ("live", "analysis", "hw_mocks", "acquire")
    )
    right, below = MARGIN + analysis.width + BESIDE, MARGIN + live.tall + GAP
    deep = below + mocks.tall + GAP
    width = max(MARGIN + live.width, right + acquire.width) + MARGIN
    height = max(below + analysis.tall, deep + acquire.tall) + MARGIN
    over = right + mocks.width / 2
    parts = [
        _head(width, height),
        *_drawn(live, (MARGIN, MARGIN), width - 2 * MARGIN),
        *_drawn(analysis, (MARGIN, below), analysis.width),
        *_drawn(mocks, (right, below), mocks.width),
        *_drawn(acquire, (right, deep), width - MARGIN - right),
        _between(MARGIN + analysis.width / 2, below - GAP, below),
        _between(over, below - GAP, below),
        _between(over, deep - GAP, deep),
        _between((right + mocks.width + width - MARGIN) / 2, below - GAP, deep),
    ]
    return "\n".join([*parts, "</svg>", ""])


def _panel(house: House, package: str) -> Panel:
    arrows = arrows_between(house)
    inside = [room for room in arrows if room_of(room, [package])]
    graph = reduced({room: frozenset(t for t in arrows[room] if t in inside) for room in inside})
    boxes = {room: _box(house, room, arrows[room]) for room in inside}
    rows, tops = layers(graph), [HEAD]
    for row in rows:
        tops.append(tops[-1] + max(boxes[room].tall for room in row) + UNDER)
    tops[-1] += BESIDE - UNDER
    title = _about(house, package).partition(":")[0]
    return Panel(package, title, boxes, graph, placed(rows, graph), tops)


def _box(house: House, room: str, targets: frozenset[str]) -> Box:
    package = room.split(".")[0]
    name = NAMES.get(room, room.removeprefix(f"{package}.").replace(".", "/"))
    wide = int(WIDTHS[package] / LETTER)
    return Box(name, textwrap.wrap(_words(house, room), wide), _takes(targets, package, wide))


def _words(house: House, room: str) -> str:
    if room == "acquire":
        return " ".join(name.partition(".")[2] for name in house if room_of(name, ROOMS) == room).strip()
    return "what others import of it" if room == "analysis" else _about(house, room)


def _about(house: House, name: str) -> str:
    """The first sentence of a face."""
    text = " ".join((ast.get_docstring(house[name].tree) or "").split())
    return re.split(r"(?<=[.?])\s", text)[0].rstrip(".").replace("``", "")


def _takes(targets: frozenset[str], package: str, wide: int) -> list[str]:
    """What a room imports of other packages, in lines; the ground floor of acquire is everybody's."""
    lines = []
    for other in PACKAGES:
        rooms = sorted(t for t in targets if room_of(t, [other]) and other != package and t != "acquire")
        words = [room.partition(".")[2] for room in rooms if room != other]
        if rooms:
            lines += textwrap.wrap(f"{other}{':' * bool(words)} {' '.join(words)}", wide)
    return lines


def _head(width: float, height: float) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}"'
        f' height="{height:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="9.5">\n'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0,0.5 L8,4 L0,7.5 z" fill="#444"/></marker></defs>\n'
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="white"/>'
    )


def _drawn(panel: Panel, corner: Point, width: float) -> list[str]:
    """The package, its arrows, and its rooms over them."""
    x, y = corner
    title = _text(x + 10, y + 21, panel.title, 'font-size="12"', panel.package)
    parts = [
        _rectangle(x, y, width, panel.tall, f'rx="8" fill="{COLOURS[panel.package]}" stroke="#999"'),
        title,
    ]
    corner = (x + (width - panel.width) / 2, y)
    for room, targets in panel.arrows.items():
        start = panel.spot(room, corner)
        for target in sorted(targets):
            passed = [end for node in panel.places.ways[room, target] for end in panel.passage(node, corner)]
            leaves = (start[0], start[1] + panel.boxes[room].tall)
            parts.append(_arrow([leaves, *passed, panel.spot(target, corner)]))
    for room, box in panel.boxes.items():
        parts += _room(box, panel.spot(room, corner), WIDTHS[panel.package])
    return parts


def _room(box: Box, at: Point, width: int) -> list[str]:
    x, y = at
    lines = [(line, "") for line in box.about] + [
        (line, ' font-style="italic" fill="#06c"') for line in box.takes
    ]
    return [
        _rectangle(x - width / 2, y, width, box.tall, 'rx="4" fill="white" stroke="#666"'),
        _text(x, y + 15, "", 'font-size="12.5" text-anchor="middle"', box.name),
        *(
            _text(x, y + 28 + LINE * n, line, f'text-anchor="middle"{style}')
            for n, (line, style) in enumerate(lines)
        ),
    ]


def _rectangle(x: float, y: float, width: float, height: float, style: str) -> str:
    return f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}" {style}/>'


def _text(x: float, y: float, words: str, style: str, bold: str = "") -> str:
    strong = f'<tspan font-weight="bold">{bold}</tspan> ' if bold else ""
    return f'<text x="{x:.0f}" y="{y:.0f}" {style}>{strong}{html.escape(words)}</text>'


def _arrow(points: list[Point]) -> str:
    """A smooth line downwards through ``points``."""
    path = f"M{points[0][0]:.0f},{points[0][1]:.0f}"
    for (x0, y0), (x1, y1) in pairwise(points):
        bend = (y1 - y0) * 0.5
        path += f" C{x0:.0f},{y0 + bend:.0f} {x1:.0f},{y1 - bend:.0f} {x1:.0f},{y1:.0f}"
    return f'<path d="{path}" fill="none" stroke="#444" stroke-width="1.1" marker-end="url(#tip)"/>'


def _between(x: float, top: float, bottom: float) -> str:
    return (
        f'<path d="M{x:.0f},{top:.0f} V{bottom:.0f}" stroke="#444" stroke-width="3" marker-end="url(#tip)"/>'
    )


if __name__ == "__main__":
    PICTURE.write_text(drawing(read_house(ROOT, PACKAGES)), encoding="utf-8")
