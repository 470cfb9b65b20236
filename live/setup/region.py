"""The region to measure: as given, else the specimen found in a picture, else the picture except a rim.

``located`` writes the region into the configuration as a box and a mask, as if a person had drawn them; the run,
its folder and a replay use it from there.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.errors import ConfigError, DataError
from acquire.frame import QUANTISATION, CameraInfo
from acquire.text import Message
from live.config.loading import Config
from live.config.values import ALL, AUTO
from live.pipeline.consumer import Screen
from live.setup.grid import grid_for, whole_picture, with_auto_gauges
from live.setup.pictures import camera_of, read_mask, report_warnings, whole_frames, with_mask

if TYPE_CHECKING:
    from analysis import ZoiGrid

Box = tuple[int, int, int, int]
Bools = NDArray[np.bool_]

FIRST_LOOK_FRAMES = 4
"""Frames of a live camera in which the specimen is searched; of recorded pictures, one."""
FILLS_PICTURE = 0.98  # of the picture: above it the specimen fills the picture, unless it has a hole


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """The region to measure.

    Attributes
    ----------
    box : (x, y, width, height) or None, px
        None: the picture except a rim.
    mask : (H, W) bool or None
    words : str
        Origin of the region, for a person.
    found : bool
        Whether it is a specimen found in the picture.
    """

    box: Box | None
    mask: Bools | None
    words: str
    found: bool = False

    def config(self, config: Config) -> Config:
        """The configuration with this box; the mask is a file (``with_mask``)."""
        return replace(config, measure=replace(config.measure, roi=self.box or ALL))

    def grid(self, config: Config, width: int, height: int) -> ZoiGrid:
        """The ZOIs of the test in the region; raises ConfigError if none fits."""
        return grid_for(self.config(config), width, height, self.mask)

    def inside(self, width: int, height: int, zoi: int) -> Bools:
        """(H, W) bool: the pixels that are measured."""
        x, y, w, h = self.box or whole_picture(width, height, zoi)
        inside = np.zeros((height, width), bool)
        inside[y : y + h, x : x + w] = True
        return inside if self.mask is None else inside & self.mask


def is_auto_region(config: Config) -> bool:
    """Whether the specimen must be found: neither ROI nor mask is given, or the ROI is "auto"."""
    return config.measure.mask is None and config.measure.roi in (None, AUTO)


def region_of(config: Config, picture: NDArray[Any], noise: float | None = None) -> Region:
    """The region on ``picture`` (H, W), GL; ``noise`` is its standard deviation.

    Raises
    ------
    DataError
        The mask cannot be read, or its size is not that of the picture.
    """
    height, width = picture.shape
    box = config.measure.roi if isinstance(config.measure.roi, tuple) else None
    if not is_auto_region(config):
        mask = read_mask(config.measure.mask, width, height)
        words = (
            Message("as given") if box is not None or mask is not None else Message("all but a rim, as given")
        )
        return Region(box, mask, words)
    return _found(config, picture, noise)


def _found(config: Config, picture: NDArray[Any], noise: float | None) -> Region:
    from analysis.quality.specimen import find_specimen

    height, width = picture.shape
    none = Region(None, None, Message("no specimen was found that stands out: all but a rim"))
    specimen = find_specimen(picture, noise) if min(picture.shape) >= config.measure.zoi else None
    if specimen is None:
        return none
    if specimen.share > FILLS_PICTURE and _deepest_gap(specimen.mask) < config.measure.zoi / 4:
        return Region(None, None, Message("the specimen fills the picture: all but a rim"), found=True)
    box = _within(specimen.box.x, specimen.box.y, specimen.box.width, specimen.box.height, config, picture)
    share = Message("{share:.0%} of the picture", specimen.share)
    words = Message(
        "the specimen was found: {share}, within x,y,width,height = {listed}", share, ",".join(map(str, box))
    )
    region = Region(box, specimen.mask, words, found=True)
    try:
        zois = region.grid(config, width, height).n_active
    except ConfigError:
        zois = 0
    if zois == 0:
        zoi = config.measure.zoi
        return replace(
            none, words=Message("the pattern that was found takes no ZOI of {zoi} px: all but a rim", zoi)
        )
    return region


def _deepest_gap(mask: Bools) -> float:
    """Radius of the largest gap in the mask, px."""
    gaps = np.where(mask, np.uint8(0), np.uint8(1))
    return float(load_cv2().distanceTransform(gaps, load_cv2().DIST_L2, 5).max()) if gaps.any() else 0.0


def _within(x: int, y: int, w: int, h: int, config: Config, picture: NDArray[Any]) -> Box:
    """The box, cut by the rim of the picture."""
    height, width = picture.shape
    x0, y0, w0, h0 = whole_picture(width, height, config.measure.zoi)
    left, top = max(x, x0), max(y, y0)
    return left, top, max(min(x + w, x0 + w0) - left, 1), max(min(y + h, y0 + h0) - top, 1)


@dataclass(frozen=True, slots=True, eq=False)
class FirstLook:
    """A first look at the picture of a camera.

    Attributes
    ----------
    picture : (H, W) float32, or the type of the frame, GL
        Mean of the frames.
    noise : float or None, GL
        Noise of that mean; None if there is only one frame.
    camera : CameraInfo
    """

    picture: NDArray[Any]
    noise: float | None
    camera: CameraInfo

    @property
    def visible_noise(self) -> float | None:
        """The noise of the picture, GL, with what a codec may have hidden; None: not known."""
        steps = self.camera.controls.get(QUANTISATION)
        if not steps:
            return self.noise
        from analysis.picture.pattern import hidden_noise

        return max(self.noise or 0.0, hidden_noise(self.picture, steps))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        height, width = self.picture.shape
        return width, height


def first_look(config: Config, screen: Screen) -> FirstLook:
    """Open the camera, take a few frames, and close it; raises as ``open_rig``.

    ``screen`` shows the warnings of the camera meanwhile.

    Raises
    ------
    DataError
        The camera ended without a whole frame.
    DeviceError
        See ``frames_of``.
    """
    with camera_of(config.camera.address, report_warnings(screen.print), crop=config.camera.crop) as camera:
        n = FIRST_LOOK_FRAMES if camera.info.live else 1
        images = [frame.image for frame in islice(whole_frames(camera), n)]
    if not images:
        raise DataError("{address}: gave no whole frame; look at the camera", config.camera.address)
    return FirstLook(*_mean_and_noise(images), camera.info)


def _mean_and_noise(images: list[NDArray[Any]]) -> tuple[NDArray[Any], float | None]:
    if len(images) == 1:
        return images[0], None
    stack = np.stack(images).astype(np.float32)
    noise = float(np.diff(stack, axis=0).std()) / 2**0.5
    return stack.mean(axis=0), noise / len(images) ** 0.5 if noise > 0 else None


@contextmanager
def located(config: Config, screen: Screen) -> Iterator[Config]:
    """The configuration of a test with the specimen found, if no region is given, and automatic gauges placed.

    The mask lies in a temporary folder; a run copies it into its own.
    """
    if not config.camera.address or not (is_auto_region(config) or config.measure.gauges == AUTO):
        yield config
        return
    auto_region = is_auto_region(config)
    config, mask = located_on(config, first_look(config, screen), screen)
    with TemporaryDirectory(prefix="phasedic-") as folder:
        yield with_mask(config, mask if auto_region else None, Path(folder))


def located_on(config: Config, first: FirstLook, screen: Screen) -> tuple[Config, Bools | None]:
    """The configuration with region and automatic gauges in px, and the mask (H, W).

    Raises
    ------
    ConfigError, DataError
        As ``region_of``; no ZOI fits, or too few for the gauges.
    """
    region = region_of(config, first.picture, first.visible_noise)
    if is_auto_region(config):
        screen.print(Message("{words} (--roi all or --roi X,Y,W,H choose another region)", region.words))
    return with_auto_gauges(region.config(config), region.grid(config, *first.size)), region.mask
