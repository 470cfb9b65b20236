"""Motion of the still specimen and steadiness of the light, frame by frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from analysis.field import Roi, StrainField
from analysis.optics import alike, keystones
from analysis.quality.steadiness import Steadiness, steadiness
from live.pipeline.reference import averaged, prepare
from live.setup.check.sample import CheckSample, around, moved
from live.setup.pictures import correction

if TYPE_CHECKING:
    from analysis import ZoiGrid

FIRST_FRAMES = 4  # frames averaged as the reference of the motion
MAX_ZOIS = 64
DRIFT_OVER_NOISE = 1.5
"""A drift is clear beyond this times the noise of one frame: 3 to 5 of its standard deviations from 30 frames on."""


@dataclass(frozen=True, slots=True)
class PictureStillness:
    """Mean motion of the region, and its light.

    Attributes
    ----------
    u, v : Steadiness, px
    exx, eyy : Steadiness, dimensionless
    rises : pair of (Steadiness, Steadiness)
        Along x and along y, each as u and as v show it (``analysis.optics.Keystone``).
    light : Steadiness
        Of the mean grey level, relative.
    """

    u: Steadiness
    v: Steadiness
    exx: Steadiness
    eyy: Steadiness
    rises: tuple[tuple[Steadiness, Steadiness], tuple[Steadiness, Steadiness]]
    light: Steadiness

    @property
    def drift_px(self) -> float:
        """Drift of the region, px."""
        return math.hypot(self.u.drift, self.v.drift)

    @property
    def dilatation(self) -> float:
        """Drift that exx and eyy have in common, as from a changing distance; 0 where they differ or are noise."""
        noise = DRIFT_OVER_NOISE * max(self.exx.noise, self.eyy.noise)
        return alike(self.exx.drift, self.eyy.drift, noise)

    @property
    def keystone(self) -> tuple[float, float]:
        """Drift of the rise of the mean strain over the ZOIs, along x and along y, as from a tilt; 0 where noise."""
        along_x, along_y = (
            alike(by_u.drift, by_v.drift, DRIFT_OVER_NOISE * max(by_u.rms, by_v.rms))
            for by_u, by_v in self.rises
        )
        return along_x, along_y

    @property
    def worse(self) -> Steadiness:
        """The one of u and v with more vibration."""
        return max((self.u, self.v), key=lambda s: s.vibration)

    @property
    def worse_strain(self) -> Steadiness:
        """The one of exx and eyy with more vibration."""
        return max((self.exx, self.eyy), key=lambda s: s.vibration)


def stillness(sample: CheckSample, measurable: NDArray[np.bool_]) -> PictureStillness:
    """The motion of each frame against the mean of the first few, over some dozens of ZOIs about the middle.

    Parameters
    ----------
    sample : CheckSample
    measurable : (R, C) bool
        ZOIs with a pattern. Without any, and with too few frames, all motion is NaN.
    """
    times = sample.stack.times
    measurable = measurable & sample.check_region.grid.active
    able = measurable.any() and not sample.stack.few
    fields = _fields(sample, sample.check_region.grid.subset(active=measurable)) if able else []

    def series(name: str) -> Steadiness:
        pairs = [field.mean(name) for field in fields] or [(math.nan, math.nan)] * len(times)
        values, sigmas = (np.array(column) for column in zip(*pairs, strict=True))
        known = sigmas[np.isfinite(sigmas)]
        # The noise of the reference is common to all frames and is no motion.
        own = math.sqrt(1 / (1 + 1 / FIRST_FRAMES)) if known.size else math.nan
        return steadiness(times, values, own * float(np.sqrt(np.mean(known**2))) if known.size else 0.0)

    rises = _rises(times, fields)
    return PictureStillness(series("u"), series("v"), series("exx"), series("eyy"), rises, light(sample))


def _rises(
    times: NDArray[np.float64], fields: list[StrainField]
) -> tuple[tuple[Steadiness, Steadiness], tuple[Steadiness, Steadiness]]:
    """The series of ``analysis.optics.keystones``; their scatter is their noise."""
    values = np.array(
        [[(one.by_u, one.by_v) for one in keystones(field)] for field in fields]
        or np.full((len(times), 2, 2), math.nan)
    )
    along_x, along_y = (
        (steadiness(times, values[:, k, 0]), steadiness(times, values[:, k, 1])) for k in (0, 1)
    )
    return along_x, along_y


def light(sample: CheckSample) -> Steadiness:
    """The mean grey level at the ZOIs in each frame, relative."""
    levels = sample.pixels.mean(axis=1, dtype=np.float64)
    mean = max(float(levels.mean()), 1e-9)
    noise = sample.noise / math.sqrt(sample.pixels.shape[1]) / mean
    return steadiness(sample.stack.times, levels / mean, noise)


def _fields(sample: CheckSample, grid: ZoiGrid) -> list[StrainField]:
    """The strain field of every frame, on the necessary part of the picture."""
    check_region, chosen = sample.check_region, middle(grid)
    cut = around(covered(chosen, check_region.at_zois.shape))
    correct = correction(check_region.config, check_region.camera, cut)
    stack, grid = sample.stack.cut(*cut), moved(chosen, cut)
    try:
        kernel, _ = prepare(correct(stack.mean(0, FIRST_FRAMES)), grid, sample.settings, sample.noise)
    except DataError:
        return []
    fields = [StrainField.from_values(grid, {})]
    for k in range(len(stack)):
        frame = correct(stack.mean(k, 1))
        fields.append(kernel.measure(frame.mean, start=fields[-1], noise=averaged(sample.noise, 1)))
    return fields[1:]


def middle(grid: ZoiGrid) -> ZoiGrid:
    """A grid of the ZOIs nearest to the middle, side by side rather than overlapping."""
    spread = math.ceil(math.sqrt(grid.n_active / MAX_ZOIS))
    thin = grid.subset(every=max(1, min(spread, math.ceil(grid.size / grid.step))))
    thin = thin if thin.n_active else grid
    places = np.argwhere(thin.active)
    far = np.hypot(*(places - places.mean(axis=0)).T)
    near = places[np.argsort(far, kind="stable")[:MAX_ZOIS]]
    active = np.zeros(grid.shape, bool)
    active[near[:, 0], near[:, 1]] = True
    (top, left), (bottom, right) = near.min(axis=0), near.max(axis=0)
    x, y = int(grid.first_x[left]), int(grid.first_y[top])
    width, height = (int(n) * grid.step + grid.size for n in (right - left, bottom - top))
    part = active[top : bottom + 1, left : right + 1]
    return replace(grid, roi=Roi(x, y, width, height), active=part)


def covered(grid: ZoiGrid, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """(H, W) bool: the pixels of the active ZOIs."""
    found = np.zeros(shape, bool)
    for row, column in np.argwhere(grid.active):
        top, left = grid.first_y[row], grid.first_x[column]
        found[top : top + grid.size, left : left + grid.size] = True
    return found
