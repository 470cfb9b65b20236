"""Pictures as the kernel takes them: kinds, sizes, noise, saturated pixels, padding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import ZoiGrid
from analysis.picture.splines import LINE

ROUNDING_SAMPLE = 8192
"""Pixels that show the step between the grey levels of an image."""


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Noise of a camera that grows with the signal, for an average of n frames.

    The variance of one frame at grey level mu is ``gain * mu + read**2 + 1/12``, the last term
    being the quantisation to whole grey levels.

    Attributes
    ----------
    gain : float, GL per electron
        Slope of the variance over the grey level (dark level already subtracted).
    read : float, GL
        Standard deviation without light.
    saturation : float, GL
        Level at and above which a pixel counts as clipped.
    n : int
        Frames averaged.
    """

    gain: float
    read: float
    saturation: float = float("inf")
    n: int = 1

    def __post_init__(self) -> None:
        if not (self.gain >= 0 and self.read >= 0 and self.n >= 1):
            raise ValueError(f"a noise model needs gain >= 0, read >= 0 and n >= 1, got {self}")

    @property
    def floor(self) -> float:
        """Variance of the average at zero signal, GL^2."""
        return (self.read**2 + 1 / 12) / self.n

    @property
    def slope(self) -> float:
        """Growth of the variance of the average with the grey level, GL."""
        return self.gain / self.n

    def variance(self, level: NDArray[np.floating] | float) -> NDArray[np.float64]:
        """Variance of the average of n frames at a grey level, GL^2."""
        above = np.asarray(level, np.float64)
        if self.slope == 0:
            return np.full(above.shape, self.floor)
        return np.asarray(self.floor + self.slope * np.maximum(above, 0))

    def averaged(self, n: int) -> NoiseModel:
        """The same camera with n frames averaged."""
        return replace(self, n=n)


Noise = float | NoiseModel
"""Standard deviation of an image in GL, or a model of it."""


def as_model(noise: Noise) -> NoiseModel:
    """A plain standard deviation (GL, of the image as given, quantisation included) as a model.

    Raises
    ------
    ValueError
        Negative or not finite.
    """
    if isinstance(noise, NoiseModel):
        return noise
    if not (np.isfinite(noise) and noise >= 0):
        raise ValueError(f"noise must be a standard deviation in grey levels, got {noise}")
    # n only scales the quantisation term away: the given value already contains it.
    return _PlainNoise(gain=0.0, read=float(noise))


@dataclass(frozen=True, slots=True)
class _PlainNoise(NoiseModel):
    """A standard deviation that is taken as it is, at every level."""

    @property
    def floor(self) -> float:
        return self.read**2


