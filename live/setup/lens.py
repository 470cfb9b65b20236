"""The lens of a configuration, as ``phasedic lens`` calibrated it, checked against the pictures that it corrects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acquire.errors import ConfigError
from acquire.text import Message
from analysis.optics import LensModel, strain_of_shift
from live.config.loading import Config
from live.config.sections import LensConfig

if TYPE_CHECKING:
    from analysis import ZoiGrid

SHOWN_SHIFT_PX = 10.0
"""Motion for which check and calibration give the strain that a lens makes."""


def lens_for(config: Config, width: int, height: int, grid: ZoiGrid) -> LensModel | None:
    """The lens for the ZOIs of ``grid`` on pictures of ``width`` x ``height`` px; None where none is given.

    Raises
    ------
    ConfigError
        It was calibrated for other pictures or another part of them, or is no lens.
    """
    given = config.lens
    if given.focal_px is None:
        return None
    lens = _lens(given)
    if given.picture is not None and given.picture != (width, height):
        raise ConfigError(
            "lens: calibrated with pictures of {picture} x {picture2} px, these have {width} x {height}; "
            "calibrate with the same format, or take --no-lens",
            given.picture[0],
            given.picture[1],
            width,
            height,
        )
    x, y = np.meshgrid(grid.x, grid.y)
    x, y = x[grid.active], y[grid.active]
    if given.box is not None and not _inside(given.box, x, y):
        left, top, across, down = given.box
        raise ConfigError(
            "lens: ZOIs leave the calibrated part, {left:.0f},{top:.0f} to {left2:.0f},{top2:.0f} px; "
            "calibrate the whole region, or take a smaller --roi or --no-lens",
            left,
            top,
            left + across,
            top + down,
        )
    if not lens.is_single_valued(x, y):
        raise ConfigError("lens: its terms fold the picture at the ZOIs; calibrate again")
    return lens


def _lens(given: LensConfig) -> LensModel:
    if given.centre is None:
        raise ConfigError("lens: give centre = [x, y] in px beside focal_px")
    parameters = np.array([given.focal_px, *given.centre, given.k1, given.k2, given.p1, given.p2, given.k3])
    n = len(parameters)
    return LensModel(parameters, np.zeros((n, n)) if given.covariance is None else np.array(given.covariance))


def _inside(box: tuple[float, float, float, float], x: np.ndarray, y: np.ndarray) -> bool:
    left, top, width, height = box
    return bool(x.min() >= left and x.max() <= left + width and y.min() >= top and y.max() <= top + height)


def lens_words(lens: LensModel, grid: ZoiGrid) -> str:
    """What the lens does to the strain of the region, and how well that is known."""
    strain, sigma = strain_of_shift(lens, grid, SHOWN_SHIFT_PX)
    return Message(
        "a shift of {SHOWN_SHIFT_PX:g} px shows {strain:.1f} µm/m in the region; removed, known to "
        "{sigma:.2g} µm/m",
        SHOWN_SHIFT_PX,
        strain * 1e6,
        sigma * 1e6,
    )
