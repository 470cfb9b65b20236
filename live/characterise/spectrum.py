"""Fig. 1 of the paper for any ZOI: grey levels, windowed spectrum with the frequencies used, and their phases.

The last panel compares the phase differences with those of the measured displacement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi, ZoiGrid
from analysis.paper_estimator import PaperEstimator, PaperSettings

Floats = NDArray[np.float64]


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
    """Spectra and phases of the ZOI whose first pixel is (left, top)."""
    grid = ZoiGrid.cover(Roi(left, top, size, size), size, size)
    estimator = PaperEstimator(reference, grid, PaperSettings(search_px=search_px))
    found = estimator.measure(deformed)
    u, v = float(found.u[0, 0]), float(found.v[0, 0])
    whole = np.rint([u, v]) if np.isfinite([u, v]).all() else np.zeros(2)
    before = _cut(reference, left, top, size)
    after = _cut(deformed, left + int(whole[0]), top + int(whole[1]), size)
    line = 1 - np.abs(2 * np.arange(size) - size + 1) / (size + 1)
    window = np.outer(line, line)
    f, g = (np.fft.fft2((p - np.average(p, weights=window)) * window) for p in (before, after))
    used = estimator.usable(f[None])[0]
    k = np.fft.fftshift(2 * np.pi * np.fft.fftfreq(size))
    kx, ky = np.meshgrid(k, k)
    shift = np.fft.fftshift
    return ZoiSpectrum(
        before, after, whole, kx, ky,
        shift(np.abs(f)) / window.sum(), shift(np.angle(g * np.conj(f))), shift(used), u, v,
    )  # fmt: skip


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
