"""Automatic gauges on the specimen: an axial line, a transverse gauge, an area."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from live.config.gauges import GaugeTable
from live.config.loading import Config
from live.config.values import AUTO, GIVEN

if TYPE_CHECKING:
    from analysis import ZoiGrid

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Point = tuple[float, float]
Box = tuple[float, float, float, float]

AXIAL_SHARE = 0.8
"""Length of the axial line over the length of the specimen."""
TRANSVERSE_SHARE = 0.1  # height of the transverse gauge over the length of the specimen
MIN_ROW_SHARE = 0.9  # of the median number of ZOIs across: a row beside a hole has fewer


def with_auto_gauges(config: Config, grid: ZoiGrid) -> Config:
    """The configuration with the gauges that ``measure.gauges = "auto"`` adds; its own gauges take precedence.

    Raises
    ------
    ConfigError
        There are too few ZOIs.
    """
    if config.measure.gauges != AUTO:
        return config
    gauges = {**auto_gauges(grid, config.specimen.first_axis), **config.gauges}
    return replace(config, gauges=gauges, measure=replace(config.measure, gauges=GIVEN))


def auto_gauges(grid: ZoiGrid, axis: str) -> dict[str, GaugeTable]:
    """``axial`` over 80 % of the specimen, ``transverse`` across it, ``area`` between the ends of axial.

    Parameters
    ----------
    grid : ZoiGrid
        Its ROI is the box around the specimen, its active ZOIs lie on the specimen.
    axis : "x" or "y"
        Of the load.

    Returns
    -------
    dict of name to table, px
        Without ``transverse`` if only one ZOI fits across.

    Raises
    ------
    ConfigError
        Fewer than two ZOIs lie along the load.
    """
    frame = _Frame.of(grid, axis)
    first, last = _ends(frame)
    between = slice(first, last + 1)
    columns = np.flatnonzero(frame.active[between].any(axis=0))
    gauges = {"axial": _axial(frame, first, last)}
    band = _band(frame, first, last)
    across = np.flatnonzero(frame.active[band].any(axis=0))
    if len(across) > 1:
        gauges["transverse"] = {"kind": "transverse", "box": frame.box(band, across)}
    gauges["area"] = {"kind": "area", "box": frame.box(np.arange(first, last + 1), columns)}
    return gauges


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """A grid, turned so that its rows are ordered along the load."""

    active: Bools
    along: Floats
    across: Floats
    span: tuple[float, float]
    step: int
    turned: bool

    @classmethod
    def of(cls, grid: ZoiGrid, axis: str) -> _Frame:
        roi = grid.roi
        if axis == "x":
            return cls(grid.active.T, grid.x, grid.y, (roi.x, roi.x + roi.width), grid.step, True)
        return cls(grid.active, grid.y, grid.x, (roi.y, roi.y + roi.height), grid.step, False)

    def point(self, row: int, column: int) -> Point:
        along, across = float(self.along[row]), float(self.across[column])
        return (along, across) if self.turned else (across, along)

    def box(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Box:
        """Around the centres of ZOIs, whole px."""
        top, height = self._side(self.along[rows])
        left, width = self._side(self.across[columns])
        return (top, left, height, width) if self.turned else (left, top, width, height)

    def _side(self, centres: Floats) -> tuple[float, float]:
        low = max(math.floor(centres[0] - self.step / 2), 0)
        return float(low), float(math.ceil(centres[-1] + self.step / 2) - low)


def _ends(frame: _Frame) -> tuple[int, int]:
    """The rows of ZOIs nearest to 10 % and 90 % of the length."""
    rows = np.flatnonzero(frame.active.any(axis=1))
    if len(rows) < 2:
        raise ConfigError(
            f"gauges cannot be placed: {len(rows)} rows of ZOIs lie along the load;"
            " take smaller ZOIs or steps, or a larger region"
        )
    low, high = frame.span
    rim = (1 - AXIAL_SHARE) / 2 * (high - low)
    first, last = (int(rows[np.argmin(abs(frame.along[rows] - at))]) for at in (low + rim, high - rim))
    return (first, last) if first < last else (int(rows[0]), int(rows[-1]))


def _axial(frame: _Frame, first: int, last: int) -> GaugeTable:
    """On the middle line of the specimen, or as near to it as there is a ZOI at both ends."""
    middle = float(np.average(frame.across, weights=frame.active.sum(axis=0)))
    both = frame.active[first] & frame.active[last]
    ends = [both, both] if both.any() else [frame.active[first], frame.active[last]]
    columns = [_nearest(np.flatnonzero(end), frame.across, middle) for end in ends]
    start, end = frame.point(first, columns[0]), frame.point(last, columns[1])
    return {"kind": "line", "start": start, "end": end}


def _nearest(columns: NDArray[np.intp], across: Floats, middle: float) -> int:
    return int(columns[np.argmin(abs(across[columns] - middle))])


def _band(frame: _Frame, first: int, last: int) -> NDArray[np.intp]:
    """Rows for the transverse gauge: nearest to the middle, without those that a hole shortens."""
    rows = np.arange(first, last + 1)
    counts = frame.active[rows].sum(axis=1)
    rows = rows[counts >= MIN_ROW_SHARE * np.median(counts[counts > 0])]
    low, high = frame.span
    best = rows[np.argmin(abs(frame.along[rows] - (low + high) / 2))]
    half = TRANSVERSE_SHARE / 2 * (high - low)
    near = rows[abs(frame.along[rows] - frame.along[best]) <= half]
    # Rows on both sides of a hole are not one gauge: only consecutive rows.
    pieces = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
    return next(piece for piece in pieces if best in piece)
