"""What the kernel takes as a picture: kinds, sizes, saturated pixels, padding."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import ZoiGrid
from analysis.kernel.noise import NoiseModel
from analysis.picture import LINE


def padded(*images: NDArray[np.float32]) -> NDArray[np.float32]:
    """Images of one size with zeros behind each row and below each image, (K, H + 1, pitch).

    A row takes an odd number of cache lines: with an even one, and worst with a power of two, the
    rows of a ZOI compete for the same places in the cache.
    """
    height, width = images[0].shape
    lines = width // LINE + 1
    out = np.zeros((len(images), height + 1, LINE * (lines + 1 - lines % 2)), np.float32)
    for to, image in zip(out, images, strict=True):
        to[:height, :width] = image
    return out


def as_image(image: ArrayLike, what: str) -> NDArray[np.float32]:
    """A grey image as (H, W) float32, grey levels unchanged.

    Raises
    ------
    ValueError
        Not two-dimensional, empty, of a wrong type, or with values that are not finite.
    """
    return np.asarray(as_recorded(image, what), np.float32)


def as_recorded(image: ArrayLike, what: str) -> NDArray[Any]:
    """The same as uint8, uint16 or float32, whichever it is already, read-only; raises the same."""
    array = np.asarray(image)
    if array.ndim != 2 or array.size == 0:
        raise ValueError(
            f"{what} must be a grey picture (rows, columns), got an array of shape {array.shape}"
        )
    if array.dtype.kind not in "uif":
        raise ValueError(f"{what} must hold grey levels, got {array.dtype}")
    kind = array.dtype if array.dtype in (np.uint8, np.uint16) else np.float32
    out = np.ascontiguousarray(array, kind).view()
    if array.dtype.kind == "f" and not np.isfinite(np.sum(out)):
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
