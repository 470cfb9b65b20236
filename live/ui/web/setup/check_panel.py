"""The check of the still specimen as the page shows it: plain values and colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.frame import CameraInfo, Frame
from acquire.text.printable import printable
from live.setup.check.check_line import CheckLine
from live.setup.check.check_list import CheckFigures
from live.setup.check.sample import FrameStack
from live.ui.web.painting import traffic_light

GOOD, BAD = 50e-6, 1000e-6
"""Strain noise of a ZOI that is shown green, and that is shown red."""


def frame_stack(frames: Sequence[Frame], info: CameraInfo) -> FrameStack:
    """Consecutive frames as the input of the check."""
    lost = sum(frame.lost_before for frame in frames[1:])
    return FrameStack(np.stack([f.image for f in frames]), np.array([f.t for f in frames]), lost, info)


def quality_colours(figures: CheckFigures) -> NDArray[np.uint8]:
    """Colours of the ZOIs by their predicted strain noise; transparent outside the region."""
    cells = traffic_light(figures.zois.sigma, GOOD, BAD)
    cells[~figures.zois.grid.active] = 0
    return cells


def camera_values(info: CameraInfo) -> dict[str, Any]:
    """The camera, and its settings that can be changed."""
    return {
        "name": printable(info.name),
        "width": info.width,
        "height": info.height,
        "bits": info.bits,
        "fps": info.fps,
        "format": printable(info.pixel_format),
        "formats": [printable(name) for name in info.formats],
        "rates": info.rates,
        "sliders": [asdict(setting) for setting in info.settings],
        "warnings": [printable(text) for text in info.warnings],
    }


def line_values(line: CheckLine) -> dict[str, Any]:
    """A line of the check."""
    return {
        "what": line.what,
        "value": printable(line.value),
        "good": line.good,
        "advice": printable(line.advice),
        "measured": line.measured,
    }


def table_values(figures: CheckFigures) -> dict[str, Any]:
    """The strain noise of one ZOI by its size and the burst, at the order of the test."""
    bursts = sorted({noise.burst for floor in figures.floors for noise in floor.noises})
    rows = [
        {
            "zoi": floor.zoi,
            "order": floor.order,
            "vsg": floor.vsg,
            "l10": floor.l10,
            "noise": [None if (noise := floor.of(n)) is None else noise.known for n in bursts],
        }
        for floor in figures.floors
        if floor.order == figures.order
    ]
    return {"bursts": bursts, "rows": rows, "zoi": figures.zoi, "burst": figures.burst}


def figure_values(figures: CheckFigures) -> dict[str, Any]:
    """The figures that change while lens and light are adjusted."""
    sigma = figures.zois.sigma[np.isfinite(figures.zois.sigma)]
    return {
        "sharpness": figures.sharpness,
        "saturated": figures.exposure.saturated,
        "light": figures.exposure.high,
        "noise_GL": figures.noise,
        "sigma": float(np.median(sigma)) if sigma.size else None,
        "zois": figures.zois.grid.n_active,
    }
