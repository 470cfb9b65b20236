"""The region of the specimen and its gauges during set-up: drawn by strokes, found or placed, undone, and saved.

Strokes are in px of the picture. The centre of the pixel in column i and row j is at (i, j); a pixel belongs to a shape
where its centre lies in it.
"""

from __future__ import annotations

import itertools
import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.files.picture import write_picture
from acquire.frame import CameraInfo
from acquire.text import Message
from analysis.evaluate import inside_polygon
from live.config.gauges import GaugeTable, gauges_for, with_colours
from live.config.loading import Config
from live.config.values import AUTO, GIVEN
from live.setup.grid import auto_gauges, grid_for
from live.setup.pictures import read_mask
from live.setup.region import region_of
from live.ui.web.map_view import as_png
from live.ui.web.setup.config_draft import ConfigDraft

TOOLS = ("rectangle", "polygon", "brush", "eraser")
MAX_POINTS = 5000
MAX_UNDO = 12
"""Edits that can be undone."""

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


SHADE = (60, 20, 0, 150)
"""Colour over pixels that are not measured: blue, green, red, opacity."""


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """One movement of a tool.

    Attributes
    ----------
    tool : str
        One of ``TOOLS``.
    points : (N, 2) float64, px
        x, y: two opposite corners, the corners of a polygon, or the path of a brush.
    radius : float, px
        Of a brush or eraser.
    add : bool
        Whether a rectangle or polygon is added to the region; else it replaces the region.
    """

    tool: str
    points: Floats
    radius: float
    add: bool

    @classmethod
    def parse(cls, request: Mapping[str, Any]) -> Stroke:
        """A stroke as a page sends it; raises ConfigError where it is invalid."""
        tool, points, radius = request.get("tool"), request.get("points"), request.get("radius", 8)
        min_points = {"rectangle": 2, "polygon": 3}.get(str(tool), 1)
        if tool not in TOOLS:
            raise ConfigError("no such tool; there are {listed}", ", ".join(TOOLS))
        if not are_points(points, min_points, MAX_POINTS):
            raise ConfigError(
                "a {tool} has {min_points} to {MAX_POINTS} points, each two numbers, x and y in px",
                tool,
                min_points,
                MAX_POINTS,
            )
        if not _is_coordinate(radius) or not 0.5 <= radius <= 1000:
            raise ConfigError("a brush has a radius from 0.5 to 1000 px")
        return cls(str(tool), np.array(points, np.float64), float(radius), request.get("add") is True)

    def drawn_on(self, mask: Bools) -> Bools:
        """The mask after this stroke."""
        shape = self._shape(mask.shape)
        if self.tool == "eraser":
            return mask & ~shape
        return mask | shape if self.add or self.tool == "brush" else shape

    def _shape(self, shape: tuple[int, ...]) -> Bools:
        margin = self.radius if self.tool in ("brush", "eraser") else 0.0
        low, high = self.points.min(axis=0) - margin, self.points.max(axis=0) + margin
        rows, columns = (
            slice(max(math.ceil(low[k]), 0), max(min(math.floor(high[k]), shape[axis] - 1) + 1, 0))
            for k, axis in ((1, 0), (0, 1))
        )
        y, x = np.mgrid[rows, columns].astype(np.float64)
        found = np.zeros(shape, bool)
        if self.tool == "rectangle":
            found[rows, columns] = True
        elif self.tool == "polygon":
            found[rows, columns] = inside_polygon(x, y, self.points)
        else:
            found[rows, columns] = near_path(x, y, self.points, self.radius)
        return found


def are_points(value: object, min_points: int = 2, max_points: int = 2) -> TypeGuard[list[list[Any]]]:
    """Whether a value from a page is a list of so many points ``[x, y]`` in px."""
    return (
        isinstance(value, list)
        and min_points <= len(value) <= max_points
        and all(isinstance(p, list) and len(p) == 2 and all(map(_is_coordinate, p)) for p in value)
    )