def rounding_variance(image: NDArray[Any]) -> float:
    """Variance that rounding leaves in an image of whole grey levels a step apart, step^2/12, GL^2; else 0."""
    sample = image.ravel()[:: max(1, image.size // ROUNDING_SAMPLE)]
    if sample.dtype.kind == "f" and not np.array_equal(sample, np.rint(sample)):
        return 0.0
    levels = sample.astype(np.int64)
    away = levels - levels[0]
    step = 1 if (away == 1).any() else np.gcd.reduce(away)
    return float(step) ** 2 / 12


def padded(*images: NDArray[np.float32]) -> NDArray[np.float32]:
    """Images of one size with zeros behind each row and below each image, (K, H + 1, pitch): see ``padded_room``."""
    out = padded_room(len(images), images[0].shape)
    height, width = images[0].shape
    for to, image in zip(out, images, strict=True):
        to[:height, :width] = image
    return out


def padded_room(count: int, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Room for images (H, W), zero behind each row and below each image, (count, H + 1, pitch).

    At least two behind each row. A row takes an odd number of cache lines: with an even one, and worst with a power of
    two, the rows of a ZOI compete for the same places in the cache.
    """
    height, width = shape
    lines = (width + 1) // LINE + 1
    return np.zeros((count, height + 1, LINE * (lines + 1 - lines % 2)), np.float32)


def continue_rim(images: NDArray[np.float32], which: int, shape: tuple[int, ...]) -> None:
    """Let the image ``which`` > 0 of ``padded`` ones go on by a pixel beyond its edges, in place.

    Left of a row is the end of the row before, and above the image the end of the image before.
    """
    (height, width), pitch = shape, images.shape[2]
    image, flat = images[which], images.reshape(-1)
    first = which * image.size
    image[:, width] = image[:, width - 1]
    image[height] = image[height - 1]
    flat[first - pitch : first - pitch + width + 1] = image[0, : width + 1]
    flat[first - pitch - 1 : first + image.size - 1 : pitch] = np.append(image[0, 0], image[:, 0])


def with_second_differences(
    images: NDArray[np.float32], first: int = 0, end: int | None = None
) -> NDArray[np.float32]:
    """A copy of rows ``first`` to ``end`` of K ``padded`` images, and f_xx, f_yy and f_xy of the third behind them.

    (K + 3, end - first, pitch); by default of all H + 1 rows. These are differences of pixels, GL/px^2. At high
    frequencies they fall behind the derivatives, as the spectrum of a real blur does behind its series.
    """
    end = images.shape[1] if end is None else end
    n, pitch, flat = len(images), images.shape[2], images.reshape(-1)
    begin, stop = (2 * images[0].size + row * pitch for row in (first, end))

    def moved(by: int) -> NDArray[np.float32]:
        return flat[begin + by : stop + by]

    out = np.empty((n + 3, end - first, pitch), np.float32)
    out[:n] = images[:, first:end]
    along_x, along_y, across = out[n:].reshape(3, -1)
    np.multiply(moved(0), 2, out=across)
    for bend, by in ((along_x, 1), (along_y, pitch)):
        np.add(moved(by), moved(-by), out=bend)
        bend -= across
    np.add(moved(pitch + 1), moved(-pitch - 1), out=across)
    across -= moved(pitch - 1)
    across -= moved(1 - pitch)
    across /= 4
    return out


def as_image(image: ArrayLike, what: str) -> NDArray[np.float32]:
    """A grey image as (H, W) float32, grey levels unchanged: a copy, since a camera may fill its buffer again.

    Raises
    ------
    ValueError
        Not two-dimensional, empty, of a wrong type, or with values that are not finite.
    """
    own = np.array(as_recorded(image, what), np.float32)
    own.flags.writeable = False
    return own


def as_recorded(image: ArrayLike, what: str, *, any_values: bool = False) -> NDArray[Any]:
    """The same as uint8, uint16 or float32, whichever it is already, read-only; raises the same.

    ``any_values``: those that are not finite are found later.
    """
    if np.ma.is_masked(image):
        raise ValueError(f"{what} has masked pixels: give its data, and its mask as clipped=")
    array = np.asarray(image)
    if array.ndim != 2 or array.size == 0:
        raise ValueError(
            f"{what} must be a grey picture (rows, columns), got an array of shape {array.shape}"
        )
    if array.dtype.kind not in "uif":
        raise ValueError(f"{what} must hold grey levels, got {array.dtype}")
    kind = array.dtype if array.dtype in (np.uint8, np.uint16) else np.float32
    out = np.ascontiguousarray(array, kind).view()
    if not any_values and array.dtype.kind == "f" and not np.isfinite(np.sum(out)):
        raise ValueError(f"{what} holds values that are not finite")
    # numba takes what may be written for another type, and would compile every loop twice.
    out.flags.writeable = False
    return out


def check_fit(grid: ZoiGrid, shape: tuple[int, ...]) -> None:
    roi = grid.roi
    if roi.x + roi.width > shape[1] or roi.y + roi.height > shape[0]:
        raise ValueError(
            f"the region of interest {roi.text} (x, y, width, height) leaves the image of {shape[1]} x {shape[0]} px"
        )


def clipped_pixels(
    image: NDArray[Any], given: NDArray[np.bool_] | None, noise: NoiseModel | None
) -> NDArray[np.bool_] | None:
    """Saturated pixels, as given or from the noise model; None where there are none."""
    if given is None:
        if noise is None or not np.isfinite(noise.saturation):
            return None
        given = image >= noise.saturation
    mask = np.asarray(given, bool)
    if mask.shape != image.shape:
        raise ValueError(f"the mask of clipped pixels has the shape {mask.shape}, the image {image.shape}")
    return mask if mask.any() else None
