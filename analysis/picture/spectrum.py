"""What of the reference is pattern and what is noise: its radial spectrum and Wiener filter.

Where the paper keeps only the frequencies of a ZOI that stand above the noise, this keeps the
frequencies of the whole reference, weighted by how far they stand above it (docs/method.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CUT = 0.02
"""Frequencies with a smaller Wiener gain are left out altogether."""
ROLL_OFF = (0.27, 0.33)
"""Cycles per pixel between which the reference is faded out: beyond, no interpolator is exact."""
NOISE_BAND = 0.52
"""Cycles per pixel above which (towards the corners of the spectrum) only noise is expected."""
_BINS_PER_CYCLE = 200
_MARGIN = 32


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """The reference with its noise filtered out, on whole pixels.

    Attributes
    ----------
    level : (H, W) float32, GL
        Wiener-filtered, ``mean`` subtracted.
    grad_x, grad_y : (H, W) float32, GL/px
    mean : float, GL
    noise : float, GL
        Standard deviation of the noise in the reference, as given or as its spectrum shows.
    left_gradient : float, 1/px^2
        Mean square of a filtered gradient over the variance of the noise, where there is only noise.
    own_noise : (3,) float64
        What the noise of a pixel puts into f, f_xx and f_yy of that pixel, shares of it.
    """

    level: NDArray[np.float32]
    grad_x: NDArray[np.float32]
    grad_y: NDArray[np.float32]
    mean: float
    noise: float
    left_gradient: float
    own_noise: NDArray[np.float64]


def filtered_pattern(image: NDArray[np.float32], noise: float | None, degree: int) -> Pattern:
    """Separate the pattern from the noise by a Wiener filter and derive it.

    Parameters
    ----------
    image : (H, W) float32, GL
    noise : float, GL, or None
        Known standard deviation of the noise; None: taken from the corners of the spectrum.
    degree : int
        Of the spline whose derivative is taken.
    """
    from scipy import fft

    mean = float(image.mean(dtype=np.float64))
    radius, power = radial_spectrum(image - np.float32(mean))
    floor = float(np.median(power[radius > NOISE_BAND]))
    variance = floor if noise is None else noise**2
    height, width = image.shape
    padded = np.pad(
        image - np.float32(mean), _MARGIN, mode="reflect" if min(image.shape) > _MARGIN else "edge"
    )
    # The far side is padded once more so that the length is a fast one.
    lengths = [fft.next_fast_len(n, real=True) for n in padded.shape]
    padded = np.pad(padded, [(0, n - m) for n, m in zip(lengths, padded.shape, strict=True)], mode="edge")
    ky = np.fft.fftfreq(lengths[0])[:, None]
    kx = np.fft.rfftfreq(lengths[1])[None, :]
    k = np.hypot(ky, kx)
    gain = wiener_gain(radius, power, variance)
    response = np.interp(k, radius, gain).astype(np.float32)
    spectrum = fft.rfft2(padded, workers=2) * response
    along_y = _gradient_response(degree, lengths[0])[:, None]
    along_x = _gradient_response(degree, lengths[1])[None, : lengths[1] // 2 + 1]
    inside = (slice(_MARGIN, _MARGIN + height), slice(_MARGIN, _MARGIN + width))

    def back(s: NDArray[np.complex64]) -> NDArray[np.float32]:
        return np.ascontiguousarray(fft.irfft2(s, s=tuple(lengths), workers=2)[inside], np.float32)

    return Pattern(
        level=back(spectrum),
        grad_x=back(spectrum * along_x),
        grad_y=back(spectrum * along_y),
        mean=mean,
        noise=float(np.sqrt(variance)),
        left_gradient=float(np.mean(np.abs(response * along_x) ** 2)),
        own_noise=_at_no_lag(response, kx, ky),
    )


def _at_no_lag(
    response: NDArray[np.float32], kx: NDArray[np.floating], ky: NDArray[np.floating]
) -> NDArray[np.float64]:
    """The filters of f, f_xx and f_yy (differences of pixels) in space, at the pixel itself, (3,)."""
    bends = (2 * np.cos(2 * np.pi * k) - 2 for k in (kx, ky))
    return np.array([np.mean(response), *(np.mean(response * bend) for bend in bends)], np.float64)


def radial_spectrum(image: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Radius (cycles/px) and mean power in rings; white noise of variance s^2 gives s^2 everywhere."""
    from scipy import fft

    taper = np.outer(*(np.hanning(n + 2)[1:-1] for n in image.shape)).astype(np.float32)
    taper /= np.sqrt(np.mean(taper**2, dtype=np.float64))
    offset = np.average(image, weights=taper**2)
    power = np.abs(fft.rfft2((image - np.float32(offset)) * taper, workers=2)) ** 2 / image.size
    radius = np.hypot(np.fft.fftfreq(image.shape[0])[:, None], np.fft.rfftfreq(image.shape[1])[None, :])
    ring = np.minimum((radius * _bins(image.shape)).astype(np.intp), int(0.70 * _bins(image.shape)))
    count = np.bincount(ring.ravel())
    seen = count > 0
    sums = np.bincount(ring.ravel(), weights=power.ravel())
    mid = np.bincount(ring.ravel(), weights=radius.ravel())
    return mid[seen] / count[seen], sums[seen] / count[seen]


def _bins(shape: tuple[int, ...]) -> float:
    """Rings per cycle/px: as many as the shorter side resolves, at most 200."""
    return float(min(_BINS_PER_CYCLE, max(min(shape) // 2, 8)))


def wiener_gain(
    radius: NDArray[np.float64], power: NDArray[np.float64], variance: float
) -> NDArray[np.float64]:
    """Gain max(1 - noise/P, 0), cut and faded out, for each ring."""
    gain = np.maximum(1 - variance / np.maximum(power, 1e-30), 0)
    gain[gain < CUT] = 0
    low, high = ROLL_OFF
    fade = 0.5 * (1 + np.cos(np.pi * np.clip((radius - low) / (high - low), 0, 1)))
    return np.asarray(gain * fade)


def _gradient_response(degree: int, length: int) -> NDArray[np.complex64]:
    from analysis.picture.splines import gradient_filter

    # A linear spline has no derivative on whole pixels; the quintic's stands in for it.
    return gradient_filter(max(degree, 5), length).astype(np.complex64)
