"""What a picture of a pattern is worth before it is measured: size, contrast, gradient, noise, spectrum.

Everything comes from one picture. No displacement is estimated here; ``predicted_sigma``, ``resolution_length``,
``l10_strain`` and ``gauge_length`` are what a ZOI can reach at best (docs/method.md, closed forms).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import Window, profile
from analysis.picture.spectrum import NOISE_BAND, filtered_pattern, radial_spectrum

BLOCK_PX = 8
MAX_LINES = 64
"""Rows and columns that are sampled; 256 give the same verdict on 32 pictures, raw and JPEG 50 to 95."""
BLOCKS = 1.3
"""Blockiness from which on a picture was compressed: JPEG 80 has 1.9, JPEG 50 2.7, raw pictures 0.98 to 1.06."""


Floats = NDArray[np.float64]
SIGNAL_OVER_NOISE = 2.0
"""A frequency carries pattern where its power is at least this many times that of the noise."""
MIN_SIDE = 16
SLOW_SHARE = 12
LOSS = 0.1
"""l_10%: the period of a sine that has lost so much of its amplitude."""


def blockiness(image: NDArray[Any]) -> float:
    """Third differences of an image (H, W) across the borders of blocks of 8 px over those elsewhere; about 1."""
    worst = 1.0
    if min(image.shape) < 4 * BLOCK_PX:
        return worst
    for axis in (0, 1):
        lines = image[_some(len(image))] if axis else image[:, _some(image.shape[1])]
        steps = np.abs(np.diff(lines.astype(np.float32), n=3, axis=axis)).mean(axis=1 - axis)
        means = [float(steps[k::BLOCK_PX].mean()) for k in range(BLOCK_PX)]
        worst = max(worst, max(means) / max(float(np.median(means)), 1e-6))
    return worst


def _some(count: int) -> slice:
    """About ``MAX_LINES`` of that many rows or columns, evenly spaced."""
    return slice(None, None, max(1, count // MAX_LINES))


@dataclass(frozen=True, slots=True, eq=False)
class PatternReport:
    """Figures of one picture.

    Attributes
    ----------
    mean : float, GL
    contrast : float, GL
        Standard deviation of the pattern, its noise taken out.
    noise : float, GL
        Of the picture, as given or from the corners of its spectrum.
    gradient : float, GL/px
        g, rms of one component of the gradient, noise filtered out; mean square over x and y.
    speckle_radius : float, px
        r of a blob exp(-rho^2 / (2 r^2)) with the same autocorrelation at half height.
    autocorrelation_fwhm : float, px
        Full width at half height of the autocorrelation, often called the speckle size.
    clipped : float
        Share of pixels at either end of the scale; NaN where the depth is not known.
    band : float, cycles/px
        Highest frequency whose power is at least twice that of the noise.
    spectrum_radius : (M,) float64, cycles/px
    spectrum_power : (M,) float64, GL^2
        Mean power in rings; white noise of variance s^2 is s^2 everywhere.
    """

    mean: float
    contrast: float
    noise: float
    gradient: float
    speckle_radius: float
    autocorrelation_fwhm: float
    clipped: float
    band: float
    spectrum_radius: Floats
    spectrum_power: Floats

    def predicted_sigma(self, size: int, noise: float | None = None) -> tuple[float, float]:
        """(sigma_u px, sigma_strain) of a Gaussian ZOI against a reference of the same noise."""
        return predicted_sigma(size, self.noise if noise is None else noise, self.gradient)


def describe_pattern(image: ArrayLike, bits: int | None = None, noise: float | None = None) -> PatternReport:
    """All figures of one picture.

    Parameters
    ----------
    image : (H, W), GL
    bits : int, optional
        Depth of the camera, for the share of clipped pixels.
    noise : float, GL, optional
        Standard deviation of the noise of this picture; None: from the corners of its spectrum.

    Raises
    ------
    ValueError
        Not a grey picture, or smaller than 16 px.
    """
    picture = _picture(image)
    zero = (picture - picture.mean()).astype(np.float32)
    radius, power = radial_spectrum(zero)
    sigma = _corner_noise(radius, power) if noise is None else float(noise)
    pattern = filtered_pattern(picture.astype(np.float32), sigma, 5)
    square = np.mean(pattern.grad_x.astype(float) ** 2 + pattern.grad_y.astype(float) ** 2) / 2
    fwhm = autocorrelation_fwhm(picture, sigma)
    seen = radius[power >= SIGNAL_OVER_NOISE * max(sigma**2, 1e-12)]
    return PatternReport(
        mean=float(picture.mean()),
        contrast=math.sqrt(max(float(picture.var()) - sigma**2, 0.0)),
        noise=sigma,
        gradient=math.sqrt(float(square)),
        speckle_radius=fwhm / (4 * math.sqrt(math.log(2))),
        autocorrelation_fwhm=fwhm,
        clipped=float("nan") if bits is None else clipped_share(picture, bits),
        band=float(seen.max()) if seen.size else 0.0,
        spectrum_radius=radius,
        spectrum_power=power,
    )


def autocorrelation_fwhm(image: ArrayLike, noise: float = 0.0) -> float:
    """Full width at half height of the autocorrelation, mean of x and y, px; NaN where it never falls.

    The variance of the noise is taken out of the value at zero lag. Between lags the logarithm is
    interpolated over the square of the lag, which is exact for Gaussian speckle. What varies over more
    than a twelfth of the shorter side is light or background, not speckle, and taken out first.
    """
    from scipy.ndimage import gaussian_filter

    picture = _picture(image)
    zero = picture - gaussian_filter(picture, min(picture.shape) / SLOW_SHARE, mode="nearest")
    along_x, along_y = _autocorrelation(zero - zero.mean())
    return 2 * float(np.mean([_half_width(line, noise) for line in (along_x, along_y)]))


def _autocorrelation(values: Floats) -> tuple[Floats, Floats]:
    """Mean products of pixels at lags along x and along y, up to half the picture."""
    from scipy.fft import irfft2, rfft2

    rows, columns = values.shape
    shape = (2 * rows, 2 * columns)
    product = irfft2(np.abs(rfft2(values, shape, workers=2)) ** 2, shape, workers=2)
    across, down = np.arange(columns // 2), np.arange(rows // 2)
    return product[0, across] / (rows * (columns - across)), product[down, 0] / ((rows - down) * columns)


def _half_width(line: Floats, noise: float) -> float:
    values = line / (line[0] - noise**2) if line[0] > noise**2 else np.zeros_like(line)
    values[0] = 1.0
    below = np.flatnonzero(values < 0.5)
    if below.size == 0 or not line[0] > noise**2:
        return float("nan")
    k = int(below[0])
    high, low = math.log(values[k - 1]), math.log(max(values[k], 1e-6))
    share = (high - math.log(0.5)) / (high - low)
    return math.sqrt((k - 1) ** 2 + share * (k**2 - (k - 1) ** 2))


def noise_of_picture(image: ArrayLike) -> float:
    """Noise of one picture, GL, from the corners of its spectrum, where pattern hardly reaches.

    An upper bound where the pattern is finer than about 1.5 px, a lower one where the camera or a
    file format has smoothed the picture.
    """
    picture = _picture(image)
    return _corner_noise(*radial_spectrum((picture - picture.mean()).astype(np.float32)))


def hidden_noise(image: ArrayLike, steps: Sequence[float]) -> float:
    """White noise that may have been in a picture before a codec took it out of the corners of its spectrum, GL.

    Each ring of the spectrum bounds it: by its power, or, where that was rounded to nothing, by the largest noise that
    is (99 % of values within half a step: a fifth of it). The lowest bound counts.

    Parameters
    ----------
    image : (H, W), GL
    steps : 64 floats, GL
        Of the coefficients of blocks of 8 x 8 px, row by row (ITU-T T.81, A.3.4).
    """
    picture, table = _picture(image), np.reshape(steps, (8, 8)).astype(np.float64)
    radius, power = radial_spectrum((picture - picture.mean()).astype(np.float32))
    wave = np.arange(8) / 16  # cycles/px
    ring = np.rint(16 * np.hypot(wave[:, None], wave)).astype(int)
    square = np.bincount(ring.ravel(), table.ravel() ** 2) / np.bincount(ring.ravel())
    inside = (radius > wave[1]) & (radius < wave[-1])
    rounded = square[np.rint(16 * radius[inside]).astype(int)] / 25
    bounds = np.maximum(power[inside], rounded)
    return math.sqrt(float(bounds.min())) if bounds.size else 0.0


def _corner_noise(radius: Floats, power: Floats) -> float:
    return math.sqrt(float(np.median(power[radius > NOISE_BAND])))


def clipped_share(image: ArrayLike, bits: int) -> float:
    """Share of pixels at 0 or at the top of the scale."""
    picture = np.asarray(image)
    return float(np.mean((picture <= 0) | (picture >= 2**bits - 1)))


def predicted_sigma(size: int, noise: float, gradient: float) -> tuple[float, float]:
    """Noise limit of a Gaussian ZOI (sigma_w = size/6) of order 1: (sigma_u px, sigma_strain).

    Parameters
    ----------
    size : int, px
    noise : float, GL
        Of either picture.
    gradient : float, GL/px
        g of the pattern. Holds for speckle small against the ZOI.

    Notes
    -----
    Weighted least squares with weight w and white noise in both pictures:
    var = 2 sigma^2 (J'wJ)^-1 (J'w^2J)(J'wJ)^-1, in the mean over a pattern without direction
    sigma_u = sigma / (g s sqrt(2 pi)) and sigma_strain = sigma / (g s^2 2 sqrt(pi)).
    """
    s = size / 6
    u = noise / (gradient * s * math.sqrt(2 * math.pi))
    return u, noise / (gradient * s**2 * 2 * math.sqrt(math.pi))


def resolution_length(size: int) -> float:
    """l_10% of a Gaussian ZOI of order 1, px: the period of a sine that has lost 10 %.

    exp(-2 pi^2 s^2 / l^2) = 0.9, s = size/6: 13.69 s.
    """
    return math.pi * math.sqrt(2 / -math.log(0.9)) * size / 6


def l10_strain(size: int, window: Window = "gaussian") -> float:
    """l_10% of a strain, px: the period of a sine that has lost 10 %. The same for order 1 and 2.

    A quadratic term is even, a gradient odd. Summed over the pixels of a ZOI, so that it holds for every window.
    """
    x = _centred(size)
    weight = profile(window, size) * x
    return _period(x, weight / (weight @ x))


def gauge_length(size: int, window: Window = "gaussian") -> float:
    """Side of the square, evenly weighted ZOI whose strain has the same noise, px: the size of the VSG."""
    x, w = _centred(size), profile(window, size)
    fitted = (w * x**2).sum() * w.sum()
    noise = (w**2 * x**2).sum() * (w**2).sum()
    return float((12 * fitted**2 / noise) ** 0.25)


def _centred(size: int) -> Floats:
    return np.asarray(np.arange(size) - (size - 1) / 2)


def _period(x: Floats, weight: Floats) -> float:
    """The longest period whose response is 1 - LOSS, by bisection from periods without loss."""

    def response(period: float) -> float:
        k = 2 * math.pi / period
        return float(weight @ np.sin(k * x) / k)

    long, short = 1000.0 * len(x), 1000.0 * len(x)
    while response(short) > 1 - LOSS:
        long, short = short, short / 1.1
    for _ in range(60):
        middle = (long + short) / 2
        long, short = (middle, short) if response(middle) > 1 - LOSS else (long, middle)
    return (long + short) / 2


def _picture(image: ArrayLike) -> Floats:
    picture = np.asarray(image, np.float64)
    if picture.ndim != 2 or min(picture.shape) < MIN_SIDE:
        raise ValueError(
            f"a grey picture of at least {MIN_SIDE} px is needed, got an array of shape {picture.shape}"
        )
    return picture
