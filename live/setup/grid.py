"""The grid of ZOIs and the kernel settings of a configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from analysis.optics import Box, PlateLayout, without_plates
from live.config.loading import Config
from live.config.values import AUTO
from live.pipeline.reference import numerics_error

if TYPE_CHECKING:
    from analysis import KernelSettings, ZoiGrid


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
