"""The table of the strain noise, in words: ZOIs and orders down, bursts across."""

from __future__ import annotations

import math

from live.check.figures import Figures
from live.check.floor import Floor, Noise


def table_lines(figures: Figures) -> list[str]:
    """Measured and (predicted) strain noise of one ZOI, um/m; * are the settings of the test."""
    bursts = sorted({noise.burst for floor in figures.floors for noise in floor.noises})
    scale = figures.px_per_mm
    unit = "px" if scale is None else "mm"
    head = f"  ZOI order {f'l_10% {unit}':>9} {f'VSG {unit}':>7}  " + "".join(f"{n:>15}" for n in bursts)
    reference = figures.floors[0].reference if figures.floors else 0
    return [
        f"strain noise of one ZOI, um/m: measured (predicted) for bursts of so many frames, reference of {reference}",
        head,
        *(_row(floor, bursts, figures) for floor in figures.floors),
    ]


def _row(floor: Floor, bursts: list[int], figures: Figures) -> str:
    factor, digits = (1.0, 0) if figures.px_per_mm is None else (1 / figures.px_per_mm, 2)
    ours = (floor.zoi, floor.order) == (figures.zoi, figures.order)
    lengths = f"{floor.l10 * factor:>9.{digits}f} {floor.vsg * factor:>7.{digits}f}"
    front = f"{'*' if ours else ' '} {floor.zoi:>3} {floor.order:>5} {lengths}  "
    if not floor.noises:
        return front + "   does not fit, or has no pattern"
    return front + "".join(f"{_cell(floor.of(n)):>15}" for n in bursts)


def _cell(noise: Noise | None) -> str:
    if noise is None:
        return "-"
    measured = f"{noise.measured * 1e6:.0f}" if math.isfinite(noise.measured) else "-"
    return f"{measured} ({noise.predicted * 1e6:.0f})"
