"""All figures of a check, and the table of strain noise as text.

Only the region counts: the surroundings of the specimen have no influence.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.load_cell.check import LoadReport
from acquire.text import Message
from acquire.text.quantity import number
from analysis.picture.pattern import BLOCKS, blockiness
from analysis.quality.pattern import Depth, Exposure, depth, exposure, speckle_radius, zoi_pattern
from live.config.loading import Config
from live.setup.check.noise_floor import (
    BURSTS,
    ORDERS,
    SIZES,
    GaugeNoise,
    PredictedNoise,
    StrainNoise,
    ZoiFloor,
    noise_floors,
    predict_noise,
)
from live.setup.check.sample import CheckRegion, CheckSample, FrameStack
from live.setup.check.stillness import PictureStillness, light, stillness
from live.setup.lens import lens_for, lens_words
from live.setup.pictures import correction
from live.setup.region import Region, region_of

if TYPE_CHECKING:
    from analysis import ZoiGrid

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Zois:
    """The ZOIs of the test.

    Attributes
    ----------
    grid : ZoiGrid
        On the whole picture.
    sigma : (R, C) float64
        Predicted strain noise of each for one burst of the test; NaN without pattern.
    contrast : (R, C) float64, GL
        Standard deviation of the pattern within each, corrected for noise.
    sssig : (R, C) float64, GL^2/px^2
        Sum of squares of the gradient in each, the smaller one of x and y.
    sharpness : (R, C) float64, 1/px
        rms gradient over contrast: 0.7 over the radius for blobs, higher for sharp edges, lower out of focus.
    """

    grid: ZoiGrid
    sigma: Floats
    contrast: Floats
    sssig: Floats
    sharpness: Floats

    @property
    def without_pattern(self) -> float:
        """Share of the ZOIs that cannot be measured."""
        active = self.grid.active
        return 1 - float(np.isfinite(self.sigma[active]).mean()) if active.any() else 1.0


@dataclass(frozen=True, slots=True, eq=False)
class CheckFigures:
    """The figures of a check.

    Attributes
    ----------
    region : Region
    stack : FrameStack
    noise : float, GL
        Noise of one frame, at the ZOIs.
    exposure : Exposure
    depth : Depth
    radius : float, px
        Radius of the speckle.
    zois : Zois
    still : PictureStillness
    floors : tuple of ZoiFloor
    zoi, order, burst : int
        Settings of the test.
    repetition : str
        What repeats in the pattern, and what that allows; empty where nothing does.
    noise_stated : bool
        Whether the noise was given; else too few frames take it from the spectrum of the picture.
    removed : float or None, GL
        Standard deviation of the correction by dark and flat frame; None without them.
    gauges : tuple of GaugeNoise
        The gauges of the test, and the mean of all ZOIs along the load.
    load : LoadReport or None
    px_per_mm : float or None
    blocks : bool
        Whether the picture shows the blocks of a codec.
    picture : str
        What else it shows beyond its noise, in words; "": nothing.
    lens : str
        What a corrected lens does to the strain of the region, in words; "": none is corrected.
    """

    region: Region
    stack: FrameStack
    noise: float
    exposure: Exposure
    depth: Depth
    radius: float
    zois: Zois
    still: PictureStillness
    floors: tuple[ZoiFloor, ...]
    zoi: int
    order: int
    burst: int
    repetition: str = ""
    noise_stated: bool = False
    removed: float | None = None
    gauges: tuple[GaugeNoise, ...] = ()
    load: LoadReport | None = None
    px_per_mm: float | None = None
    blocks: bool = False
    picture: str = ""
    lens: str = ""

    @property
    def automatic(self) -> tuple[str, ...]:
        """Controls that the camera changes automatically."""
        return automatic_controls(self.stack.camera.controls)

    @property
    def floor(self) -> ZoiFloor | None:
        """The noise floor at the settings of the test; None if it was not measured."""
        same = [f for f in self.floors if (f.zoi, f.order) == (self.zoi, self.order) and f.noises]
        return same[0] if same else None

    @property
    def sharpness(self) -> float:
        """Median over the ZOIs, 1/px."""
        return median(self.zois.sharpness)


@dataclass(frozen=True, slots=True, eq=False)
class KernelFigures:
    """The slower figures, which need the kernel."""

    predicted: PredictedNoise
    still: PictureStillness

    @classmethod
    def of(cls, sample: CheckSample) -> KernelFigures:
        """Measure them all."""
        predicted = predict_noise(sample)
        return cls(predicted, stillness(sample, predicted.measurable))


def examine(
    stack: FrameStack, config: Config, load: LoadReport | None = None, table: bool = True
) -> CheckFigures:
    """All figures from frames of a still specimen.

    Parameters
    ----------
    stack : FrameStack
    config : Config
    load : LoadReport, optional
    table : bool
        Whether to measure all ZOIs, orders and bursts of the table, or only those of the test.

    Raises
    ------
    ConfigError, DataError
        Region, mask, dark or flat frame do not fit.
    """
    sample = CheckSample.of(stack, CheckRegion.of(find_region(stack, config), config, stack.camera))
    m = config.measure
    sizes, orders, bursts = (SIZES, ORDERS, BURSTS) if table else ((), (), ())
    wanted = (*sizes, m.zoi), (*orders, m.order), (*bursts, sample.burst)
    figures = figures_of(sample, KernelFigures.of(sample), noise_floors(sample, *wanted), load)
    lens = lens_for(config, stack.camera.width, stack.camera.height, sample.check_region.grid)
    return figures if lens is None else replace(figures, lens=lens_words(lens, sample.check_region.grid))


def find_region(stack: FrameStack, config: Config) -> Region:
    """The region of a test on the mean of the frames, or on the first of too few."""
    picture = correction(config, stack.camera)(stack.mean(0, 1 if stack.few else None))
    return region_of(config, picture.mean, stack.noise())


def figures_of(
    sample: CheckSample,
    measured: KernelFigures,
    floors: tuple[ZoiFloor, ...] = (),
    load: LoadReport | None = None,
) -> CheckFigures:
    """All figures: those of the kernel, and those that follow from the frames directly."""
    check_region, m, camera = sample.check_region, sample.check_region.config.measure, sample.stack.camera
    same = sample.picture.mean is sample.raw
    return CheckFigures(
        region=check_region.region,
        stack=sample.stack,
        noise=sample.noise,
        exposure=exposure(sample.pixels, camera.saturation),
        depth=depth(sample.pixels, camera.bits),
        radius=_radius(sample),
        zois=_zois(sample, measured.predicted.sigma),
        still=replace(measured.still, light=light(sample)),
        floors=floors,
        zoi=m.zoi,
        order=m.order,
        burst=sample.burst,
        repetition=measured.predicted.repetition,
        noise_stated=m.noise_GL is not None,
        removed=None if same else float((sample.picture.mean - sample.raw)[check_region.inside].std()),
        gauges=measured.predicted.gauges,
        load=load,
        px_per_mm=check_region.config.scale.px_per_mm,
        blocks=blockiness(sample.raw) > BLOCKS,
        picture=measured.predicted.picture,
    )


def automatic_controls(controls: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the controls that are automatic, judged by name and value."""
    return tuple(name for name, value in controls.items() if _is_automatic(name.lower(), value))


