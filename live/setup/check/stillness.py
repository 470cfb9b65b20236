"""Whether the specimen stands still and the light is steady, frame by frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from analysis.field import Roi, StrainField
from analysis.quality.steadiness import Steadiness, steadiness
from live.pipeline.reference import averaged, prepare
from live.setup.check.sample import CheckSample, around, moved
from live.setup.pictures import correction

if TYPE_CHECKING:
    from analysis import ZoiGrid

FIRST = 4  # frames averaged as what motion is measured against
MOST_ZOIS = 64


@dataclass(frozen=True, slots=True)
class PictureStillness:
    """Motion of the mean of the region, and its light.

    Attributes
    ----------
    u, v : Steadiness, px
    exx, eyy : Steadiness, dimensionless
    light : Steadiness
        Of the mean grey level, as a part of itself.
    """

    u: Steadiness
    v: Steadiness
    exx: Steadiness
    eyy: Steadiness
    light: Steadiness

    @property
    def drift_px(self) -> float:
        """How far the region drifted, px."""
        return math.hypot(self.u.drift, self.v.drift)

    @property
    def worse(self) -> Steadiness:
        """Of u and v, the one that shakes more."""
        return max((self.u, self.v), key=lambda s: s.vibration)

    @property
    def worse_strain(self) -> Steadiness:
        """Of exx and eyy, the one that shakes more."""
        return max((self.exx, self.eyy), key=lambda s: s.vibration)


def stillness(bench: CheckSample, able: NDArray[np.bool_]) -> PictureStillness:
    """Each frame against the mean of the first few, over some dozens of ZOIs about the middle of all that are able.

    Parameters
    ----------
    bench : CheckSample
    able : (R, C) bool
        ZOIs with a pattern. Without any, and for too few frames, all motion is NaN.
    """
    times = bench.shots.times
    able = able & bench.ground.grid.active
    fields = (
        _fields(bench, bench.ground.grid.subset(active=able)) if able.any() and not bench.shots.few else []
    )

    def series(name: str) -> Steadiness:
        pairs = [field.mean(name) for field in fields] or [(math.nan, math.nan)] * len(times)
        values, sigmas = (np.array(column) for column in zip(*pairs, strict=True))
        known = sigmas[np.isfinite(sigmas)]
        # The noise of the reference is common to all frames and moves none of them.
        own = math.sqrt(1 / (1 + 1 / FIRST)) if known.size else math.nan
        return steadiness(times, values, own * float(np.sqrt(np.mean(known**2))) if known.size else 0.0)

    return PictureStillness(series("u"), series("v"), series("exx"), series("eyy"), light(bench))


def light(bench: CheckSample) -> Steadiness:
    """The mean grey level at the ZOIs in each frame, relative."""
    levels = bench.pixels.mean(axis=1, dtype=np.float64)
    mean = max(float(levels.mean()), 1e-9)
    noise = bench.noise / math.sqrt(bench.pixels.shape[1]) / mean
    return steadiness(bench.shots.times, levels / mean, noise)


def _fields(bench: CheckSample, grid: ZoiGrid) -> list[StrainField]:
    """Of every frame, on no more of the picture than is needed."""
    ground, middle = bench.ground, _middle(grid)
    cut = around(_covered(middle, ground.at_zois.shape))
    correct = correction(ground.config, ground.camera, cut)
    shots, grid = bench.shots.cut(*cut), moved(middle, cut)
    try:
        kernel, _ = prepare(correct(shots.mean(0, FIRST)), grid, bench.settings, bench.noise)
    except DataError:
        return []
    fields = [StrainField.from_values(grid, {})]
    for k in range(len(shots)):
        frame = correct(shots.mean(k, 1))
        fields.append(kernel.measure(frame.mean, start=fields[-1], noise=averaged(bench.noise, 1)))
    return fields[1:]


def _middle(grid: ZoiGrid) -> ZoiGrid:
    """ZOIs side by side rather than one over the other, the nearest to the middle of all; a grid of these alone."""
    spread = math.ceil(math.sqrt(grid.n_active / MOST_ZOIS))
    thin = grid.subset(every=max(1, min(spread, math.ceil(grid.size / grid.step))))
    thin = thin if thin.n_active else grid
    places = np.argwhere(thin.active)
    far = np.hypot(*(places - places.mean(axis=0)).T)
    near = places[np.argsort(far, kind="stable")[:MOST_ZOIS]]
    active = np.zeros(grid.shape, bool)
    active[near[:, 0], near[:, 1]] = True
    (top, left), (bottom, right) = near.min(axis=0), near.max(axis=0)
    x, y = int(grid.first_x[left]), int(grid.first_y[top])
    width, height = (int(n) * grid.step + grid.size for n in (right - left, bottom - top))
    part = active[top : bottom + 1, left : right + 1]
    return replace(grid, roi=Roi(x, y, width, height), active=part)


def _covered(grid: ZoiGrid, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """(H, W) bool: the pixels of its ZOIs."""
    found = np.zeros(shape, bool)
    for row, column in np.argwhere(grid.active):
        top, left = grid.first_y[row], grid.first_x[column]
        found[top : top + grid.size, left : left + grid.size] = True
    return found
