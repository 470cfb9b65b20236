"""The metrological efficiency indicator: the period of a sine that has lost 10 %, times the noise of a displacement.

P. L. Reu et al., "DIC Challenge 2.0: developing images and guidelines for evaluating accuracy and resolution of 2D
analyses", Experimental Mechanics 62 (2022) 639-654, doi:10.1007/s11340-021-00806-6. In px^2, the less the better. It
is proportional to the noise over the gradient of the pattern, which is therefore the same for all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, StrainField
from analysis.evaluate.deconvolution import deconvolved, effect
from analysis.field.grid import Window
from tests.accuracy.limit import derivative
from tests.accuracy.runs import SHAPE, grid, level
from tests.accuracy.truth import Speckle, digitise, field, pixels

RADIUS = 2.25
"""Of the speckle, px: 5.3 px across at half of its height."""
NOISE = 0.080
"""Of each picture over the rms gradient of the pattern, px. Uniform subsets of order 1 then have 0.45 px^2."""
AMPLITUDE = 0.1
"""Of the sines, px."""
BITS, STEP, MARGIN = 12, 5, 64
HONEST = 0.95, 1.05
"""Sigma as predicted over the scatter."""


@dataclass(frozen=True)
class Case:
    """An estimator and what is done to its map; ``about`` is the expected l_10%, px, ``most`` the limit in px^2."""

    window: Window
    size: int
    order: int
    about: float
    most: float
    steps: int = 0
    sharpened: int = 0


CASES = (
    Case("uniform", 33, 1, 131, 0.49),
    Case("gaussian", 57, 1, 128, 0.47),
    Case("uniform", 33, 2, 43, 0.31),
    Case("uniform", 65, 2, 84, 0.29),
    Case("gaussian", 57, 1, 73, 0.29, 3),
    Case("gaussian", 57, 1, 51, 0.27, 7),
    Case("gaussian", 57, 1, 64, 0.24, 2, 3),
    Case("gaussian", 57, 1, 61, 0.24, 2, 4),
    Case("gaussian", 33, 1, 36.5, 0.25, 2, 4),
)


@dataclass(frozen=True)
class Found:
    """l_10% and standard deviation of u and v in px, and the latter as predicted."""

    l10: float
    scatter: float
    predicted: float

    @property
    def efficiency(self) -> float:
        """In px^2."""
        return self.l10 * self.scatter


def within(case: Case, found: Found) -> bool:
    """Whether a case keeps its limits."""
    return found.efficiency <= case.most and HONEST[0] < found.predicted / found.scatter < HONEST[1]


def table(quick: bool) -> Iterator[tuple[Case, Found]]:
    """The cases, measured; ``quick`` takes fewer pairs and periods."""
    for case in CASES:
        scatter, predicted = _noise(case, 1 if quick else 4)
        yield case, Found(_l10(case, 3 if quick else 5), scatter, predicted)


def _settings(case: Case) -> KernelSettings:
    return KernelSettings(window=case.window, order=case.order)


def _inner(case: Case, found: StrainField, values: NDArray) -> NDArray:
    """Of a map, what does not lie near the border."""
    middle = (SHAPE[0] - 1) / 2
    x, y = (np.abs(at - middle) < middle - MARGIN - case.size / 2 for at in (found.grid.x, found.grid.y))
    return np.asarray(values, np.float64)[np.ix_(y, x)]


def _map(case: Case, found: StrainField, values: NDArray) -> NDArray:
    """A map as measured or deconvolved, without what lies near the border."""
    if case.steps:
        values = deconvolved(values, found.grid, case.steps, case.sharpened)
    return _inner(case, found, values)


def _noise(case: Case, pairs: int) -> tuple[float, float]:
    """Scatter and prediction over pairs of pictures with new noise each."""
    rng = np.random.default_rng(5)
    reference, moved = level(RADIUS), level(RADIUS, u=0.3, v=-0.2)
    inner = np.s_[MARGIN:-MARGIN, MARGIN:-MARGIN]
    share = NOISE * float(np.sqrt(np.mean([derivative(reference, axis)[inner] ** 2 for axis in (0, 1)])))
    sigma, zois = share * (2**BITS - 1), grid(case.size, STEP)
    more = effect(zois, case.steps, case.sharpened).noise if case.steps else 1.0
    errors, expected = [], []
    for _ in range(pairs):
        kernel = PhaseKernel(digitise(reference, BITS, share, rng), zois, _settings(case), sigma)
        found = kernel.measure(digitise(moved, BITS, share, rng), noise=sigma)
        errors += [_map(case, found, found.u) - 0.3, _map(case, found, found.v) + 0.2]
        expected += [more * found.sigma_u, more * found.sigma_v]
    return float(np.nanstd(errors)), float(np.sqrt(np.nanmean(np.square(expected))))


def _l10(case: Case, count: int) -> float:
    """By sines without noise around the period expected; the loss is nearly straight over 1/period^2."""
    pattern, zois = Speckle(RADIUS, 1), grid(case.size, STEP)
    kernel = PhaseKernel(digitise(pattern.at(*pixels(SHAPE)), BITS), zois, _settings(case))
    periods = case.about * np.linspace(0.92, 1.08, count)
    kept = [_kept(case, kernel, pattern, float(period)) for period in periods]
    return float(np.interp(0.9, kept, periods**-2.0) ** -0.5)


def _kept(case: Case, kernel: PhaseKernel, pattern: Speckle, period: float) -> float:
    """The share of a sine of u along x that is left."""
    wave = lambda x, y: (AMPLITUDE * np.sin(2 * np.pi * x / period), 0 * y)  # noqa: E731
    found = kernel.measure(digitise(pattern.at(*field(SHAPE, wave)), BITS))
    along = np.sin(2 * np.pi * (found.grid.x - (SHAPE[1] - 1) / 2) / period)
    seen, true = _map(case, found, found.u), _inner(case, found, np.broadcast_to(along, found.grid.shape))
    return float(np.nansum(seen * true) / np.sum(true[np.isfinite(seen)] ** 2) / AMPLITUDE)
