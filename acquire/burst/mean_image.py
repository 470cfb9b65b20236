"""Means of many frames as 32-bit TIFF files: what dark and flat frames are kept in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.files import read_picture, write_picture

Image = NDArray[np.float32]


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
        raise ConfigError(f"{path}: dark and flat frames are kept as TIFF; choose a name that ends in .tif")
    if path.exists():
        raise ConfigError(f"{path} exists, and nothing is overwritten; choose another name")
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
        raise DataError(f"{path}: there is no such dark or flat frame; take one with phasedic average")
    image = read_picture(file)
    if image.ndim != 2 or not np.isfinite(image).all():
        raise DataError(f"{path}: is not a grey TIFF; take the frame anew with phasedic average")
    return np.asarray(image, np.float32)
