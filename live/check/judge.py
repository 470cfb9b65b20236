"""The lines of the check: each figure, whether it is good enough, and what to do."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquire.errors import DataError
from acquire.frame import CameraInfo
from live.check.check import LEAST_CONTRAST, MOST_CLIPPED, MOST_FLICKER, MOST_WITHOUT_PATTERN, RADIUS_PX
from live.measure import Reference, averaged, frame_noise, prepare
from live.setup import DEFAULT_BURST, Config, grid_for, kernel_settings, read_mask


@dataclass(frozen=True, slots=True)
class Line:
    """One figure of the check, whether it is good enough, and what to do where it is not."""

    what: str
    value: str
    good: bool
    advice: str = ""

    def text(self) -> str:
        """The line for a person."""
        return f"{'ok  ' if self.good else 'LOOK'}  {self.what:<22} {self.value}" + (
            "" if self.good else f"\n      -> {self.advice}"
        )


def judge(
    taken: Reference, means: list[float], camera: CameraInfo, config: Config, target: float | None
) -> list[Line]:
    """All lines of the check.

    Parameters
    ----------
    taken : Reference
        With its halves.
    means : list of float, GL
        Mean level of each frame.
    camera : CameraInfo
    config : Config
    target : float or None, um/m
        Strain noise of one ZOI that the test needs.
    """
    from analysis.picture import describe_pattern

    full = float(2**camera.bits - 1)
    noise = frame_noise(taken.burst, config.measure.noise_GL)
    report = describe_pattern(taken.burst.mean, camera.bits, averaged(noise, taken.burst.n))
    lines = _light(taken, means, full, noise)
    lines.append(
        Line("contrast (std)", f"{report.contrast / full:.1%} of full scale", report.contrast > LEAST_CONTRAST * full,
             "more light, a longer exposure, or a pattern of blacker black and whiter white")
    )  # fmt: skip
    low, high = RADIUS_PX
    advice = (
        "finer speckle or a wider field of view"
        if report.speckle_radius > high
        else "coarser speckle, or focus"
    )
    lines.append(
        Line("speckle radius", f"{report.speckle_radius:.2f} px (best from 1.5 to 4)",
             low <= report.speckle_radius <= high, advice)
    )  # fmt: skip
    return lines + _floor(taken, camera, config, target)


def _light(taken: Reference, means: list[float], full: float, noise: float | None) -> list[Line]:
    level, clipped = float(taken.burst.mean.mean()) / full, float(taken.burst.clipped.mean())
    flicker = float(np.std(means)) / max(float(np.mean(means)), 1e-9)
    shown = "not known" if noise is None else f"{noise:.2f} GL, {noise / full:.2%} of full scale"
    return [
        Line("mean level", f"{level:.0%} of full scale", 0.1 < level < 0.85, "change exposure, light or aperture"),
        Line("saturated pixels", f"{clipped:.3%}", clipped <= MOST_CLIPPED, "less exposure or light, no glare"),
        Line("flicker", f"{flicker:.2%} of the level", flicker <= MOST_FLICKER,
             "use a steady lamp, or an exposure of whole periods of the mains"),
        Line("noise of one frame", shown, noise is not None, "every frame is the same: is this a live picture?"),
    ]  # fmt: skip


def _floor(taken: Reference, camera: CameraInfo, config: Config, target: float | None) -> list[Line]:
    """Pattern and motion ZOI by ZOI, and the strain noise floor for the bursts of the test."""
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    grid = grid_for(config, camera.width, camera.height, mask)
    assert taken.halves is not None
    first, second = taken.halves
    settings = kernel_settings(config)
    try:
        kernel, noise = prepare(first, grid, settings, config.measure.noise_GL)
    except DataError as error:
        return [Line("pattern", str(error), False, "spray a pattern, set focus and exposure")]
    field = kernel.measure(second.mean, noise=averaged(noise, second.n))
    lost = 1 - float(np.isfinite(field.u).sum()) / max(int(grid.active.sum()), 1)
    if lost == 1:
        return [Line("ZOIs without pattern", "all", False, "spray a pattern, set focus and exposure")]
    shift = math.hypot(float(np.nanmedian(field.u)), float(np.nanmedian(field.v)))
    n = config.measure.burst or DEFAULT_BURST
    # Here both halves carry the noise; in the test the burst does, the long reference hardly.
    scale = math.sqrt(first.n / 2 / n) * 1e6
    measured, predicted = float(np.nanstd(field.eyy)) * scale, float(np.nanmedian(field.sigma_eyy)) * scale
    floor = (
        f"{measured:.0f} um/m measured, {predicted:.0f} predicted (one ZOI of {grid.size} px, burst of {n})"
    )
    honest = measured < 1.5 * predicted
    enough = target is None or measured <= target
    advice = "something moves or flickers between the halves: vibration, air, lamp"
    if honest:
        advice = f"more than the {target} um/m asked for: larger ZOIs, longer bursts, more light"
    return [
        Line("ZOIs without pattern", f"{lost:.1%} of {int(grid.active.sum())}", lost <= MOST_WITHOUT_PATTERN,
             "restrict them with --roi or --mask, or take larger ZOIs"),
        Line("motion in the burst", f"{shift:.4f} px", shift <= config.measure.reference_shift_px,
             "keep specimen and camera still"),
        Line("strain noise floor", floor, honest and enough, advice),
    ]  # fmt: skip
