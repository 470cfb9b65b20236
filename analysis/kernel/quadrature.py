"""The paper's method: phase alone, in quadrature to the reference, as sensors of each ZOI.

For ``KernelSettings(estimator="phase")``. The windowed spectrum of the deformed ZOI enters only
through Im(conj(F_k) G_k)/|F_k|, that is |G_k| sin(arg G_k - arg F_k), for the analysis window and
its two first moments (which carry what eq. (6)-(9) of the paper seek in the derivative of the window:
the gradients). All frequencies are solved jointly with their sensitivity matrix, eq. (4)-(5); frequency
by frequency, as eq. (8) has it, neighbouring carriers leak into each other (docs/method.md).

The analysis window is the square root of the kernel's least-squares weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.field import PAIR_INDEX
from analysis.fit.kernel_args import PictureArgs, StopArgs
from analysis.kernel.images import with_second_differences
from analysis.kernel.prepared import PreparedReference

BAND = 0.30
"""Highest frequency used, cycles/px."""
LOBE = 2.0
"""Frequencies below LOBE / (sigma of the analysis window), rad/px, belong to the mean and are left out."""
MIN_POWER = 10.0
"""A frequency is used where |F_k|^2 is this many times the power of the noise."""
ERROR_LEFT = 0.1
"""Share of a step that counts as error left after it."""
MAX_STEP = 2.0
CHUNK = 64

Complex = NDArray[np.complex64]


@dataclass(frozen=True, slots=True, eq=False)
class Sensors:
    """One small image a parameter, to be multiplied with the difference of the images.

    Attributes
    ----------
    weights : (A, 7, n, n) float32
        For u, du_dx, du_dy, v, dv_dx, dv_dy (px units) and for the gain.
    covariance : (A, 21) float32
        Of the six parameters for noise of variance 1 GL^2.
    """

    weights: NDArray[np.float32]
    covariance: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class _Basis:
    """Windows (3, n, n) and the waves of the band: (n, Kx) along x, (Ky, n) along y, used (Ky, Kx)."""

    windows: NDArray[np.float32]
    along_x: Complex
    along_y: Complex
    used: NDArray[np.bool_]
    mean: NDArray[np.float32]

    def spectra(self, images: NDArray[np.float32]) -> Complex:
        """Windowed spectra (..., 3, Ky, Kx) of ZOIs (..., n, n)."""
        windowed = images[..., None, :, :] * self.windows
        return np.asarray(self.along_y @ (windowed @ self.along_x))

    def images(self, spectra: Complex) -> NDArray[np.float32]:
        """Adjoint of ``spectra``, real part, summed over the windows: (..., 3, Ky, Kx) -> (..., n, n)."""
        waves = np.conj(self.along_y.T) @ (spectra @ np.conj(self.along_x.T))
        return np.asarray(np.sum(waves.real * self.windows, axis=-3), np.float32)


def make_sensors(ready: PreparedReference, line: NDArray[np.float64], size: int) -> Sensors:
    """Sensors of all ZOIs of a reference.

    Parameters
    ----------
    ready : PreparedReference
    line : (n,)
        The least-squares weight along one axis.
    """
    basis, channels = _basis(line), with_second_differences(ready.images)
    count = len(ready.origins)
    weights = np.zeros((count, 7, size, size), np.float32)
    covariance = np.zeros((count, 21), np.float32)
    for first in range(0, count, CHUNK):
        part = slice(first, min(first + CHUNK, count))
        level, modes = _zois(channels, ready.origins[part], size)
        weights[part] = _sensors_of(basis, level, modes, ready.pattern.noise)
    flat = weights[:, :6].reshape(count, 6, -1)
    for (i, j), k in PAIR_INDEX.items():
        covariance[:, k] = np.einsum("ax,ax->a", flat[:, i], flat[:, j])
    return Sensors(weights, covariance)


def _basis(line: NDArray[np.float64]) -> _Basis:
    size = len(line)
    x = np.arange(size) - (size - 1) / 2
    window = np.sqrt(line)
    spread = np.sqrt(np.sum(window * x**2) / np.sum(window))
    plain = np.outer(window, window)
    windows = np.stack([plain, plain * x, plain * x[:, None]])
    windows /= np.sqrt(np.sum(windows**2, axis=(1, 2), keepdims=True))  # equal noise in every feature
    step = 2 * np.pi / size
    top = int(2 * np.pi * BAND / step)
    kx, ky = step * np.arange(-top, top + 1), step * np.arange(0, top + 1)
    k = np.hypot(ky[:, None], kx)
    half_plane = (ky[:, None] > 0) | (kx > 0)
    used = half_plane & (k <= 2 * np.pi * BAND) & (k >= LOBE / spread)
    mean = np.outer(line, line)
    return _Basis(
        windows.astype(np.float32),
        np.exp(-1j * np.outer(x, kx)).astype(np.complex64),
        np.exp(-1j * np.outer(ky, x)).astype(np.complex64),
        used,
        (mean / mean.sum()).astype(np.float32),
    )


def _zois(
    channels: NDArray[np.float32], origins: NDArray[np.int64], size: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Filtered level (B, n, n) of some ZOIs, and its changes by the six modes and by blur (B, 9, n, n)."""
    x = (np.arange(size) - (size - 1) / 2).astype(np.float32)
    fx, fy, level, _, *blurred = (zois_of(image, origins, size) for image in channels)
    modes = [g * b for g in (fx, fy) for b in (np.float32(1), x, x[:, None])]
    return level, np.stack([*modes, *blurred], axis=1)


