"""The pictures of a set-up: frames of a camera or of a recording without a load cell; mask, dark and flat frame."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.burst import FlatField, load_mean
from acquire.camera import Camera
from acquire.errors import DataError, DeviceError
from acquire.events import Event, EventSink, ignore_event
from acquire.files.picture import write_picture
from acquire.frame import CameraInfo, Frame
from acquire.record_mode import Crop
from live.config.loading import Config
from live.pipeline.reference import Correction, unchanged
from live.setup.devices import at_rest, open_rig

SILENCE_S = 20.0
"""Wait for the next whole picture; a run waits for ever, since a test may be under way."""


FILM_ERROR_PERCENT = 10.0
"""H.264 to CRF 23, H.265, VP9 and MPEG-4 held back 3 to 7 % of 8,000 to 10,000 um/m (November 2026)."""


@contextmanager
def camera_of(
    address: str, on_event: EventSink = ignore_event, *, crop: Crop | None = None, resting: bool = True
) -> Iterator[Camera]:
    """The camera of an address, opened, to be started by ``with``; closed at the end. Raises as ``open_rig``.

    ``resting``: a simulated specimen is not pulled, and its pictures go on.
    """
    rig = open_rig(at_rest(address) if resting else address, "none:", on_event, crop=crop)
    try:
        yield rig.camera
    finally:
        rig.close()


def frames_of(camera: Camera) -> Iterator[Frame]:
    """Start a camera, and give its frames, damaged ones too.

    Raises
    ------
    DeviceError
        No whole one comes for ``SILENCE_S``.
    """
    silent = False

    def stop() -> None:
        nonlocal silent
        silent = True
        camera.stop()

    def watch() -> threading.Timer:
        timer = threading.Timer(SILENCE_S, stop)
        timer.start()
        return timer

    with camera:
        watched = watch()
        try:
            for frame in camera:
                if not frame.damaged:
                    watched.cancel()
                yield frame
                if not frame.damaged:
                    watched = watch()
        finally:
            watched.cancel()
    if silent:
        raise DeviceError(
            "{name}: no whole picture came in {SILENCE_S:g} s; look at its cable, its trigger and the light, and "
            "call again",
            camera.info.name,
            SILENCE_S,
        )


def whole_frames(camera: Camera) -> Iterator[Frame]:
    """The same without the damaged ones."""
    return (frame for frame in frames_of(camera) if not frame.damaged)


def report_warnings(print_line: Callable[[str], None]) -> EventSink:
    """An event sink that passes the warnings and errors of a device to ``print_line``."""

    def report(event: Event) -> None:
        if event.level != "info":
            print_line(event.text)

    return report


def read_mask(path: str | None, width: int, height: int) -> NDArray[np.bool_] | None:
    """A mask, (H, W) bool: True where the picture is not black; None without a ``path``.

    Raises
    ------
    DataError
        The file is missing or unreadable, or its size is not that of the pictures.
    """
    from acquire.opencv.images import read_image

    if path is None:
        return None
    mask = read_image(Path(path), gray="luma")
    if mask.shape != (height, width):
        raise DataError(
            "{path}: the mask has {width} x {height} px, the pictures {their_width} x {their_height}; make a mask of"
            " the size of the pictures",
            path,
            mask.shape[1],
            mask.shape[0],
            width,
            height,
        )
    found: NDArray[np.bool_] = mask > 0
    return found


def mask_picture(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The picture of a mask (H, W), as ``read_mask`` reads it: black where nothing is measured."""
    return np.where(mask, np.uint8(255), np.uint8(0))


def with_mask(config: Config, mask: NDArray[np.bool_] | None, folder: Path) -> Config:
    """The configuration with a mask, written to ``mask.png`` in ``folder``; unchanged without a mask."""
    if mask is None:
        return config
    path = folder / "mask.png"
    write_picture(path, mask_picture(mask))
    return replace(config, measure=replace(config.measure, mask=str(path)))


def correction(config: Config, camera: CameraInfo, cut: tuple[slice, slice] | None = None) -> Correction:
    """The correction of the sensor's fixed pattern for bursts, or for the rows and columns ``cut`` of bursts.

    Raises
    ------
    DataError
        A dark or flat frame cannot be read, or its size is not that of the pictures.
    """
    dark, flat = load_mean(config.camera.dark), load_mean(config.camera.flat)
    if dark is None and flat is None:
        return unchanged
    field = FlatField.from_images(dark, flat)
    if field.dark.shape != (camera.height, camera.width):
        height, width = field.dark.shape
        raise DataError(
            "{path} has {width} x {height} px, the pictures {their_width} x {their_height}; take it anew with this"
            " setting of the camera",
            config.camera.dark or config.camera.flat,
            width,
            height,
            camera.width,
            camera.height,
        )
    if cut is not None:
        field = FlatField(field.dark[cut], field.gain[cut], field.useless[cut])
    return field.apply


def with_flat_field(config: Config, folder: Path) -> Config:
    """The configuration with dark and flat frames copied into ``folder``, the folder of a run."""

    def copied(path: str | None, name: str) -> str | None:
        return None if path is None else str(shutil.copy(path, folder / name))

    c = config.camera
    return replace(
        config, camera=replace(c, dark=copied(c.dark, "dark.tif"), flat=copied(c.flat, "flat.tif"))
    )


def with_film(config: Config, camera: CameraInfo) -> Config:
    """The configuration with a limit of error of strains where the pictures are of a film that holds motion back."""
    if not camera.controls.get("inter_frame") or config.specimen.film_error_percent is not None:
        return config
    return replace(config, specimen=replace(config.specimen, film_error_percent=FILM_ERROR_PERCENT))
