"""All figures of a check, judged inside the region alone: what surrounds the specimen decides nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.load_cell.check import LoadReport
from analysis.picture import autocorrelation_fwhm, sssig
from analysis.quality import Depth, Exposure, depth, exposure
from live.check.floor import BURSTS, ORDERS, SIZES, Bench, Floor, noise_floors
from live.check.shots import Shots
from live.check.stillness import Stillness, stillness
from live.measure import averaged, prepare
from live.setup import (
    DEFAULT_BURST,
    DEFAULT_REFERENCE_BURST,
    Config,
    correction,
    gauges_for,
    kernel_settings,
)
from live.specimen import Region, region_of, with_auto_gauges

if TYPE_CHECKING:
    from analysis import StrainField, ZoiGrid

Floats = NDArray[np.float64]

FWHM_OF_RADIUS = 4 * math.sqrt(math.log(2))
PIXELS_LOOKED_AT = 200_000  # of each frame, for light and bits


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
        Standard deviation of the pattern within each, its noise taken out.
    sssig : (R, C) float64, GL^2/px^2
        Sum of squares of the gradient in each, of x or y the smaller.
    sharpness : (R, C) float64, 1/px
        rms gradient over contrast: 0.7 over the radius for blobs, more for sharp edges, less out of focus.
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


@dataclass(frozen=True, slots=True)
class GaugeNoise:
    """Predicted strain noise of a gauge for one burst of the test; NaN with the reason."""

    name: str
    sigma: float
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Figures:
    """What a check has found.

    Attributes
    ----------
    region : Region
    shots : Shots
    noise : float, GL
        Of one frame, in the region.
    exposure : Exposure
    depth : Depth
    radius : float, px
        Of the speckle.
    zois : Zois
    still : Stillness
    floors : tuple of Floor
    zoi, order, burst : int
        Of the test.
    removed : float or None, GL
        Standard deviation of what dark and flat frame took out; None without them.
    gauges : tuple of GaugeNoise
        Those of the test, and the mean of all ZOIs along the load.
    load : LoadReport or None
    px_per_mm : float or None
    """

    region: Region
    shots: Shots
    noise: float
    exposure: Exposure
    depth: Depth
    radius: float
    zois: Zois
    still: Stillness
    floors: tuple[Floor, ...]
    zoi: int
    order: int
    burst: int
    removed: float | None = None
    gauges: tuple[GaugeNoise, ...] = ()
    load: LoadReport | None = None
    px_per_mm: float | None = None

    @property
    def automatic(self) -> tuple[str, ...]:
        """Controls that the camera changes by itself."""
        return automatic_controls(self.shots.camera.controls)

    @property
    def floor(self) -> Floor | None:
        """The floor of the settings of the test; None where it could not be had."""
        same = [f for f in self.floors if (f.zoi, f.order) == (self.zoi, self.order) and f.noises]
        return same[0] if same else None

    @property
    def sharpness(self) -> float:
        """Median over the ZOIs, 1/px."""
        return median(self.zois.sharpness)


def examine(
    shots: Shots,
    config: Config,
    load: LoadReport | None = None,
    table: bool = True,
    region: Region | None = None,
) -> Figures:
    """Judge frames of a still specimen.

    Parameters
    ----------
    shots : Shots
    config : Config
    load : LoadReport, optional
    table : bool
        Whether all ZOIs, orders and bursts of the table are tried, or those of the test alone.
    region : Region, optional
        Where it is known already; then no noise is measured either, only predicted: for a glance.

    Raises
    ------
    ConfigError, DataError
        Region, mask, dark or flat do not fit.
    """
    m, camera = config.measure, shots.camera
    correct = correction(config, camera)
    raw = shots.mean()
    whole = correct(raw)
    glance = region is not None
    region = region or region_of(config, whole.mean, averaged(shots.noise() or None, len(shots)))
    inside = region.inside(camera.width, camera.height, m.zoi)
    grid = region.grid(config, camera.width, camera.height)
    at_zois = _inner_halves(grid, inside)
    noise = m.noise_GL if m.noise_GL is not None else shots.noise(at_zois)
    reference, burst = m.reference_burst or DEFAULT_REFERENCE_BURST, m.burst or DEFAULT_BURST
    bench = Bench(shots, inside, at_zois, kernel_settings(config), noise, reference, correct)
    pixels = _pixels(shots, at_zois)
    field = _half_on_half(bench, grid)
    factor = math.sqrt((1 / reference + 1 / burst) / (2 / bench.half))
    sizes, orders, bursts = (SIZES, ORDERS, BURSTS) if table else ((), (), ())
    return Figures(
        region=region,
        shots=shots,
        noise=noise,
        exposure=exposure(pixels, camera.bits),
        depth=depth(pixels, camera.bits),
        radius=_radius(whole.mean, noise, len(shots), at_zois),
        zois=_zois(bench, grid, whole.mean, _sigma(field, grid, factor)),
        still=_still(bench, grid),
        floors=() if glance else noise_floors(bench, (*sizes, m.zoi), (*orders, m.order), (*bursts, burst)),
        zoi=m.zoi,
        order=m.order,
        burst=burst,
        removed=None if whole is raw else float((whole.mean - raw.mean)[inside].std()),
        gauges=tuple(_gauges(config, grid, field, factor)),
        load=load,
        px_per_mm=config.scale.px_per_mm,
    )


def automatic_controls(controls: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the controls that are automatic by their name and value."""
    return tuple(name for name, value in controls.items() if _is_automatic(name.lower(), value))