def zois_of(image: NDArray[np.float32], origins: NDArray[np.int64], size: int) -> NDArray[np.float32]:
    """Cut ZOIs out of an image, (B, n, n)."""
    pixel = np.arange(size)
    rows, columns = origins[:, :1] + pixel, origins[:, 1:] + pixel
    return np.asarray(image[rows[:, :, None], columns[:, None, :]])


def _sensors_of(
    basis: _Basis, level: NDArray[np.float32], modes: NDArray[np.float32], noise: float
) -> NDArray[np.float32]:
    """Sensors (B, 7, n, n): joint least squares of all phases in quadrature, blur among what is solved for."""
    level = level - np.sum(level * basis.mean, axis=(1, 2), keepdims=True)
    modes = modes - np.sum(modes * basis.mean, axis=(2, 3), keepdims=True)
    reference = basis.spectra(level)
    power = np.abs(reference) ** 2
    chosen = basis.used & (power > MIN_POWER * noise**2)
    unit = np.where(chosen, reference / np.sqrt(np.maximum(power, 1e-20)), 0).astype(np.complex64)
    sensitivity = np.imag(np.conj(unit)[:, None] * basis.spectra(modes))  # (B, 9, 3, Ky, Kx)
    flat = sensitivity.reshape(*sensitivity.shape[:2], -1).astype(np.float64)
    normal = np.einsum("bik,bjk->bij", flat, flat)
    scale = 1 / np.sqrt(np.maximum(np.einsum("bii->bi", normal), 1e-30))
    normal = normal * scale[:, :, None] * scale[:, None, :] + 1e-6 * np.eye(flat.shape[1])
    solved = (np.linalg.solve(normal, flat * scale[:, :, None]) * scale[:, :, None])[:, :6]
    # Im(conj(unit) G) is the real part of <-i unit, G>: its adjoint gives the sensor.
    phases = solved.reshape(sensitivity[:, :6].shape).astype(np.float32) * (1j * unit)[:, None]
    out = np.empty((len(level), 7, *level.shape[1:]), np.float32)
    out[:, :6] = basis.images(phases.astype(np.complex64))
    total = np.maximum(np.sum(np.where(chosen, power, 0), axis=(1, 2, 3)), 1e-20)
    out[:, 6] = basis.images(np.where(chosen, reference, 0) / total[:, None, None, None].astype(np.float32))
    # The mean of the deformed ZOI is taken off through the sensor.
    return np.asarray(out - np.sum(out, axis=(2, 3), keepdims=True) * basis.mean, np.float32)


def step_of(sensors: NDArray[np.float32], difference: NDArray[np.float32]) -> NDArray[np.float64]:
    """Parameters (A, 6) of difference images (A, n, n), divided by the gain."""
    answer = np.einsum("ajyx,ayx->aj", sensors, difference, optimize=True).astype(np.float64)
    return np.asarray(answer[:, :6] / np.clip(1 + answer[:, 6:], 0.15, 6.0))


def iterate(
    sensors: NDArray[np.float32],
    recorded: NDArray[np.float32],
    origins: NDArray[np.int64],
    picture: PictureArgs,
    table: NDArray[np.float32],
    guess: NDArray[np.float64],
    stop: StopArgs,
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint8]]:
    """Warp, take the phases, compose, until the steps are small.

    Parameters
    ----------
    sensors : (A, 7, n, n), origins : (A, 2), guess : (A, 6)
    recorded : (>= H, >= W) float32, GL
        The reference less its mean.
    picture : PictureArgs
        The deformed image.
    table : (18,) float32
        See ``iteration.track``.
    stop : StopArgs

    Returns
    -------
    parameters (A, 6), state (A,) and iterations (A,), as ``iteration.track`` gives them.
    """
    from analysis.fit.iteration import compose_all, warp_zois, within_image
    from analysis.fit.kernel_args import CONVERGED, LEFT_IMAGE, RUNNING

    size = sensors.shape[-1]
    p = guess.copy()
    state = np.full(len(p), RUNNING, np.uint8)
    iterations = np.zeros(len(p), np.uint8)
    inside = np.empty(len(p), bool)
    for _ in range(stop.max_iterations):
        within_image(picture, origins, size, p, inside)
        state[(state == RUNNING) & ~inside] = LEFT_IMAGE
        running = np.flatnonzero(state == RUNNING)
        for first in range(0, len(running), CHUNK):
            z = running[first : first + CHUNK]
            warped = np.empty((len(z), size, size), np.float32)
            part = p[z]
            warp_zois(picture, table, origins[z], size, part, warped)
            step = _shortened(step_of(sensors[z], warped - zois_of(recorded, origins[z], size)))
            compose_all(part, step)
            p[z] = part
            iterations[z] += 1
            state[z[_converged(step, stop.at(z))]] = CONVERGED
    return p, state, iterations


def _shortened(step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Steps (B, 6) of at most MAX_STEP."""
    length = np.abs(step[:, [0, 3]]).max(axis=1)
    return np.asarray(step * np.minimum(1, MAX_STEP / np.maximum(length, 1e-9))[:, None])


def _converged(step: NDArray[np.float64], stop: StopArgs) -> NDArray[np.bool_]:
    """Whether what a step (B, 6) has left is below the tolerances, (B,)."""
    left = ERROR_LEFT * np.abs(step)
    lengths = (left[:, [0, 3]] <= stop.length[:, None]).all(axis=1)
    return np.asarray(lengths & (left[:, [1, 2, 4, 5]] <= stop.slope[:, None]).all(axis=1))
