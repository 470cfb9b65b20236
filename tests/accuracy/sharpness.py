"""Pictures that have become less sharp, and references with noise: means of direct strains against the truth, zero.

Three patterns: the planar tension set, the composite coupon (both through PHASEDIC_DATA) and simulated speckle. Noise
of known size is added to both pictures. Blur of real pictures is a convolution; that of the simulated one is analytic.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, uniform_filter1d

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.field import mean_blur
from tests.accuracy.real import read
from tests.accuracy.truth import Speckle, affine

Array = NDArray[np.float64]

REAL = {
    "planar tension": "planar_tension/img_0.tif",
    "coupon": "dic_challenge_1_sample12_ohtcfrp/oht_cfrp_00.tiff",
}
SIDE, MARGIN = 320, 12
DARK = (131, 0)
"""First row and column of the dark side of the planar tension set, from 20 to 60 GL."""
BLUR_PX, SMEAR_PX = 0.5, 3.0
NOISE_GL = 2.0
BLURRED_LIMIT, SMEARED_LIMIT = 30e-6, 60e-6
"""Beyond 3 sigma of the mean; in all."""
SCATTER_LIMIT = 1.3
BIAS_LIMIT = 0.3
"""Sigmas of the mean of one pair, beyond twice the standard error of what is found."""


@dataclass(frozen=True)
class Case:
    """One line of the table: means of exx and eyy, their sigmas, scatter over the predicted, blur, and the verdict."""

    mean: tuple[float, float]
    sigma: tuple[float, float]
    scatter: float
    blur: float
    kept: float
    good: bool


def patterns(folder: Path) -> dict[str, Array]:
    """The middle of each pattern, GL; the simulated one alone where there is no data."""
    found = {name: _middle(read(folder / path)) for name, path in REAL.items() if (folder / path).is_file()}
    return found | {"simulated": simulated(0.0)}


def simulated(blur: float) -> Array:
    """Speckle of 8 bits, with an analytic blur."""
    return np.asarray(255 * Speckle(2.0, 1, 400, blur).at(*affine((SIDE, SIDE))))


def _middle(picture: Array) -> Array:
    top, left = (max(0, (n - SIDE) // 2) for n in picture.shape)
    return picture[top : top + SIDE, left : left + SIDE].astype(float)


def blurred(name: str, picture: Array) -> Array:
    return simulated(BLUR_PX) if name == "simulated" else np.asarray(gaussian_filter(picture, BLUR_PX))


def smeared(picture: Array) -> Array:
    return np.asarray(uniform_filter1d(picture, round(SMEAR_PX), axis=1))


def measured(
    before: Array, after: Array, size: int, estimator: str, noise: float, rng: np.random.Generator
) -> StrainField:
    """``after`` against ``before``, both with noise and in whole grey levels; the noise is found, not given."""
    first, second = (np.clip(np.rint(p + rng.normal(0, noise, p.shape)), 0, 65535) for p in (before, after))
    height, width = first.shape
    step = size // (4 if estimator == "spectral" else 2)
    grid = ZoiGrid.cover(Roi(MARGIN, MARGIN, width - 2 * MARGIN, height - 2 * MARGIN), size, step)
    kernel = PhaseKernel(first.astype(np.uint16), grid, KernelSettings(estimator=estimator))  # type: ignore[arg-type]
    return kernel.measure(second.astype(np.uint16))


def sharpness_case(before: Array, after: Array, size: int, estimator: str, *, smear: bool) -> Case:
    field = measured(before, after, size, estimator, 1.0, np.random.default_rng(3))
    (exx, s_xx), (eyy, s_yy) = field.mean("exx"), field.mean("eyy")
    ok = field.ok
    scatter = float(np.sqrt(np.mean(field.exx[ok] ** 2) / np.mean(field.sigma_exx[ok] ** 2)))
    if smear:
        good = abs(exx) <= SMEARED_LIMIT + 3 * s_xx and abs(eyy) <= SMEARED_LIMIT + 3 * s_yy
    else:
        good = abs(exx) <= BLURRED_LIMIT + 3 * s_xx and scatter <= SCATTER_LIMIT
    return Case((exx, eyy), (s_xx, s_yy), scatter, mean_blur(field).px, float(ok.mean()), good)


def sharpness_cases(folder: Path, quick: bool) -> Iterator[tuple[str, str, int, str, Case]]:
    """Change, pattern, ZOI, estimator, and what was found."""
    estimators = ("spectral",) if quick else ("spectral", "phase")
    blur, smear = f"blur {BLUR_PX:g} px", f"smear {SMEAR_PX:g} px"
    for name, picture in patterns(folder).items():
        for estimator in estimators:
            after = blurred(name, picture)
            for size in (64,) if quick else (32, 64):
                yield (
                    blur,
                    name,
                    size,
                    estimator,
                    sharpness_case(picture, after, size, estimator, smear=False),
                )
            after = smeared(picture)
            yield smear, name, 64, estimator, sharpness_case(picture, after, 64, estimator, smear=True)


def bias(picture: Array, size: int, pairs: int) -> tuple[float, float, float, bool]:
    """The worse mean of exx and eyy over pairs of single frames, its standard error, sigma of one mean, the verdict."""
    rng = np.random.default_rng(9)
    fields = [measured(picture, picture, size, "spectral", NOISE_GL, rng) for _ in range(pairs)]
    found = []
    for name in ("exx", "eyy"):
        values, sigmas = np.array([field.mean(name) for field in fields]).T
        found.append((float(values.mean()), float(values.std(ddof=1) / np.sqrt(pairs)), float(sigmas.mean())))
    mean, error, sigma = max(found, key=lambda one: abs(one[0]) / one[2])
    return mean, error, sigma, abs(mean) <= BIAS_LIMIT * sigma + 2 * error


def bias_cases(folder: Path, quick: bool) -> Iterator[tuple[str, int, tuple[float, float, float, bool]]]:
    """Pattern, ZOI, and what was found; the real patterns at their own contrast, one of them also on its dark side."""
    known = patterns(folder)
    path = folder / REAL["planar tension"]
    if path.is_file():
        top, left = DARK
        known["planar tension, dark side"] = read(path)[top : top + SIDE, left : left + SIDE].astype(float)
    for name, picture in known.items():
        for size in (48,) if quick else (32, 48, 64):
            yield name, size, bias(picture, size, 5 if quick else 25)
