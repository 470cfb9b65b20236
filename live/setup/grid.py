"""The grid of ZOIs and the kernel settings of a configuration, and the automatic gauges on that grid."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from analysis.optics import Box, PlateLayout, without_plates
from live.config.gauges import GaugeTable
from live.config.loading import Config
from live.config.values import AUTO, GIVEN
from live.pipeline.reference import numerics_error

if TYPE_CHECKING:
    from analysis import KernelSettings, ZoiGrid

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

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

    def box(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> tuple[float, float, float, float]:
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


def grid_for(config: Config, width: int, height: int, mask: NDArray[np.bool_] | None) -> ZoiGrid:
    """The grid of ZOIs on pictures of ``width`` x ``height`` px, active where ``mask`` (H, W) is True.

    Raises
    ------
    ConfigError
        The ROI leaves the picture, is still "auto", or no ZOI fits into it.
    """
    from analysis import Roi, ZoiGrid

    m = config.measure
    if m.roi == AUTO and m.mask is None:
        raise ConfigError(
            "measure.roi = 'auto' is found by run, check and replay; here give x,y,width,height or 'all'"
        )
    x, y, w, h = m.roi if isinstance(m.roi, tuple) else whole_picture(width, height, m.zoi)
    if x + w > width or y + h > height:
        raise ConfigError(
            "measure.roi = {x},{y},{w},{h} leaves the picture of {width} x {height} px; allowed: x + width <= "
            "{width}, y + height <= {height}",
            x,
            y,
            w,
            h,
            width,
            height,
        )
    try:
        grid = ZoiGrid.cover(Roi(x, y, w, h), size=m.zoi, step=m.step, mask=mask)
    except ValueError as error:
        raise ConfigError("measure: {error}", error) from None
    return without_plates(grid, _boxes(config)) if config.plate else grid


def plates_for(config: Config, grid: ZoiGrid, width: int, height: int) -> PlateLayout | None:
    """The ZOIs of the plates beside those of ``grid`` (``grid_for``); None without plates.

    Raises
    ------
    ConfigError
        A plate leaves the picture of ``width`` x ``height`` px, or no ZOIs fit.
    """
    for name, (x, y, w, h) in _boxes(config).items():
        if x + w > width or y + h > height:
            raise ConfigError(
                "plate.{name}: the box leaves the picture of {width} x {height} px; move it",
                name,
                width,
                height,
            )
    if not config.plate:
        return None
    try:
        return PlateLayout.of(grid, _boxes(config))
    except ValueError as error:
        raise ConfigError("plate: {error}", error) from None


def _boxes(config: Config) -> dict[str, Box]:
    return {name: plate.box for name, plate in config.plate.items() if plate.box is not None}


def whole_picture(width: int, height: int, zoi: int) -> tuple[int, int, int, int]:
    """The region (x, y, width, height) without a ROI: the whole picture except a rim of an eighth of a ZOI.

    A ZOI at the edge would leave the picture with the first small motion.
    """
    rim = zoi // 8
    if min(width, height) < zoi + 2 * rim:
        return 0, 0, width, height
    return rim, rim, width - 2 * rim, height - 2 * rim


def kernel_settings(config: Config) -> KernelSettings:
    """The settings of the kernel; raises ConfigError if they cannot be combined."""
    from analysis import KernelSettings

    m = config.measure
    try:
        return KernelSettings(
            window=cast(Any, m.window),
            estimator=cast(Any, m.estimator),
            order=m.order,
            bending_px=m.bending_px,
        )
    except ValueError as error:
        raise numerics_error(error, "measure") from None
