"""What no unbiased estimator with a given weight can beat; nothing of ``analysis`` is used.

The limit of weighted least squares for a known pattern with white noise of standard deviation sigma
in both images: covariance 2 sigma^2 (J'wJ)^-1 (J'w^2J) (J'wJ)^-1 with the six affine modes, and for a displacement
(u, v) the response (J'wJ)^-1 J'w (f_x u + f_y v). The attenuation of a sinusoid is the Fourier transform of the weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NAMES = ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")


def gaussian(size: int) -> NDArray[np.float64]:
    """The default weight along one axis: sigma = size/6."""
    x = np.arange(size) - (size - 1) / 2
    return np.exp(-0.5 * (x / (size / 6)) ** 2)


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """Of each parameter and ZOI, (6, R, C).

    ``sigma`` is the standard deviation for noise of 1 in the unit of the pictures; ``response`` is what noise-free
    pictures of a displacement field give: the window's attenuation.
    """

    sigma: Floats
    response: Floats | None = None


def least_squares(
    slopes: tuple[Floats, Floats],
    first_x: NDArray,
    first_y: NDArray,
    line: Floats,
    field: tuple[Floats, Floats] | None = None,
) -> Limit:
    """The limit for the gradient of a picture along x and y, (H, W) each, in ZOIs with these first pixels.

    ``line`` (n,) is the weight along one axis, ``field`` a displacement on the pixels, two (H, W) px.
    """
    size, shape = len(line), (6, len(first_y), len(first_x))
    x, weight = np.arange(size) - (size - 1) / 2, np.outer(line, line).ravel()
    sigma, response = np.empty(shape), np.empty(shape)
    for row, top in enumerate(first_y):
        for column, left in enumerate(first_x):
            cut = np.s_[top : top + size, left : left + size]
            fx, fy = slopes[0][cut], slopes[1][cut]
            j = np.stack([fx, fx * x, fx * x[:, None], fy, fy * x, fy * x[:, None]]).reshape(6, -1)
            jw = j * weight
            inverse = np.linalg.inv(jw @ j.T)
            sigma[:, row, column] = np.sqrt(2 * np.diag(inverse @ (jw * weight @ j.T) @ inverse))
            if field is not None:
                change = (fx * field[0][cut] + fy * field[1][cut]).ravel()
                response[:, row, column] = inverse @ (jw @ change)
    return Limit(sigma, None if field is None else response)


def noise_limit(
    level: Floats, first_x: NDArray, first_y: NDArray, line: Floats, sigma: float
) -> dict[str, float]:
    """Root mean square over the ZOIs for a noise-free reference (H, W) and noise in its unit."""
    found = least_squares((derivative(level, 1), derivative(level, 0)), first_x, first_y, line).sigma
    return dict(zip(NAMES, sigma * np.sqrt(np.mean(found**2, axis=(1, 2))), strict=True))


def derivative(level: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Spectral derivative of a padded image; exact for a band-limited pattern away from its edges."""
    n = level.shape[axis]
    padded = np.concatenate([level, np.flip(level, axis)], axis=axis)
    k = 2j * np.pi * np.fft.fftfreq(2 * n)
    shape = [1, 1]
    shape[axis] = 2 * n
    out = np.fft.ifft(np.fft.fft(padded, axis=axis) * k.reshape(shape), axis=axis).real
    return np.take(out, np.arange(n), axis=axis)


def l10(line: NDArray[np.float64]) -> float:
    """Period of a displacement along x that has lost 10 % in its amplitude, px, of a separable symmetric weight."""
    x = np.arange(len(line)) - (len(line) - 1) / 2
    periods = np.linspace(1.0, 20.0, 20001) * len(line) / 2
    response = np.cos(2 * np.pi * np.outer(1 / periods, x)) @ line / line.sum()
    return float(np.interp(0.9, response, periods))
