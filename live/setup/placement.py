"""Automatic gauges on the specimen: its extension, its width, its area."""

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
Box = tuple[float, float, float, float]

WIDTH_SHARE = 0.1
"""Length along the load of the gauge across the specimen, over that of the specimen."""
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
    """``extension`` between strips at the two ends of the specimen, ``width`` across it, ``area`` of all its ZOIs.

    Parameters
    ----------
    grid : ZoiGrid
        Its ROI is the box around the specimen, its active ZOIs lie on the specimen.
    axis : "x" or "y"
        Of the load.

    Returns
    -------
    dict of name to table, px
        Without ``width`` if only one ZOI fits across.

    Raises
    ------
    ConfigError
        Fewer than two rows of ZOIs lie along the load.
    """
    frame = _Frame.of(grid, axis)
    rows, columns = (np.flatnonzero(frame.active.any(axis=one)) for one in (1, 0))
    if len(rows) < 2:
        raise ConfigError(
            "gauges cannot be placed: {n} rows of ZOIs lie along the load; take smaller ZOIs or steps, or a larger"
            " region, or leave out gauges = 'auto'",
            len(rows),
        )
    everywhere = frame.box(rows, columns)
    gauges: dict[str, GaugeTable] = {"extension": {"kind": "extension", "box": everywhere}}
    band = _band(frame, rows)
    across = np.flatnonzero(frame.active[band].any(axis=0))
    if len(across) > 1:
        gauges["width"] = {"kind": "transverse", "box": frame.box(band, across)}
    return gauges | {"area": {"kind": "area", "box": everywhere}}


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

    def box(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Box:
        """Around the centres of ZOIs, whole px."""
        top, height = self._side(self.along[rows])
        left, width = self._side(self.across[columns])
        return (top, left, height, width) if self.turned else (left, top, width, height)

    def _side(self, centres: Floats) -> tuple[float, float]:
        low = max(math.floor(centres[0] - self.step / 2), 0)
        return float(low), float(math.ceil(centres[-1] + self.step / 2) - low)


def _band(frame: _Frame, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Rows for the gauge across: nearest to the middle, without those that a hole shortens."""
    counts = frame.active[rows].sum(axis=1)
    rows = rows[counts >= MIN_ROW_SHARE * np.median(counts[counts > 0])]
    low, high = frame.span
    best = rows[np.argmin(abs(frame.along[rows] - (low + high) / 2))]
    half = WIDTH_SHARE / 2 * (high - low)
    near = rows[abs(frame.along[rows] - frame.along[best]) <= half]
    # Rows on both sides of a hole are not one gauge: only consecutive rows.
    pieces = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
    return next(piece for piece in pieces if best in piece)
