"""The paper's own estimator, errata mended: for comparison only, nothing here measures a test.

J. Molimard, Implementation of the direct evaluation of strains in a frequency-based image analysis
code for random patterns. What it does, in the order of the paper:

- section 2.2: whole-pixel correlation (eq. 2-3), then displacement from the phases of all usable
  frequencies of a bi-triangular window, by pseudo-inverse (eq. 4-5), unweighted, in one shot;
- section 3.1: the deformed picture is overlaid on the reference by linear interpolation of grey levels;
  derivatives of the phases through the derivative of a Gaussian window (eq. 6-9); the six affine
  modes from all of them together, by least squares with a sensitivity matrix that numerical
  deformations of each reference ZOI have calibrated ("in situ").

Mended: (3) correlates instead of convolving; (4) carries the sign of the kernel exp(-ik.x); (8) has
1/|k| instead of |k| (here implied by the calibration); (9) has the derivative of the window that
it names; four reference deformations become six, since two translations, a rotation and a shear
span no normal strain. Where the paper is silent the choice is a field of ``PaperSettings``.
It has no noise, no uncertainty and no rejection.

A property of the printed recipe shows here: reading at a fraction a of a pixel by linear
interpolation adds a (1 - a)/2 d2f/dx2, and under a Gaussian window that is, to phase derivatives, a
strain of -a (1 - a)/sigma_w^2 (docs/method.md): -2.2e-3 at half a pixel and sigma_w = 10.7 px.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from analysis.field import ZoiGrid

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Overlay = Literal["linear", "whole-pixel"]
CHUNK = 64
"""ZOIs done at once: bounds the memory."""
NO_PATTERN = 1e-6
"""GL, summed under the window: a smaller amplitude is rounding."""
U, DU_DX, DU_DY, V, DV_DX, DV_DY = range(6)


@dataclass(frozen=True, slots=True)
class PaperSettings:
    """What the paper leaves open, and how it is read here.

    Attributes
    ----------
    amplitude_floor : float
        A frequency is usable where |F_k| is at least this share of the largest of its ZOI (the paper:
        "amplitude higher than zero").
    highest : float, rad/px
        ... and |k| at most this, so that half a pixel cannot wrap a phase.
    overlay : "linear" | "whole-pixel"
        How the deformed picture is translated before the strain: by the displacement found, with linear
        interpolation (section 3.1, step 1), or by whole pixels (section 2.2), which interpolates nothing.
    iterations : int
        How often the deformed picture is overlaid on the reference for the strain: 1 is one shot after
        the translation; more until convergence, as the paper describes.
    search_px : int, px
        Whole-pixel search to either side.
    calibration_px : float, px
        Largest displacement within a ZOI of the numerical deformations.
    """

    amplitude_floor: float = 0.05
    highest: float = 0.7 * np.pi
    overlay: Overlay = "linear"
    iterations: int = 1
    search_px: int = 4
    calibration_px: float = 0.1

    def __post_init__(self) -> None:
        if self.overlay not in get_args(Overlay):
            raise ValueError(f"overlay is one of {', '.join(get_args(Overlay))}, not {self.overlay!r}")
        if self.iterations < 1 or self.search_px < 0:
            raise ValueError("iterations must be at least 1 and search_px not negative")
        if not (0 < self.amplitude_floor < 1 and 0 < self.highest <= np.pi and 0 < self.calibration_px < 1):
            raise ValueError(
                "amplitude_floor and calibration_px lie between 0 and 1, highest between 0 and pi rad/px"
            )


@dataclass(frozen=True, slots=True, eq=False)
class PaperField:
    """What the paper's estimator measures, (R, C) each; NaN where a ZOI leaves the picture.

    u and v, px, and the number of usable frequencies are of the bi-triangular window (section 2.2), the gradients
    of the Gaussian one (section 3.1).
    """

    grid: ZoiGrid
    u: Floats
    v: Floats
    du_dx: Floats
    du_dy: Floats
    dv_dx: Floats
    dv_dy: Floats
    frequencies: NDArray[np.int64]

    @property
    def exx(self) -> Floats:
        """Strain along x, (R, C)."""
        return self.du_dx

    @property
    def eyy(self) -> Floats:
        """Strain along y, (R, C)."""
        return self.dv_dy

    @property
    def exy(self) -> Floats:
        """Tensor shear, (R, C)."""
        return 0.5 * (self.du_dy + self.dv_dx)

    @property
    def omega(self) -> Floats:
        """Rotation, (R, C), rad, clockwise on the screen."""
        return 0.5 * (self.dv_dx - self.du_dy)


class PaperEstimator:
    """The estimator for one reference picture (H, W), GL, that covers the grid."""

    def __init__(
        self, reference: NDArray[np.generic], grid: ZoiGrid, settings: PaperSettings | None = None
    ) -> None:
        self.grid, self.settings = grid, settings or PaperSettings()
        self._reference = np.asarray(reference, np.float64)
        if self._reference.ndim != 2 or not _covers(self._reference.shape, grid):
            raise ValueError(
                f"a picture of shape {self._reference.shape} does not cover the region {grid.roi.text}"
            )
        size = grid.size
        self._k = 2 * np.pi * np.fft.fftfreq(size)
        self._at = np.argwhere(grid.active)
        self._triangle = np.outer(*[1 - 2 * np.abs(_axis(size)) / (size + 1)] * 2)
        self._windows = gaussian_windows(size)

    def measure(self, deformed: NDArray[np.generic]) -> PaperField:
        """Displacement and strain of all active ZOIs against the reference."""
        image = np.asarray(deformed, np.float64)
        if image.shape != self._reference.shape:
            raise ValueError(f"the deformed picture is {image.shape}, the reference {self._reference.shape}")
        found = [np.empty((0, 7)), *(self._measure_chunk(image, at) for at in self._chunks())]
        maps = np.full((7, *self.grid.shape), np.nan)
        maps[:, self._at[:, 0], self._at[:, 1]] = np.concatenate(found).T
        count = np.nan_to_num(maps[6]).astype(np.int64)
        return PaperField(self.grid, maps[0], maps[3], maps[1], maps[2], maps[4], maps[5], count)

    def _chunks(self) -> Iterator[NDArray[np.int64]]:
        """(Z, 2) first rows and columns of some ZOIs, px."""
        first = np.stack([self.grid.first_y[self._at[:, 0]], self.grid.first_x[self._at[:, 1]]], axis=1)
        for start in range(0, len(first), CHUNK):
            yield first[start : start + CHUNK]

    def _measure_chunk(self, image: Floats, at: NDArray[np.int64]) -> Floats:
        """(Z, 7): u, its gradients, v, its gradients, number of frequencies."""
        size, parameters = self.grid.size, np.zeros((len(at), 6))
        still = np.zeros((6, len(at)))
        patches = _warped(self._reference, at, size, still)
        whole = self._whole_pixels(patches, image, at)
        parameters[:, [U, V]] = whole
        sub, count = self._sub_pixel(patches, _warped(image, at, size, parameters.T))
        displacement = whole + sub
        if self.settings.overlay == "linear":
            parameters[:, [U, V]] = displacement
        parameters = self._strain(patches, image, at, parameters)
        parameters[:, [U, V]] = displacement
        return np.column_stack([parameters, count])

    def _whole_pixels(self, patches: Floats, image: Floats, at: NDArray[np.int64]) -> Floats:
        """(Z, 2): whole-pixel u, v of the best zero-mean normalised correlation (eq. 2-3)."""
        from scipy.fft import irfft2, rfft2

        reach, size = self.settings.search_px, self.grid.size
        around = size + 2 * reach
        wide = _warped(image, at - reach, around, np.zeros((6, len(at))))
        zero = patches - patches.mean(axis=(1, 2), keepdims=True)
        lags = 2 * reach + 1
        product = rfft2(wide, workers=1) * np.conj(rfft2(zero, (around, around), workers=1))
        cross = irfft2(product, (around, around), workers=1)[:, :lags, :lags]
        energy = _box(wide**2, size) - _box(wide, size) ** 2 / size**2
        score = cross / np.sqrt(np.maximum(energy, 1e-12))
        best = np.argmax(score.reshape(len(at), -1), axis=1)
        return np.stack([best % lags - reach, best // lags - reach], axis=1).astype(float)

    def _sub_pixel(self, reference: Floats, deformed: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """(Z, 2) px and (Z,) number of frequencies: eq. 4-5 with the sign of exp(-ik.x)."""
        f = _spectra(reference, self._triangle[None])[0]
        g = _spectra(deformed, self._triangle[None])[0]
        usable = self.usable(f)
        phase = np.where(usable, np.angle(g * np.conj(f)), 0.0)
        ky, kx = self._k[:, None], self._k[None, :]
        normal = np.empty((len(f), 2, 2))
        normal[:, 0, 0] = np.sum(usable * kx**2, axis=(1, 2))
        normal[:, 0, 1] = normal[:, 1, 0] = np.sum(usable * kx * ky, axis=(1, 2))
        normal[:, 1, 1] = np.sum(usable * ky**2, axis=(1, 2))
        right = -np.stack([np.sum(phase * kx, axis=(1, 2)), np.sum(phase * ky, axis=(1, 2))], axis=1)
        return _solved(normal, right), np.count_nonzero(usable, axis=(1, 2))

    def usable(self, spectrum: Complexes, lobe_bins: float = 2.5) -> NDArray[np.bool_]:
        """Frequencies whose phase is used, (Z, N, N): a half-plane without the lobe of zero frequency."""
        ky, kx = self._k[:, None], self._k[None, :]
        k = np.hypot(kx, ky)
        half = (kx > 0) | ((kx == 0) & (ky > 0))
        band = half & (k > lobe_bins * 2 * np.pi / self.grid.size) & (k <= self.settings.highest)
        amplitude = np.abs(spectrum)
        largest = np.max(amplitude * band, axis=(1, 2), keepdims=True)
        return np.asarray(
            band & (amplitude >= np.maximum(self.settings.amplitude_floor * largest, NO_PATTERN))
        )

    def _strain(self, patches: Floats, image: Floats, at: NDArray[np.int64], start: Floats) -> Floats:
        """(Z, 6): the six affine parameters, from the derivatives of the phases (eq. 6-9)."""
        spectra = _spectra(patches, self._windows)
        # |k| < 2/sigma_w is the lobe of zero frequency; sigma_w = size/6.
        usable = self.usable(spectra[0], lobe_bins=2 * 6 / (2 * np.pi))
        picked = [np.nonzero(one) for one in usable]
        before = _phase_slopes(spectra)
        solvers = self._calibrated(at, picked)
        parameters = start.copy()
        for _ in range(self.settings.iterations):
            seen = _phase_slopes(_spectra(_warped(image, at, self.grid.size, parameters.T), self._windows))
            for z, (rows, columns) in enumerate(picked):
                change = seen[:, z, rows, columns] - before[:, z, rows, columns]
                # Composed to first order: the steps are small against 1.
                parameters[z] += solvers[z] @ change.ravel()
        return parameters

    def _calibrated(self, at: NDArray[np.int64], picked: list[tuple[NDArray[np.intp], ...]]) -> list[Floats]:
        """For each ZOI the pseudo-inverse, (6, 2 K), of its sensitivity to the six modes."""
        size = self.grid.size
        amount = self.settings.calibration_px * np.array([1, 2 / size, 2 / size] * 2)
        columns: list[list[Floats]] = [[] for _ in picked]
        for mode in range(6):
            moved = []
            for sign in (1, -1):
                deformation = np.zeros((6, len(at)))
                # Content that moves by +b is what is read at -b.
                deformation[mode] = -sign * amount[mode]
                moved.append(
                    _phase_slopes(_spectra(_warped(self._reference, at, size, deformation), self._windows))
                )
            for z, where in enumerate(picked):
                index: tuple[Any, ...] = (slice(None), z, *where)
                change = moved[0][index] - moved[1][index]
                columns[z].append(change.ravel() / (2 * amount[mode]))
        return [
            np.linalg.pinv(np.column_stack(one)) if one[0].size else np.full((6, 0), np.nan)
            for one in columns
        ]


def gaussian_windows(size: int) -> Floats:
    """The Gaussian analysis window and its derivatives by the position of its centre, (3, N, N).

    sigma = size/6, which is the 10.7 px of the paper at 64. d w(xi - x)/dx = (xi - x)/sigma^2 w:
    the sign and factor that eq. (9) should have.
    """
    x, sigma = _axis(size), size / 6
    line = np.exp(-0.5 * (x / sigma) ** 2)
    slope = x / sigma**2 * line
    return np.stack([np.outer(line, line), np.outer(line, slope), np.outer(slope, line)])


def _axis(size: int) -> Floats:
    return np.asarray(np.arange(size) - (size - 1) / 2, np.float64)


def _covers(shape: tuple[int, ...], grid: ZoiGrid) -> bool:
    return shape[0] >= grid.roi.y + grid.roi.height and shape[1] >= grid.roi.x + grid.roi.width


def _spectra(patches: Floats, windows: Floats) -> Complexes:
    """(W, Z, N, N): transforms under each window, the mean under the first one subtracted before."""
    from scipy.fft import fft2

    mean = np.einsum("zij,ij->z", patches, windows[0]) / windows[0].sum()
    return np.asarray(fft2((patches - mean[:, None, None])[None] * windows[:, None], workers=2))


def _phase_slopes(spectra: Complexes) -> Floats:
    """(2, Z, N, N): derivatives of the phases by x and y (eq. 7), rad/px."""
    plain = spectra[0]
    power = np.maximum(np.abs(plain) ** 2, 1e-30)
    return np.asarray(np.imag(spectra[1:] * np.conj(plain)) / power)


def _solved(normal: Floats, right: Floats) -> Floats:
    """Solutions of small systems; NaN where a ZOI has too few directions (eq. 5's determinant)."""
    determinant = normal[:, 0, 0] * normal[:, 1, 1] - normal[:, 0, 1] ** 2
    good = determinant > 1e-9
    safe = np.where(good[:, None, None], normal, np.eye(2))
    solution = np.linalg.solve(safe, right[:, :, None])[:, :, 0]
    return np.asarray(np.where(good[:, None], solution, np.nan))


def _box(values: Floats, size: int) -> Floats:
    """Sums over all squares of ``size`` px, (Z, M - size + 1, M - size + 1)."""
    total = np.pad(values, ((0, 0), (1, 0), (1, 0))).cumsum(axis=1).cumsum(axis=2)
    return np.asarray(
        total[:, size:, size:] - total[:, :-size, size:] - total[:, size:, :-size] + total[:, :-size, :-size]
    )


def _warped(image: Floats, at: NDArray[np.int64], size: int, parameters: Floats) -> Floats:
    """Each ZOI read at its displaced places by linear interpolation, (Z, N, N), GL.

    Beyond the picture its edge is repeated; a ZOI whose parameters are NaN is read undisplaced.
    """
    height, width = image.shape
    p = np.nan_to_num(parameters)[:, :, None, None]
    x, y = _axis(size)[None, None, :], _axis(size)[None, :, None]
    column = at[:, 1, None, None] + np.arange(size) + p[U] + p[DU_DX] * x + p[DU_DY] * y
    row = at[:, 0, None, None] + np.arange(size)[:, None] + p[V] + p[DV_DX] * x + p[DV_DY] * y
    column, row = np.clip(column, 0, width - 1), np.clip(row, 0, height - 1)
    c = np.minimum(column.astype(np.int64), width - 2)
    r = np.minimum(row.astype(np.int64), height - 2)
    a, b = column - c, row - r
    flat = image.ravel()
    i = r * width + c
    top = flat[i] * (1 - a) + flat[i + 1] * a
    bottom = flat[i + width] * (1 - a) + flat[i + width + 1] * a
    return np.asarray(top * (1 - b) + bottom * b)