def _is_coordinate(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6


def near_path(x: Floats, y: Floats, path: Floats, radius: float) -> Bools:
    """Whether the points lie within ``radius`` of the line through the points of ``path``."""
    near = np.hypot(x - path[0, 0], y - path[0, 1]) <= radius
    for (x0, y0), (x1, y1) in itertools.pairwise(path):
        length = (x1 - x0) ** 2 + (y1 - y0) ** 2
        along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length if length else np.zeros(x.shape)
        along = np.clip(along, 0.0, 1.0)
        near |= np.hypot(x - x0 - along * (x1 - x0), y - y0 - along * (y1 - y0)) <= radius
    return np.asarray(near)


class DrawnRegion:
    """A region that changes stroke by stroke; the last strokes can be undone.

    Parameters
    ----------
    mask : (H, W) bool
        At the beginning.
    origin : str
        What the mask was made from, for a person.
    """

    def __init__(self, mask: Bools, origin: str) -> None:
        self._masks: list[tuple[Bools, str]] = [(mask, origin)]
        self._undone: list[tuple[Bools, str]] = []

    @property
    def mask(self) -> Bools:
        """(H, W) bool: the measured pixels."""
        return self._masks[-1][0]

    @property
    def origin(self) -> str:
        """What the mask was made from, for a person."""
        return self._masks[-1][1]

    @property
    def box(self) -> tuple[int, int, int, int] | None:
        """x, y, width, height of the region, px; None where it is empty."""
        rows, columns = np.flatnonzero(self.mask.any(axis=1)), np.flatnonzero(self.mask.any(axis=0))
        if not rows.size:
            return None
        x, y = int(columns[0]), int(rows[0])
        return x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1

    @property
    def is_box(self) -> bool:
        """Whether the region is a rectangle."""
        box = self.box
        return box is not None and int(self.mask.sum()) == box[2] * box[3]

    def draw(self, strokes: Sequence[Mapping[str, Any]]) -> None:
        """Draw strokes; raises ConfigError where one is invalid, and draws none then."""
        mask = self.mask
        for stroke in [Stroke.parse(one) for one in strokes]:
            mask = stroke.drawn_on(mask)
        self.replace(mask, Message("as drawn"))

    def replace(self, mask: Bools, origin: str) -> None:
        """Replace the mask by another of the same size."""
        kept = self._masks[-MAX_UNDO:]
        self._masks, self._undone = [*kept, (mask, origin)], []

    def undo(self) -> None:
        """Undo the last change."""
        if len(self._masks) > 1:
            self._undone.append(self._masks.pop())

    def redo(self) -> None:
        """Make the change that was undone last again."""
        if self._undone:
            self._masks.append(self._undone.pop())


class SpecimenRegion:
    """The drawn region and the gauges of a draft, with one undo for both.

    Parameters
    ----------
    draft : ConfigDraft
    drawn : DrawnRegion or None
        The region of the last specimen.
    on_change : callable
        Called when the results of the former region no longer hold.

    Attributes
    ----------
    drawn : DrawnRegion or None
        None until there is a picture.
    edition : int
        Counts the changes.
    """

    def __init__(self, draft: ConfigDraft, drawn: DrawnRegion | None, on_change: Callable[[], None]) -> None:
        self._draft, self.drawn, self._on_change = draft, drawn, on_change
        self.edition = 0
        # What each edit has replaced: the gauges, or None for the mask, which ``drawn`` keeps.
        self._edits: deque[Mapping[str, GaugeTable] | None] = deque(maxlen=MAX_UNDO)
        self._undone: list[Mapping[str, GaugeTable] | None] = []

    def changed(self) -> None:
        """Discard the results of the former region."""
        self.edition += 1
        self._on_change()

    @property
    def known(self) -> DrawnRegion:
        """The drawn region; raises DataError before the first picture."""
        if self.drawn is None:
            raise DataError("the camera has given no picture yet")
        return self.drawn

    def opened(self, info: CameraInfo) -> None:
        """Forget the region where the picture has another size."""
        if self.drawn is not None and self.drawn.mask.shape != (info.height, info.width):
            self.drawn = None
            self._edits.clear()
            self._undone.clear()

    # -- edits ----------------------------------------------------------------------------------

    def draw(self, strokes: list[Mapping[str, Any]]) -> None:
        """Draw strokes; raises ConfigError where one is invalid."""
        self.known.draw(strokes)
        self._edited_mask()

    def replace(self, mask: NDArray[np.bool_], origin: str) -> None:
        """Replace the mask."""
        self.known.replace(mask, origin)
        self._edited_mask()

    def set_gauges(self, gauges: Mapping[str, GaugeTable], changes: Mapping[str, Any] | None = None) -> None:
        """Take these gauges in place of all, and ``changes`` of other keys; each keeps its colour.

        Raises ConfigError and changes nothing where one is invalid.
        """
        before = self._draft.config.gauges
        self._draft.replace_gauges(with_colours(gauges), changes or {})
        self._edits.append(before)
        self._undone.clear()

    @property
    def can(self) -> list[str]:
        """Which of "undo" and "redo" has something to do."""
        return ["undo"] * bool(self._edits) + ["redo"] * bool(self._undone)

    def undo(self) -> None:
        """Undo the last edit of the mask or of the gauges; raises ConfigError without one."""
        if not self._edits:
            raise ConfigError("there is nothing to undo")
        self._undone.append(self._turned(self._edits.pop()))

    def redo(self) -> None:
        """Make the edit that was undone last again; raises ConfigError without one."""
        if not self._undone:
            raise ConfigError("there is nothing to make again")
        self._edits.append(self._turned(self._undone.pop(), again=True))

    def _turned(
        self, gauges: Mapping[str, GaugeTable] | None, *, again: bool = False
    ) -> Mapping[str, GaugeTable] | None:
        """Take these gauges, or the mask before or after its last edit; what was there, in the same form."""
        if gauges is None:
            self.known.redo() if again else self.known.undo()
            self.changed()
            return None
        before = self._draft.config.gauges
        self._draft.replace_gauges(gauges)
        return before

    def _edited_mask(self) -> None:
        self._edits.append(None)
        self._undone.clear()
        self.changed()

    # -- found in the picture ---------------------------------------------------------------------

    def begin(self, info: CameraInfo, stack: NDArray[np.float32]) -> None:
        """Begin with the region of the rig file, or with the specimen that is found, and its automatic gauges.

        A page sees the region when its gauges are placed: an edit of the page comes after them. Raises as ``find``.
        """
        m = self._draft.config.measure
        if not isinstance(m.roi, tuple) and m.mask is None:
            drawn = self._found(info, stack)
        else:
            region = region_of(self._draft.config, np.zeros((info.height, info.width), np.float32))
            given = read_mask(m.mask, info.width, info.height)
            inside = region.inside(info.width, info.height, m.zoi)
            drawn = DrawnRegion(inside if given is None else inside & given, region.words)
        try:
            if m.gauges == AUTO:
                self._place_gauges_on(drawn)
        finally:
            self.drawn = drawn
            self.changed()

    def find(self, info: CameraInfo, stack: NDArray[np.float32]) -> None:
        """Find the specimen in the last frames, (N, H, W); raises DataError where there is none."""
        found = self._found(info, stack)
        self.replace(found.mask, found.origin)

    def _found(self, info: CameraInfo, stack: NDArray[np.float32]) -> DrawnRegion:
        noise = float(np.diff(stack, axis=0).std()) / 2**0.5 / len(stack) ** 0.5 if len(stack) > 1 else None
        m = self._draft.config.measure
        automatic = replace(self._draft.config, measure=replace(m, roi=None, mask=None))
        region = region_of(automatic, stack.mean(axis=0), noise or None)
        return DrawnRegion(region.inside(info.width, info.height, m.zoi), region.words)

    def place_gauges(self) -> None:
        """Place gauges on the drawn region; raises DataError or ConfigError where they do not fit."""
        self._place_gauges_on(self.drawn)

    def _place_gauges_on(self, region: DrawnRegion | None) -> None:
        (drawn, roi), config = _boxed(region), self._draft.config
        height, width = drawn.mask.shape
        box = replace(config, measure=replace(config.measure, roi=roi, mask=None))
        placed = auto_gauges(grid_for(box, width, height, drawn.mask), config.specimen.first_axis)
        known = config.gauges
        kept = {name: {"colour": known[name].get("colour")} for name in placed if name in known}
        tables = {name: {**kept.get(name, {}), **table} for name, table in placed.items()}
        self.set_gauges({**known, **tables}, {"measure.gauges": GIVEN})

    # -- for the check, the test and the rig file ---------------------------------------------------

    def config(self, folder: Path) -> Config:
        """The configuration with the drawn region; a mask that is not a rectangle is written into ``folder``.

        Raises
        ------
        DataError, ConfigError
            No region is drawn, or no ZOI or gauge fits into it.
        """
        (drawn, roi), config = _boxed(self.drawn), self._draft.config
        path = None
        if not drawn.is_box:
            path = folder / f"mask-{time.monotonic_ns()}.png"
            write_picture(path, drawn.mask.astype(np.uint8) * 255)
        region = replace(config.measure, roi=roi, mask=None if path is None else str(path))
        return replace(config, measure=region)

    def ready(self, folder: Path) -> Config:
        """As ``config``, for a test: also raises where no ZOI, or not every gauge, lies in the region."""
        config = self.config(folder)
        height, width = self.known.mask.shape
        grid = grid_for(config, width, height, self.known.mask)
        if not grid.n_active:
            raise DataError("no ZOI lies in the region: draw a larger one, or take smaller ZOIs")
        gauges_for(config.gauges, config.specimen.first_axis, grid)
        return config

    def save(self) -> None:
        """Write the rig file with the drawn region; raises ConfigError where a file cannot be written."""
        drawn = self.drawn
        if drawn is None or drawn.box is None:
            self._draft.save(None)
            return
        self._draft.change_all({"measure.roi": list(drawn.box), "measure.mask": None})
        self._draft.save(None if drawn.is_box else drawn.mask)

    def shade(self) -> bytes:
        """An overlay that darkens the pixels that are not measured, as PNG."""
        drawn = self.drawn
        mask = np.ones((1, 1), bool) if drawn is None else drawn.mask
        shade = np.zeros((*mask.shape, 4), np.uint8)
        shade[~mask] = SHADE
        return as_png(shade)


def _boxed(drawn: DrawnRegion | None) -> tuple[DrawnRegion, tuple[int, int, int, int]]:
    """A region and its box; raises DataError without one."""
    if drawn is None or drawn.box is None:
        raise DataError("no region is drawn yet: draw one, or find the specimen")
    return drawn, drawn.box
