"""From the configuration to the grid, the kernel settings, the mask, the results and the view."""

from __future__ import annotations

import datetime
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.disk import forecast, network_share
from acquire.errors import ConfigError, DataError
from acquire.flat_field import FlatField
from acquire.frame import CameraInfo
from acquire.load_log import LoadLog
from acquire.mean_image import load_mean
from acquire.record_mode import RecordMode
from live.card import StatusCard
from live.config import Config
from live.journal import Journal
from live.ledger import Ledger
from live.outputs import Outputs, usable, versions
from live.pipeline import Correction, unchanged
from live.status import Screen

if TYPE_CHECKING:
    from analysis import KernelSettings, ZoiGrid


def grid_for(config: Config, width: int, height: int, mask: NDArray[np.bool_] | None) -> ZoiGrid:
    """The grid of ZOIs on pictures of ``width`` x ``height`` px; only where ``mask`` (H, W) is True.

    Raises
    ------
    ConfigError
        The ROI leaves the picture, or no ZOI fits into it.
    """
    from analysis import Roi, ZoiGrid

    m = config.measure
    x, y, w, h = m.roi or whole_picture(width, height, m.zoi)
    if x + w > width or y + h > height:
        raise ConfigError(
            f"measure.roi = {x},{y},{w},{h} leaves the picture of {width} x {height} px;"
            f" allowed: x + width <= {width}, y + height <= {height}"
        )
    try:
        return ZoiGrid.cover(Roi(x, y, w, h), size=m.zoi, step=m.step, mask=mask)
    except ValueError as error:
        raise ConfigError(f"measure: {error}") from None


def whole_picture(width: int, height: int, zoi: int) -> tuple[int, int, int, int]:
    """The region measured where none is given: all, but for a rim of an eighth of a ZOI.

    A ZOI at the very edge would leave the picture with the first small motion.
    """
    rim = zoi // 8
    if min(width, height) < zoi + 2 * rim:
        return 0, 0, width, height
    return rim, rim, width - 2 * rim, height - 2 * rim


def read_mask(path: str | None, width: int, height: int) -> NDArray[np.bool_] | None:
    """A mask, (H, W) bool: True where the picture is not black; None for no mask.

    Raises
    ------
    DataError
        Missing, unreadable, or not the size of the pictures.
    """
    from acquire.image_files import read_image

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
    import cv2

    path = folder / "mask.png"
    cv2.imwrite(str(path), mask.astype(np.uint8) * 255)
    return replace(config, measure=replace(config.measure, mask=str(path)))


def tell_room(path: Path, camera: CameraInfo, mode: RecordMode, screen: Screen) -> None:
    """Say how long the disk lasts, and that a network share is a risk."""
    rate = camera.width * camera.height * (2 if camera.bits > 8 else 1) * (camera.fps or 30.0) / mode.every
    minutes = forecast(path, rate) / 60
    where = f"recording about {rate / 1e6:.0f} MB/s at most, room for {minutes:.0f} minutes"
    screen.say(f"warning: {where}" if minutes < 30 else where)
    if share := network_share(path):
        screen.say(f"warning: {path.parent} is on a network share ({share}); a local disk is safer")


def correction(config: Config, camera: CameraInfo) -> Correction:
    """What takes the sensor's fixed pattern out of a burst; raises DataError where it cannot be used."""
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
    return field.apply


def with_flat_field(config: Config, folder: Path) -> Config:
    """Keep the dark and flat frames in the folder of the run, so that a replay finds them there."""

    def kept(path: str | None, name: str) -> str | None:
        return None if path is None else str(shutil.copy(path, folder / name))

    c = config.camera
    return replace(config, camera=replace(c, dark=kept(c.dark, "dark.tif"), flat=kept(c.flat, "flat.tif")))


def kernel_settings(config: Config) -> KernelSettings:
    """The settings of the kernel; raises ConfigError where they do not go together."""
    from analysis import KernelSettings

    m = config.measure
    try:
        return KernelSettings(
            window=cast(Any, m.window),
            estimator=cast(Any, m.estimator),
            order=m.order,
            bending_px=m.bending_px,
        )
    except ValueError as error:
        raise usable(error, "measure") from None


def make_outputs(
    config: Config,
    folder: Path,
    camera: CameraInfo,
    grid: ZoiGrid,
    loads: LoadLog,
    journal: Journal,
    ledger: Ledger,
    start: tuple[float, datetime.datetime],
) -> Outputs:
    """Results in ``folder`` and, where wanted, the view.

    Parameters
    ----------
    start : (monotonic s, UTC)
        Time zero of the files and curves.
    """
    from live.results import Results

    monotonic, utc = start
    results = Results(
        folder,
        grid=grid,
        start_monotonic=monotonic,
        start_utc=utc.isoformat(),
        loads=loads,
        config=config.as_dict(),
        metadata=dict(config.metadata),
        versions=versions(),
        camera=camera,
        area_m2=config.specimen.area_m2,
    )
    view = _view(config, folder, camera, grid, monotonic, journal)
    return Outputs(results, view, journal, StatusCard(config.specimen, loads), ledger)


def _view(
    config: Config, folder: Path, camera: CameraInfo, grid: ZoiGrid, start_monotonic: float, journal: Journal
) -> Any:
    v = config.view
    if not (v.enabled or v.rrd):
        return None
    from live.view import RerunView, ViewSetup

    setup = ViewSetup(
        title=folder.name,
        width=camera.width,
        height=camera.height,
        bits=camera.bits,
        grid=grid,
        start_monotonic=start_monotonic,
        area_m2=config.specimen.area_m2,
        axis="x" if config.specimen.axis == "x" else "y",
        strain_range=v.strain_range,
    )
    view = RerunView(setup, port=v.port if v.enabled else None, rrd=folder / "view.rrd" if v.rrd else None)
    journal.add_listener(view.event)
    return view
