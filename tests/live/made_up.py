"""Measurements made up for the tests of the outputs: real types, invented numbers."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from acquire.text.quantity import IN_ASCII
from analysis.field.grid import Roi, ZoiGrid
from analysis.field.strain_field import StrainField
from live.pipeline.measurement import Measurement
from live.pipeline.timed.figure import TimedFigure

START = 1000.0
CAMERA = CameraInfo("sim:made-up", "made up", 128, 96, 12, live=False, clock="nominal", fps=10.0)


def make_grid(width: int = 128, height: int = 96, size: int = 32, step: int = 16) -> ZoiGrid:
    """One ZOI is switched off."""
    grid = ZoiGrid.cover(Roi(0, 0, width, height), size=size, step=step)
    active = np.ones(grid.shape, bool)
    active[0, 0] = False
    return grid.subset(active=active)


def make_field(grid: ZoiGrid, strain: float, sigma: float = 1e-5) -> StrainField:
    """Uniaxial tension along y with nu = 0.3, and a ZOI rejected in the last corner."""
    x, y = np.meshgrid(grid.x, grid.y)
    values = {"u": -0.3 * strain * x, "v": strain * y, "du_dx": -0.3 * strain, "dv_dy": strain}
    status = np.where(grid.active, 0, 1)
    status[-1, -1] = 7
    return StrainField.from_values(grid, values, sigma, status=status)


def make_measurement(
    number: int, strain: float = 1e-3, *, grid: ZoiGrid | None = None, force: float = math.nan
) -> Measurement:
    """The k-th of bursts of 8 frames, ten a second."""
    grid = grid or make_grid()
    empty = np.zeros((2, 2))
    burst = Burst(
        mean=frozen(empty.astype(np.float32)),
        n=8,
        noise=2.5,
        clipped=frozen(empty.astype(bool)),
        bits=12,
        t=START + 0.1 * number,
        duration=0.07,
        first_index=8 * number,
        last_index=8 * number + 7,
        lost=1 if number == 3 else 0,
        clock="device",
    )
    return Measurement.of(number, burst, make_field(grid, strain), force)


def figures(**values: float | tuple[float, float]) -> dict[str, TimedFigure]:
    """Live figures by name, each a value or a value with its sigma; one that is NaN is unknown."""
    pairs = {name: one if isinstance(one, tuple) else (one, math.nan) for name, one in values.items()}
    return {
        name: TimedFigure.at(0.0, 0.0, value, sigma, why="lost") for name, (value, sigma) in pairs.items()
    }


def make_frame(index: int, t: float, shape: tuple[int, int] = (96, 128)) -> Frame:
    """A 12 bit ramp."""
    image = np.linspace(0, 4095, shape[0] * shape[1]).reshape(shape).astype(np.uint16)
    return Frame(frozen(image), index, t, "device", 0, 12, t)


def make_loads(until: float, force: Callable[[float], float], rate: float = 100.0) -> LoadLog:
    """A log of force(time since START), from START to START + until."""
    log = LoadLog()
    for k in range(round(until * rate) + 1):
        log.append(LoadSample(START + k / rate, force(k / rate)))
    return log


def in_ascii(text: str) -> str:
    """The text as a terminal without other letters shows it."""
    return text.translate(IN_ASCII)
