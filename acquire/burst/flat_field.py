"""Dark and flat frames: fixed-pattern noise taken out of a burst, on request.

Dirt, dust and unequal pixels stand still while the specimen moves, which pulls displacements
toward zero and does not average out. docs/cameras.md describes how to take dark and flat frames (lens covered;
an evenly lit white sheet, out of focus). They are kept as means of many frames, in 32-bit TIFF files.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.files.picture import read_picture, write_picture
from acquire.frame import Burst, frozen

MIN_SHARE = 0.05  # of the median of the flat: below it a pixel sees next to nothing

Image = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class FlatField:
    """Offset and gain of each pixel.

    Attributes
    ----------
    dark : (H, W) float32, GL
        What a pixel gives without light.
    gain : (H, W) float32
        What its light is multiplied with; the median is 1.
    useless : (H, W) bool
        Pixels with next to no signal in the flat: left as they are, and marked as clipped.
    """

    dark: NDArray[np.float32]
    gain: NDArray[np.float32]
    useless: NDArray[np.bool_]

    @classmethod
    def from_images(cls, dark: NDArray[Any] | None, flat: NDArray[Any] | None) -> Self:
        """From averaged pictures, (H, W), GL; either may be missing.

        Raises
        ------
        DataError
            Neither is given, they differ in size, or the flat is no brighter than the dark.
        """
        given = [image for image in (dark, flat) if image is not None]
        if not given or given[0].shape != given[-1].shape:
            raise DataError(
                "a correction needs a dark or a flat picture, or both of one size; take them anew"
            )
        offset = np.zeros(given[0].shape, np.float32) if dark is None else dark.astype(np.float32)
        if flat is None:
            return cls(offset, np.ones_like(offset), np.zeros(offset.shape, np.bool_))
        light = flat.astype(np.float32) - offset
        middle = np.float32(np.median(light))
        if not middle > 0:
            raise DataError(
                "the flat picture is no brighter than the dark one; were they mistaken for each other?"
            )
        useless = light < MIN_SHARE * middle
        return cls(offset, np.where(useless, np.float32(1), middle / np.where(useless, 1, light)), useless)

    def apply(self, burst: Burst) -> Burst:
        """The burst with dark and flat taken into account; its noise stays that of a raw frame.

        Raises
        ------
        DataError
            The burst is of another size.
        """
        if burst.mean.shape != self.dark.shape:
            raise DataError(
                "the correction is for {own} pictures, the camera gives {given}; take dark and flat with this camera"
                " setting",
                _size(self.dark),
                _size(burst.mean),
            )
        mean = (burst.mean - self.dark) * self.gain
        return replace(burst, mean=frozen(mean), clipped=frozen(burst.clipped | self.useless))


def _size(image: NDArray[Any]) -> str:
    return f"{image.shape[1]}x{image.shape[0]}"


def save_mean(mean: Image, path: Path) -> None:
    """Write a mean as a 32-bit TIFF.

    Raises
    ------
    ConfigError
        The file exists, or is no TIFF by its name.
    DataError
        It cannot be written.
    """
    if path.suffix.lower() not in (".tif", ".tiff"):
        raise ConfigError(
            "{path}: dark and flat frames are kept as TIFF; choose a name that ends in .tif", path
        )
    if path.exists():
        raise ConfigError("{path} exists, and nothing is overwritten; choose another name", path)
    write_picture(path, mean.astype(np.float32))


def load_mean(path: str | None) -> Image | None:
    """Read what ``save_mean`` wrote, or any grey TIFF; None for no path.

    Raises
    ------
    DataError
        Missing or not a grey picture.
    """
    if path is None:
        return None
    file = Path(path)
    if not file.exists():
        raise DataError("{path}: there is no such dark or flat frame; take one with phasedic average", path)
    image = read_picture(file)
    if image.ndim != 2 or not np.isfinite(image).all():
        raise DataError("{path}: is not a grey TIFF; take the frame anew with phasedic average", path)
    return np.asarray(image, np.float32)
