"""Fig. 1 of the paper for any ZOI: grey levels, windowed spectrum with the frequencies used, and their phases.

The last panel compares the phase differences with those of the measured displacement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FLOOR, HIGHEST, LOBE_BINS, NO_PATTERN = 0.05, 0.7 * np.pi, 2.5, 1e-6
"""A frequency is used from this share of the largest amplitude on, up to rad/px, beyond the lobe of zero, above GL."""


@dataclass(frozen=True, slots=True, eq=False)
class ZoiSpectrum:
    """One ZOI of two pictures under a bi-triangular window.

    Attributes
    ----------
    before, after : (N, N) float64, GL
        Grey levels, the second read at the whole-pixel displacement.
    shift : (2,) float64, px
        That displacement, u and v.
    kx, ky : (N, N) float64, rad/px
        Wave vectors, zero in the middle.
    amplitude : (N, N) float64, GL
        Of the spectrum of ``before``, divided by the sum of the window.
    phase : (N, N) float64, rad
        arg G - arg F.
    used : (N, N) bool
        Frequencies strong enough, in a half-plane.
    u, v : float, px
        Displacement from their phases (eq. 5).
    """

    before: Floats
    after: Floats
    shift: Floats
    kx: Floats
    ky: Floats
    amplitude: Floats
    phase: Floats
    used: NDArray[np.bool_]
    u: float
    v: float


def zoi_spectrum(
    reference: NDArray[Any], deformed: NDArray[Any], left: int, top: int, size: int, search_px: int = 8
) -> ZoiSpectrum:
    """Spectra and phases of the ZOI whose first pixel is (left, top): eq. 2-5 of the paper.

    The displacement is NaN where there is no pattern.
    """
    before = _cut(reference, left, top, size)
    whole = _whole_pixels(before, _cut(deformed, left - search_px, top - search_px, size + 2 * search_px))
    line = 1 - np.abs(2 * np.arange(size) - size + 1) / (size + 1)
    window, k = np.outer(line, line), 2 * np.pi * np.fft.fftfreq(size)
    kx, ky = np.meshgrid(k, k)

    def of(picture: Floats) -> NDArray[np.complex128]:
        return np.asarray(np.fft.fft2((picture - np.average(picture, weights=window)) * window))

    f = of(before)
    used = _used(np.abs(f), kx, ky)
    after = _cut(deformed, left + int(whole[0]), top + int(whole[1]), size)
    u, v = whole + _moved(np.angle(of(after) * np.conj(f)), used, kx, ky)
    nearest = np.rint([u, v]) if np.isfinite([u, v]).all() else np.zeros(2)
    after = _cut(deformed, left + int(nearest[0]), top + int(nearest[1]), size)
    amplitude, phase, used, kx, ky = (
        np.fft.fftshift(one)
        for one in (np.abs(f) / window.sum(), np.angle(of(after) * np.conj(f)), used, kx, ky)
    )
    return ZoiSpectrum(before, after, nearest, kx, ky, amplitude, phase, used, float(u), float(v))


def _whole_pixels(patch: Floats, around: Floats) -> Floats:
    """u, v of the best zero-mean normalised correlation (eq. 2-3), px."""
    from scipy.signal import correlate

    ones, n = np.ones(patch.shape), patch.size
    energy = correlate(around**2, ones, "valid") - correlate(around, ones, "valid") ** 2 / n
    score = correlate(around, patch - patch.mean(), "valid") / np.sqrt(np.maximum(energy, 1e-12))
    reach = (len(around) - len(patch)) // 2
    row, column = np.unravel_index(int(np.argmax(score)), score.shape)
    return np.array([column - reach, row - reach], np.float64)


def _used(amplitude: Floats, kx: Floats, ky: Floats) -> NDArray[np.bool_]:
    """Frequencies whose phase is used: a half-plane without the lobe of zero frequency."""
    k = np.hypot(kx, ky)
    half = (kx > 0) | ((kx == 0) & (ky > 0))
    band = half & (k > LOBE_BINS * 2 * np.pi / len(kx)) & (k <= HIGHEST)
    return np.asarray(band & (amplitude >= max(FLOOR * float(np.max(amplitude * band)), NO_PATTERN)))


def _moved(phase: Floats, used: NDArray[np.bool_], kx: Floats, ky: Floats) -> Floats:
    """u, v from the phases (eq. 4-5, with the sign of exp(-ik.x)), px; NaN where there are too few directions."""
    waves = np.stack([kx[used], ky[used]], axis=1)
    if np.linalg.matrix_rank(waves) < 2:
        return np.full(2, np.nan)
    return np.asarray(-np.linalg.lstsq(waves, phase[used], rcond=None)[0])


def _cut(image: NDArray[Any], left: int, top: int, size: int) -> Floats:
    """A square of the picture; beyond the edge, the edge is repeated."""
    rows = np.clip(np.arange(top, top + size), 0, image.shape[0] - 1)
    columns = np.clip(np.arange(left, left + size), 0, image.shape[1] - 1)
    return image[np.ix_(rows, columns)].astype(np.float64)


def draw_spectrum(drawn: Any, spectrum: ZoiSpectrum, title: str) -> None:
    """Four panels on an empty matplotlib figure."""
    drawn.suptitle(title, fontsize=10)
    axes = drawn.subplots(1, 4, width_ratios=[1, 1.25, 1.25, 1.3])
    axes[0].imshow(spectrum.before, cmap="gray")
    axes[0].set_title("grey levels of the ZOI", fontsize=9)
    axes[0].set_xlabel("x, px")
    axes[0].set_ylabel("y, px")
    _amplitude(axes[1], spectrum)
    _phase_map(axes[2], spectrum)
    _phase_line(axes[3], spectrum)


def _amplitude(axes: Any, spectrum: ZoiSpectrum) -> None:
    values = 20 * np.log10(np.maximum(spectrum.amplitude / spectrum.amplitude.max(), 1e-4))
    picture = axes.imshow(values, extent=_extent(spectrum), cmap="viridis", vmin=-60)
    axes.figure.colorbar(picture, ax=axes, shrink=0.7, label="amplitude, dB")
    used = spectrum.used
    axes.plot(spectrum.kx[used], spectrum.ky[used], "r.", markersize=2.5)
    axes.set_title(f"amplitude; {np.count_nonzero(used)} used (red)", fontsize=9)
    _label(axes)


def _phase_map(axes: Any, spectrum: ZoiSpectrum) -> None:
    values = np.where(spectrum.used, spectrum.phase, np.nan)
    largest = max(float(np.nanmax(np.abs(values))), 1e-3) if spectrum.used.any() else 1.0
    picture = axes.imshow(values, extent=_extent(spectrum), cmap="RdBu_r", vmin=-largest, vmax=largest)
    axes.figure.colorbar(picture, ax=axes, shrink=0.7, label="phase difference, rad")
    axes.set_title("phase after less before", fontsize=9)
    _label(axes)


def _phase_line(axes: Any, spectrum: ZoiSpectrum) -> None:
    used = spectrum.used
    du, dv = spectrum.u - spectrum.shift[0], spectrum.v - spectrum.shift[1]
    predicted = -(spectrum.kx * du + spectrum.ky * dv)[used]
    axes.scatter(
        predicted, spectrum.phase[used], s=200 * (spectrum.amplitude / spectrum.amplitude.max())[used]
    )
    if predicted.size:
        axes.axline((0, 0), slope=1, color="k", linewidth=0.8)
    axes.set_title(f"u = {spectrum.u:.3f} px, v = {spectrum.v:.3f} px", fontsize=9)
    axes.set_xlabel("-k . displacement (eq. 4), rad")
    axes.set_ylabel("phase difference, rad; size: amplitude")
    axes.grid(alpha=0.3)


def _extent(spectrum: ZoiSpectrum) -> tuple[float, float, float, float]:
    low, high = float(spectrum.kx.min()), float(spectrum.kx.max())
    half = (high - low) / (2 * (len(spectrum.kx) - 1))
    return low - half, high + half, high + half, low - half


def _label(axes: Any) -> None:
    axes.set_xlabel("k along x, rad/px")
    axes.set_ylabel("k along y, rad/px")
