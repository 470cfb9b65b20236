"""The pictures a test is set up with: mask, dark and flat frame."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.burst import FlatField, load_mean
from acquire.errors import DataError
from acquire.files.picture import write_picture
from acquire.frame import CameraInfo
from live.config.loading import Config
from live.pipeline.reference import Correction, unchanged


def read_mask(path: str | None, width: int, height: int) -> NDArray[np.bool_] | None:
    """A mask, (H, W) bool: True where the picture is not black; None for no mask.

    Raises
    ------
    DataError
        Missing, unreadable, or not the size of the pictures.
    """
    from acquire.opencv.images import read_image

    if path is None:
        return None
    mask = read_image(Path(path), gray="luma")
    if mask.shape != (height, width):
        raise DataError(
            f"{path}: the mask has {mask.shape[1]} x {mask.shape[0]} px, the pictures {width} x {height};"
            " make a mask of the size of the pictures"
        )
    found: NDArray[np.bool_] = mask > 0
    return found


def with_mask(config: Config, mask: NDArray[np.bool_] | None, folder: Path) -> Config:
    """Keep the mask in the folder of the run, so that a replay finds it there."""
    if mask is None:
        return config
    path = folder / "mask.png"
    write_picture(path, mask.astype(np.uint8) * 255)
    return replace(config, measure=replace(config.measure, mask=str(path)))


def correction(config: Config, camera: CameraInfo, cut: tuple[slice, slice] | None = None) -> Correction:
    """What takes the sensor's fixed pattern out of a burst, or out of the rows and columns ``cut`` of one.

    Raises
    ------
    DataError
        It cannot be used.
    """
    dark, flat = load_mean(config.camera.dark), load_mean(config.camera.flat)
    if dark is None and flat is None:
        return unchanged
    field = FlatField.from_images(dark, flat)
    if field.dark.shape != (camera.height, camera.width):
        height, width = field.dark.shape
        raise DataError(
            f"{config.camera.dark or config.camera.flat} has {width} x {height} px, the pictures"
            f" {camera.width} x {camera.height}; take it anew with this setting of the camera"
        )
    if cut is not None:
        field = FlatField(field.dark[cut], field.gain[cut], field.useless[cut])
    return field.apply


def with_flat_field(config: Config, folder: Path) -> Config:
    """Keep the dark and flat frames in the folder of the run, so that a replay finds them there."""

    def kept(path: str | None, name: str) -> str | None:
        return None if path is None else str(shutil.copy(path, folder / name))

    c = config.camera
    return replace(config, camera=replace(c, dark=kept(c.dark, "dark.tif"), flat=kept(c.flat, "flat.tif")))
