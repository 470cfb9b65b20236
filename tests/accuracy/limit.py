"""What no unbiased estimator with a given weight can beat; nothing of ``analysis`` is used.

The limit of weighted least squares for a known pattern with white noise of standard deviation sigma
in both images: covariance 2 sigma^2 (J'wJ)^-1 (J'w^2J) (J'wJ)^-1 with the six affine modes. The attenuation of
a sinusoid is the Fourier transform of the same weight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NAMES = ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")


def gaussian(size: int) -> NDArray[np.float64]:
    """The default weight along one axis: sigma = size/6."""
    x = np.arange(size) - (size - 1) / 2
    return np.exp(-0.5 * (x / (size / 6)) ** 2)


def noise_limit(
    level: NDArray[np.float64], first_x: NDArray, first_y: NDArray, line: NDArray[np.float64], sigma: float
) -> dict[str, float]:
    """Root mean square over the ZOIs of the limit of each parameter.

    Parameters
    ----------
    level : (H, W), the noise-free reference; sigma in its unit
    first_x, first_y : first pixels of the ZOIs
    line : (n,), the weight along one axis
    """
    size = len(line)
    fy, fx = (derivative(level, axis) for axis in (0, 1))
    x = np.arange(size) - (size - 1) / 2
    ones = np.ones((size, size))
    modes = [ones, ones * x, ones * x[:, None]]
    w = np.outer(line, line)
    total = np.zeros(6)
    for top in first_y:
        for left in first_x:
            zoi = np.s_[top : top + size, left : left + size]
            j = np.stack([(g[zoi] * m).ravel() for g in (fx, fy) for m in modes])
            inverse = np.linalg.inv((j * w.ravel()) @ j.T)
            total += np.diag(inverse @ ((j * w.ravel() ** 2) @ j.T) @ inverse)
    values = np.sqrt(2 * sigma**2 * total / (len(first_x) * len(first_y)))
    return dict(zip(NAMES, values, strict=True))


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
    """Period of a displacement along x that has lost 10 % in its amplitude, px.

    For an affine fit with a separable symmetric weight: the displacement at the centre is the weighted
    mean, so the response is the transform of the weight.
    """
    x = np.arange(len(line)) - (len(line) - 1) / 2
    periods = np.linspace(1.0, 20.0, 20001) * len(line) / 2
    response = np.cos(2 * np.pi * np.outer(1 / periods, x)) @ line / line.sum()
    return float(np.interp(0.9, response, periods))
