"""What of the reference is pattern and what is noise: its radial spectrum and Wiener filter.

Where the paper keeps only the frequencies of a ZOI that stand above the noise, this keeps the
frequencies of the whole reference, weighted by how far they stand above it (docs/method.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.pool import THREADS, do, each

Floats = NDArray[np.float64]
Image = NDArray[np.float32]

CUT = 0.02
"""Frequencies with a smaller Wiener gain are left out altogether."""
ROLL_OFF = (0.27, 0.33)
"""Cycles per pixel between which the reference is faded out: beyond, no interpolator is exact."""
NOISE_BAND = 0.52
"""Cycles per pixel above which (towards the corners of the spectrum) only noise is expected."""
_BINS_PER_CYCLE = 200
_MARGIN = 32
_ROWS = 64


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
    left_level : float
        Mean square of the filtered level over the variance of the noise, where there is only noise.
    """

    level: NDArray[np.float32]
    grad_x: NDArray[np.float32]
    grad_y: NDArray[np.float32]
    mean: float
    noise: float
    left_gradient: float
    own_noise: NDArray[np.float64]
    left_level: float


def filtered_pattern(
    image: Image, noise: float | None, degree: int, out: tuple[Image, Image, Image] | None = None
) -> Pattern:
    """Separate the pattern from the noise by a Wiener filter and derive it.

    Some rows at a time, and in place: at 12 MP most of the time went to memory that was new.

    Parameters
    ----------
    image : (H, W) float32, GL
    noise : float, GL, or None
        Known standard deviation of the noise; None: taken from the corners of the spectrum.
    degree : int
        Of the spline whose derivative is taken.
    out : three of (H, W) float32, optional
        Where grad_x, grad_y and level are written; by default new memory.
    """
    mean = float(image.mean(dtype=np.float64))
    places = [_padded_places(n, "reflect" if min(image.shape) > _MARGIN else "edge") for n in image.shape]
    height, width = (len(place) for place in places)
    room = np.empty(
        (2, max(height * (width // 2 + 1), image.shape[0] * (image.shape[1] // 2 + 1))), np.complex64
    )
    radius, power = _radial_spectrum(image, np.float32(mean), room[0])
    floor = float(np.median(power[radius > NOISE_BAND]))
    variance = floor if noise is None else noise**2
    gain = radius, wiener_gain(radius, power, variance)
    kept = _passed(gain, width)
    spectrum, work = (part[: height * kept].reshape(height, -1) for part in room)
    response = _filtered_spectrum(image, np.float32(mean), places, gain, spectrum)
    along_y = _gradient_response(degree, height)[:, None]
    along_x = _gradient_response(degree, width)[None, :kept]
    of_noise = _of_noise(response, along_x, width, work)
    grad_x, grad_y, level = out or (np.empty(image.shape, np.float32) for _ in range(3))
    for to, along in ((grad_x, along_x), (grad_y, along_y)):
        _multiply(spectrum, along, work)
        _back(work, width, to)
    _back(spectrum, width, level)
    return Pattern(level, grad_x, grad_y, mean, float(np.sqrt(variance)), *of_noise)


def _padded_places(length: int, mode: Literal["reflect", "edge"]) -> NDArray[np.intp]:
    """Which pixels of an image stand along a side of the padded one.

    The far side is padded once more so that the length is a fast one.
    """
    from scipy import fft

    places = np.pad(np.arange(length), _MARGIN, mode=mode)
    return np.pad(places, (0, fft.next_fast_len(len(places), real=True) - len(places)), mode="edge")


def _filtered_spectrum(
    image: Image,
    mean: np.float32,
    places: list[NDArray[np.intp]],
    gain: tuple[Floats, Floats],
    spectrum: NDArray[np.complex64],
) -> Image:
    """The spectrum of an image less ``mean``, padded and filtered, is written to ``spectrum``; returns the filter.

    Both have the columns that the filter passes. ``gain`` are radii (cycles/px) and the gain there.
    """
    from scipy import fft

    (height, width), kept = (len(place) for place in places), spectrum.shape[1]
    ky, kx = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :kept]
    response = np.zeros(spectrum.shape, np.float32)

    def along_rows(rows: slice) -> None:
        padded = (image[places[0][rows]] - mean).take(places[1], axis=1)
        spectrum[rows] = fft.rfft(padded)[:, :kept]

    def passed(rows: slice) -> None:
        response[rows] = np.interp(np.hypot(ky[rows], kx), *gain)

    do(along_rows, _some_rows(height))
    fft.fft(spectrum, axis=0, overwrite_x=True, workers=THREADS)
    do(passed, _some_rows(_passed(gain, height)))
    response[height // 2 + 1 :] = response[1 : (height + 1) // 2][::-1]  # of the frequencies below zero
    _multiply(spectrum, response, spectrum)
    return response


def _passed(gain: tuple[Floats, Floats], length: int) -> int:
    """How many frequencies along a side, from 0 on, a filter (``_filtered_spectrum``) passes."""
    radius, passes = gain
    end = radius[min(int(np.flatnonzero(passes).max(initial=0)) + 1, len(radius) - 1)]
    return min(int(end * length) + 1, length // 2 + 1)


def _of_noise(
    response: Image, along_x: NDArray[np.complex64], width: int, room: NDArray[np.complex64]
) -> tuple[float, Floats, float]:
    """``left_gradient``, ``own_noise`` and ``left_level`` of a filter (``Pattern``); ``room`` has its shape."""
    kept = response.shape[1]
    share = kept / (width // 2 + 1)
    floats = room.view(np.float32).reshape(-1)[: response.size].reshape(response.shape)

    def squares(rows: slice) -> None:
        floats[rows] = np.abs(response[rows] * along_x) ** 2

    do(squares, _some_rows(len(response)))
    left = float(np.mean(floats))
    doubles = room.view(np.float64)
    kx, ky = np.fft.rfftfreq(width)[None, :kept], np.fft.fftfreq(len(response))[:, None]
    own = [np.mean(response)]
    for k in (kx, ky):
        _multiply(response, 2 * np.cos(2 * np.pi * k) - 2, doubles)
        own.append(np.mean(doubles))
    _multiply(response, response, floats)
    level = float(np.mean(floats, dtype=np.float64))
    return share * left, share * np.array(own, np.float64), share * level


def _back(spectrum: NDArray[np.complex64], width: int, out: Image) -> None:
    """The image of a spectrum of the padded one, of ``width`` columns, without its rim; ``spectrum`` is overwritten."""
    from scipy import fft

    fft.ifft(spectrum, axis=0, norm="forward", overwrite_x=True, workers=THREADS)
    scale = np.float32(1 / np.longdouble(len(spectrum) * width))

    def along_rows(rows: slice) -> None:
        inside = slice(rows.start + _MARGIN, rows.stop + _MARGIN)
        some = fft.irfft(spectrum[inside], n=width, norm="forward")
        np.multiply(some[:, _MARGIN : _MARGIN + out.shape[1]], scale, out=out[rows])

    do(along_rows, _some_rows(len(out)))


def _multiply(image: NDArray[Any], factor: NDArray[Any], out: NDArray[Any]) -> None:
    factor = np.broadcast_to(factor, out.shape)
    do(lambda rows: np.multiply(image[rows], factor[rows], out=out[rows]), _some_rows(len(out)))


def _some_rows(count: int) -> Iterator[slice]:
    """Rows 0 to ``count`` in parts that stay in the cache."""
    return (slice(first, min(first + _ROWS, count)) for first in range(0, count, _ROWS))


def radial_spectrum(image: Image) -> tuple[Floats, Floats]:
    """Radius (cycles/px) and mean power in rings; white noise of variance s^2 gives s^2 everywhere."""
    room = np.empty(image.shape[0] * (image.shape[1] // 2 + 1), np.complex64)
    return _radial_spectrum(image, np.float32(0), room)


def _radial_spectrum(image: Image, mean: np.float32, room: NDArray[np.complex64]) -> tuple[Floats, Floats]:
    """``radial_spectrum`` of an image less ``mean``, with ``room`` for the spectrum (flat)."""
    from scipy import fft

    (height, width), rings = image.shape, _rings(image.shape)
    weighted = room.view(np.float32)[: image.size].reshape(image.shape)

    def weigh(rows: slice) -> None:
        np.multiply(image[rows] - mean, rings.taper(rows) ** 2, out=weighted[rows])

    do(weigh, _some_rows(height))
    offset = weighted.sum() / rings.weight
    spectrum = room[: height * (width // 2 + 1)].reshape(height, -1)

    def along_rows(rows: slice) -> None:
        spectrum[rows] = fft.rfft(((image[rows] - mean) - offset) * rings.taper(rows))

    def power(rows: slice) -> tuple[NDArray[np.intp], Floats]:
        found = np.abs(spectrum[rows]) ** 2 / image.size
        return rings.ring[rows].ravel().astype(np.intp), found.ravel().astype(np.float64)

    do(along_rows, _some_rows(height))
    fft.fft(spectrum, axis=0, overwrite_x=True, workers=THREADS)
    sums = np.zeros(len(rings.count))
    for ring, found in each(power, _some_rows(height)):
        np.add.at(sums, ring, found)
    seen = rings.count > 0
    return rings.radius[seen] / rings.count[seen], sums[seen] / rings.count[seen]


@dataclass(frozen=True, slots=True, eq=False)
class _Rings:
    """What ``radial_spectrum`` needs of pictures of one size: the window, and rings of the spectrum.

    Attributes
    ----------
    lines : (H,), (W,) float64
        The window along each axis.
    level : float
        Root mean square of their product.
    weight : float32
        Sum of the squares of the window.
    ring : (H, W // 2 + 1) uint8
        The ring of each frequency.
    count, radius : (rings,)
        How many each has, and the sum of their radii, cycles/px.
    """

    lines: tuple[Floats, Floats]
    level: np.float64
    weight: np.float32
    ring: NDArray[np.uint8]
    count: NDArray[np.intp]
    radius: Floats

    def taper(self, rows: slice) -> Image:
        """Some rows of the window, (N, W)."""
        return np.asarray(_outer(self.lines, rows) / self.level, np.float32)


def _outer(lines: tuple[Floats, Floats], rows: slice) -> Image:
    return np.multiply(lines[0][rows, None], lines[1]).astype(np.float32)


@lru_cache(maxsize=4)
def _rings(shape: tuple[int, int]) -> _Rings:
    """Of the pictures of a camera they are always the same; made before a test, in the dry run.

    Kept for those of a second camera, and of the self-test, which runs between dry run and test, too.
    """
    lines = np.hanning(shape[0] + 2)[1:-1], np.hanning(shape[1] + 2)[1:-1]
    squares = np.empty(shape, np.float32)
    for rows in _some_rows(shape[0]):
        squares[rows] = _outer(lines, rows) ** 2
    level = np.sqrt(np.mean(squares, dtype=np.float64))
    for rows in _some_rows(shape[0]):
        squares[rows] = np.asarray(_outer(lines, rows) / level, np.float32) ** 2
    radius = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :])
    ring = np.minimum((radius * _bins(shape)).astype(np.intp), int(0.70 * _bins(shape)))
    count = np.bincount(ring.ravel())
    radii = np.bincount(ring.ravel(), weights=radius.ravel()).astype(np.float64)
    return _Rings(lines, level, squares.sum(), ring.astype(np.uint8), count, radii)


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


@lru_cache(maxsize=8)
def _gradient_response(degree: int, length: int) -> NDArray[np.complex64]:
    from analysis.picture.splines import gradient_filter

    # A linear spline has no derivative on whole pixels; the quintic's stands in for it.
    return gradient_filter(max(degree, 5), length).astype(np.complex64)