def _is_automatic(name: str, value: object) -> bool:
    if isinstance(value, str):
        words = value.lower()
        return "auto" in name and "manual" not in words and "shutter" not in words and words != "disabled"
    named = "auto" in name or "continuous" in name or "dynamic_framerate" in name
    # 1 is "manual" for the exposure of V4L2, whose menu comes as words; here a number is a switch.
    return named and isinstance(value, int | float) and bool(value)


def median(values: Floats) -> float:
    """Of the finite ones; NaN where there is none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan


def _inner_halves(grid: ZoiGrid, inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) bool: the middle of each active ZOI, half as wide; the region where there is none."""
    found = np.zeros(inside.shape, bool)
    half, quarter = grid.size // 2, grid.size // 4
    for row, column in np.argwhere(grid.active):
        top, left = grid.first_y[row] + quarter, grid.first_x[column] + quarter
        found[top : top + half, left : left + half] = True
    return found if found.any() else inside


def _pixels(shots: Shots, inside: NDArray[np.bool_]) -> NDArray[Any]:
    """Some of the pixels of the region in every frame, (N, P)."""
    index = np.flatnonzero(inside)
    index = index[:: max(1, len(index) // PIXELS_LOOKED_AT)]
    return np.asarray(shots.frames.reshape(len(shots), -1)[:, index])


def _radius(picture: NDArray[Any], noise: float, n: int, inside: NDArray[np.bool_]) -> float:
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    cut = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    return autocorrelation_fwhm(picture[cut], noise / math.sqrt(n), inside[cut]) / FWHM_OF_RADIUS


def _zois(bench: Bench, grid: ZoiGrid, picture: NDArray[Any], sigma: Floats) -> Zois:
    """Pattern of each ZOI, and what the kernel makes of it."""
    noise = bench.noise / math.sqrt(len(bench.shots))
    along_x, along_y = sssig(picture, grid, noise)
    pixels = grid.size**2
    variance = np.maximum(_variance(picture, grid) - noise**2, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        sharpness = np.sqrt((along_x + along_y) / (2 * pixels) / variance)
    off = ~grid.active
    contrast, weaker = np.sqrt(variance), np.minimum(along_x, along_y)
    for values in (contrast, weaker, sharpness):
        values[off] = np.nan
    return Zois(grid, sigma, contrast, weaker, sharpness)


def _variance(picture: NDArray[Any], grid: ZoiGrid) -> Floats:
    """Of the grey levels in each ZOI, (R, C), GL^2."""
    zero = picture.astype(np.float64) - float(picture.mean())
    mean, square = (_box_means(values, grid) for values in (zero, zero**2))
    return np.asarray(square - mean**2)


def _box_means(values: Floats, grid: ZoiGrid) -> Floats:
    total = np.pad(values, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    top, left, size = grid.first_y[:, None], grid.first_x[None, :], grid.size
    corners = total[top + size, left + size] - total[top, left + size] - total[top + size, left]
    return np.asarray((corners + total[top, left]) / size**2)


def _half_on_half(bench: Bench, grid: ZoiGrid) -> StrainField | None:
    """The second half of the frames against the first; None where there is no pattern."""
    first, second = (bench.correct(bench.shots.mean(k, bench.half)) for k in (0, bench.half))
    try:
        kernel, _ = prepare(first, grid, bench.settings, bench.noise)
    except DataError:
        return None
    return kernel.measure(second.mean, noise=averaged(bench.noise, bench.half))


def _sigma(field: StrainField | None, grid: ZoiGrid, factor: float) -> Floats:
    """Predicted strain noise of each ZOI, exx and eyy in the mean, for a burst of the test."""
    if field is None:
        return np.full(grid.shape, np.nan)
    both = np.sqrt((field.sigma_exx**2 + field.sigma_eyy**2) / 2)
    return np.where(field.ok, factor * both, np.nan)


def _gauges(config: Config, grid: ZoiGrid, field: StrainField | None, factor: float) -> Iterator[GaugeNoise]:
    from analysis.evaluate import measure_gauge

    if field is None or not field.n_valid:
        return
    along = "exx" if config.specimen.first_axis == "x" else "eyy"
    yield GaugeNoise("", factor * field.mean(along)[1])
    for gauge in gauges_for(with_auto_gauges(config, grid), grid):
        value = measure_gauge(gauge, field)
        yield GaugeNoise(gauge.name, factor * value.sigma, value.reason)


def _still(bench: Bench, grid: ZoiGrid) -> Stillness:
    """On the cut picture, where frame after frame is measured."""
    from analysis import Roi, ZoiGrid

    rows, columns = bench.cut
    roi = grid.roi
    moved = Roi(roi.x - columns.start, roi.y - rows.start, roi.width, roi.height)
    return stillness(bench, ZoiGrid(moved, grid.size, grid.step, grid.active))
