"""Places on a picture: which ZOIs lie there, and lines to draw."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.field import ZoiGrid

Point = tuple[float, float]
Box = tuple[float, float, float, float]
Line = tuple[Point, ...]
Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]

_ROUND = 24  # corners of a circle that is drawn


def zois_near(grid: ZoiGrid, place: Point, reach: float) -> Mask:
    """Centres within ``reach``, or else the nearest one if it is at most a step away along x and y."""
    x, y = np.meshgrid(grid.x, grid.y)
    distance = np.hypot(x - place[0], y - place[1])
    here = distance <= reach
    if not here.any():
        k = np.unravel_index(int(np.argmin(distance)), distance.shape)
        here[k] = max(abs(x[k] - place[0]), abs(y[k] - place[1])) <= grid.step
    return np.asarray(here)


def zois_inside(grid: ZoiGrid, corners: Sequence[Point]) -> Mask:
    """Centres inside a polygon."""
    x, y = np.meshgrid(grid.x, grid.y)
    return inside_polygon(x, y, corners)


def inside_polygon(x: Floats, y: Floats, corners: Sequence[Point] | Floats) -> Mask:
    """Points inside a polygon: a ray to the left crosses its sides an odd number of times."""
    odd = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(corners, (*corners[1:], corners[0]), strict=True):
        if y0 == y1:
            continue
        between = (np.minimum(y0, y1) <= y) & (y < np.maximum(y0, y1))
        odd ^= between & (x0 + (y - y0) * (x1 - x0) / (y1 - y0) <= x)
    return odd


def corners_of(box: Box) -> tuple[Point, ...]:
    """Corners of a box x, y, width, height."""
    x, y, width, height = box
    return (x, y), (x + width, y), (x + width, y + height), (x, y + height)


def ends_of(box: Box, along: str, share: float) -> tuple[Box, Box]:
    """The first and the last ``share`` of a box along x or y."""
    x, y, width, height = box
    if along == "x":
        end = share * width
        return (x, y, end, height), (x + width - end, y, end, height)
    end = share * height
    return (x, y, width, end), (x, y + height - end, width, end)


def closed(corners: Line) -> Line:
    """A line around ``corners``."""
    return (*corners, corners[0])


def circle(place: Point, radius: float) -> Line:
    """A closed line around ``place``."""
    angles = np.linspace(0, 2 * math.pi, _ROUND + 1)
    return tuple((place[0] + radius * math.cos(a), place[1] + radius * math.sin(a)) for a in angles)


def near_px(place: Point) -> Point:
    """To a tenth of a pixel: as exact as a person drags."""
    return round(float(place[0]), 1), round(float(place[1]), 1)


def box_between(one: Point, other: Point) -> Box:
    """The box between two opposite corners, whole px within the picture."""
    (x0, x1), (y0, y1) = (sorted((round(one[k]), round(other[k]))) for k in (0, 1))
    x0, y0 = max(x0, 0), max(y0, 0)
    return float(x0), float(y0), float(max(x1 - x0, 1)), float(max(y1 - y0, 1))
