"""Table 2 of the paper: the 2^4 design of ZOI, speckle, encoding and noise, and the models fitted to it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import PatternError
from analysis.field import ZoiGrid
from live.setup.pattern.outcome import ExperimentContext
from tests.paper.truth import SensorModel, TiledStrain, Tiles, TrueScene, ours, papers

Floats = NDArray[np.float64]
SIZES, RADII, BITS, NOISES = (32, 64), (2.0, 16.0), (8, 16), (0.0, 31.0)
CORNERS = tuple(itertools.product((-1, 1), repeat=4))
FACTORS = ("ROI size", "speckle size", "encoding", "noise")
PAIRS = tuple(itertools.combinations(range(4), 2))
TERMS = ("mean", *FACTORS, *(f"{FACTORS[a]} x {FACTORS[b]}" for a, b in PAIRS))
PAPER = (0.107, -7.85e-2, 0.180, -7.40e-2, 0.11, 7.81e-4, -1.89e-3, -7.97e-2, -3.86e-3, 0.188, -7.17e-2)
PAPER_CONFIDENCE = (98.4, 98.3, 98.0, 98.5, 98.0, 13.5, 73.1, 97.8, 93.6, 97.8, 98.3)
GUARD = {2.0: 24, 16.0: 160}
READINGS = {"": 1.0, ", range": 1 / math.sqrt(12)}
"""Of the paper's 31 GL: a standard deviation, or a range of equally likely values."""
MIN_ZOIS = 10
"""With fewer measured ZOIs, a corner has no scatter."""
SIGNIFICANT = 95.0


@dataclass(frozen=True, slots=True, eq=False)
class DesignFit:
    """A linear model on the coded factors, -1 and 1: coefficients (``TERMS``), (11,) each, their standard errors, and
    the two-sided confidence in % that they are not zero.
    """

    beta: Floats
    sigma: Floats
    confidence: Floats


def model_matrix(corners: NDArray[Any]) -> Floats:
    """(N, 11): 1, the four factors, their six products."""
    coded = np.asarray(corners, float)
    products = [coded[:, a] * coded[:, b] for a, b in PAIRS]
    return np.column_stack([np.ones(len(coded)), coded, *products])


def fitted(corners: NDArray[Any], response: Floats) -> DesignFit:
    """Least squares with Student's confidence; corners (N, 4) whose response is not finite are left out."""
    from scipy.special import stdtr

    good = np.isfinite(response)
    matrix, values = model_matrix(corners)[good], response[good]
    beta, _, rank, _ = np.linalg.lstsq(matrix, values, rcond=None)
    freedom = max(len(values) - int(rank), 1)
    variance = float(np.sum((values - matrix @ beta) ** 2)) / freedom
    sigma = np.sqrt(variance * np.diag(np.linalg.pinv(matrix.T @ matrix)))
    t = np.abs(beta) / np.maximum(sigma, 1e-300)
    confidence = 100 * (2 * stdtr(freedom, t) - 1)
    return DesignFit(np.asarray(beta, float), np.asarray(sigma, float), np.asarray(confidence, float))


@dataclass(frozen=True, slots=True)
class Corner:
    """One corner at one strain: scatter and rms error of exx, and how many ZOIs were measured."""

    coded: tuple[int, ...]
    level: float
    estimator: str
    std: float
    rms: float
    measured: int


def measured(context: ExperimentContext) -> list[Corner]:
    """All corners, levels and estimators; the pictures of a speckle size are rendered once."""
    levels = (2e-4,) if context.quick else tuple(np.geomspace(2e-5, 2e-3, 5))
    readings = {"": READINGS[""]} if context.quick else READINGS
    found: list[Corner] = []
    for radius_code, radius in zip((-1, 1), RADII, strict=True):
        tiles = Tiles(64 + GUARD[radius])
        scene = TrueScene(tiles.shape, radius, 90 + radius_code)
        lights = [scene.light(TiledStrain(tiles.pitch, du_dx=float(level))) for level in levels]
        corners = [c for c in CORNERS if c[1] == radius_code]
        for number, coded in enumerate(corners):
            found += _corner(scene, tiles, coded, list(zip(levels, lights, strict=True)), readings)
            context.tick((number + 1) / (2 * len(corners)) + 0.5 * (radius_code > 0))
    return found


def _corner(
    scene: TrueScene,
    tiles: Tiles,
    coded: tuple[int, ...],
    lights: list[tuple[float, Any]],
    readings: Mapping[str, float],
) -> list[Corner]:
    """One corner at all levels; with noise also for 31 GL read as a range."""
    size, _, bits, noise = corner_values(coded)
    grid, found = tiles.grid(size), []
    for reading, spread in readings.items():
        camera = SensorModel(bits, noise * spread)
        for level, light in lights if noise or not reading else ():
            pair = camera.picture(scene.reference, scene.rng), camera.picture(light, scene.rng)
            found.append(_figures(coded, level, "paper" + reading, papers(pair, grid).exx))
            found.append(_figures(coded, level, "ours" + reading, _ours_or_refused(pair, grid, camera)))
    if not noise:
        found += [
            replace(c, estimator=c.estimator + reading) for c in found for reading in readings if reading
        ]
    return found


def _ours_or_refused(pair: tuple[Any, Any], grid: ZoiGrid, camera: SensorModel) -> Floats:
    try:
        return ours(pair, grid, camera.sigma).exx
    except PatternError:
        return np.full(grid.shape, np.nan)


def _figures(coded: tuple[int, ...], level: float, estimator: str, exx: Floats) -> Corner:
    good = exx[np.isfinite(exx)]
    if good.size < MIN_ZOIS:
        return Corner(coded, level, estimator, float("nan"), float("nan"), int(good.size))
    std, rms = float(good.std(ddof=1)), float(np.sqrt(np.mean((good - level) ** 2)))
    return Corner(coded, level, estimator, std, rms, int(good.size))


def corner_values(coded: tuple[int, ...]) -> tuple[Any, ...]:
    """ROI px, radius px, bits, noise GL of a corner."""
    return tuple(
        pair[(code + 1) // 2] for pair, code in zip((SIZES, RADII, BITS, NOISES), coded, strict=True)
    )
