"""Whether the specimen stands still and the light is steady, frame by frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from acquire.errors import DataError
from analysis.quality import Steadiness, steadiness
from live.check.floor import Bench
from live.measure import averaged, prepare

if TYPE_CHECKING:
    from analysis import StrainField, ZoiGrid

FIRST = 4  # frames averaged as what motion is measured against
MOST_ZOIS = 64


@dataclass(frozen=True, slots=True)
class Stillness:
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


def stillness(bench: Bench, grid: ZoiGrid) -> Stillness:
    """Each frame against the mean of the first few, over at most some dozens of the ZOIs of ``grid``.

    ``grid`` is laid on the cut picture. Without any pattern all motion is NaN.
    """
    fields = _fields(bench, _thinned(grid))
    times = bench.shots.times

    def series(name: str) -> Steadiness:
        pairs = [field.mean(name) for field in fields] or [(math.nan, math.nan)] * len(times)
        values, sigmas = (np.array(column) for column in zip(*pairs, strict=True))
        known = sigmas[np.isfinite(sigmas)]
        # The noise of the reference is common to all frames and moves none of them.
        own = math.sqrt(1 / (1 + 1 / FIRST)) if known.size else math.nan
        return steadiness(times, values, own * float(np.sqrt(np.mean(known**2))) if known.size else 0.0)

    return Stillness(series("u"), series("v"), series("exx"), series("eyy"), light(bench))


def light(bench: Bench) -> Steadiness:
    """The mean grey level at the ZOIs in each frame, relative."""
    levels = np.array([frame[bench.at_zois].mean(dtype=np.float64) for frame in bench.shots.frames])
    mean = max(float(levels.mean()), 1e-9)
    noise = bench.noise / math.sqrt(max(int(bench.at_zois.sum()), 1)) / mean
    return steadiness(bench.shots.times, levels / mean, noise)


def _fields(bench: Bench, grid: ZoiGrid) -> list[StrainField]:
    try:
        kernel, _ = prepare(bench.burst(0, FIRST), grid, bench.settings, bench.noise)
    except DataError:
        return []
    fields: list[StrainField] = []
    for k in range(len(bench.shots)):
        before = fields[-1] if fields else None
        frame = bench.burst(k, 1)
        fields.append(kernel.measure(frame.mean, start=before, noise=averaged(bench.noise, 1)))
    return fields


def _thinned(grid: ZoiGrid) -> ZoiGrid:
    every = max(1, math.ceil(math.sqrt(grid.n_active / MOST_ZOIS)))
    thin = grid.subset(every=every)
    return thin if thin.n_active else grid
