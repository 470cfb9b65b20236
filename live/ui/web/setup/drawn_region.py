"""The drawn region: strokes of the mouse, in px of the picture, made into a mask.

The centre of the pixel in column i and row j is at (i, j). A pixel belongs to a shape where its centre lies in it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from acquire.text import Message
from analysis.evaluate import inside_polygon

TOOLS = ("rectangle", "polygon", "brush", "eraser")
MAX_POINTS = 5000
MAX_UNDO = 12
"""Edits that can be undone."""

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


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