def _is_automatic(name: str, value: object) -> bool:
    if isinstance(value, str):
        words = value.lower()
        return (
            "auto" in name
            and "manual" not in words
            and "shutter" not in words
            and words not in ("disabled", "off")
        )
    named = "auto" in name or "continuous" in name or "dynamic_framerate" in name
    # 1 is "manual" for the exposure of V4L2, but that menu has texts; here a number is a switch.
    return named and isinstance(value, int | float) and bool(value)


def median(values: Floats) -> float:
    """Median of the finite values; NaN if there is none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan


def _radius(sample: CheckSample) -> float:
    at_zois = sample.check_region.at_zois[sample.check_region.cut]
    rows, columns = np.flatnonzero(at_zois.any(axis=1)), np.flatnonzero(at_zois.any(axis=0))
    if not rows.size:
        return math.nan
    cut = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    noise = sample.noise / math.sqrt(sample.picture.n)
    return speckle_radius(sample.picture.mean[cut], noise, at_zois[cut])


def _zois(sample: CheckSample, sigma: Floats) -> Zois:
    """The pattern of each ZOI, with its predicted strain noise."""
    grid = sample.check_region.zois
    found = zoi_pattern(sample.picture.mean, grid, sample.noise / math.sqrt(sample.picture.n))
    with np.errstate(invalid="ignore", divide="ignore"):
        sharpness = np.sqrt((found.along_x + found.along_y) / (2 * grid.size**2) / found.variance)
    contrast, weaker = np.sqrt(found.variance), np.minimum(found.along_x, found.along_y)
    for values in (contrast, weaker, sharpness):
        values[~grid.active] = np.nan
    return Zois(sample.check_region.grid, sigma, contrast, weaker, sharpness)


def table_lines(figures: CheckFigures) -> list[str]:
    """The table of measured and (predicted) strain noise of one ZOI, um/m; * marks the settings of the test."""
    bursts = sorted({noise.burst for floor in figures.floors for noise in floor.noises})
    scale = figures.px_per_mm
    unit = "px" if scale is None else "mm"
    head = Message("  ZOI order {l10:>9} {vsg:>7}  ", f"l_10% {unit}", f"VSG {unit}")
    head += "".join(f"{n:>15}" for n in bursts)
    reference = figures.floors[0].reference if figures.floors else 0
    return [
        Message(
            "strain noise of one ZOI, µm/m: measured (predicted) for bursts of so many frames, reference of {n}",
            reference,
        ),
        head,
        *(_row(floor, bursts, figures) for floor in figures.floors),
    ]


def _row(floor: ZoiFloor, bursts: list[int], figures: CheckFigures) -> str:
    factor, digits = (1.0, 0) if figures.px_per_mm is None else (1 / figures.px_per_mm, 2)
    of_test = (floor.zoi, floor.order) == (figures.zoi, figures.order)
    lengths = f"{floor.l10 * factor:>9.{digits}f} {floor.vsg * factor:>7.{digits}f}"
    front = f"{'*' if of_test else ' '} {floor.zoi:>3} {floor.order:>5} {lengths}  "
    if not floor.noises:
        return front + Message("   does not fit, or has no pattern")
    return front + "".join(f"{_cell(floor.of(n)):>15}" for n in bursts)


def _cell(noise: StrainNoise | None) -> str:
    if noise is None:
        return "-"
    return f"{number(noise.measured * 1e6)} ({number(noise.predicted * 1e6)})"
