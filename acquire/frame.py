"""What a camera gives: frames, bursts of frames, and a description of the camera.

Times are ``time.monotonic()`` seconds, stamped at the device; grey levels (GL)
are as the sensor counted them, not scaled to the container.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

ClockKind = Literal["device", "host", "nominal"]

QUANTISATION = "quantisation"
"""Among ``CameraInfo.controls``: steps of the 8 x 8 coefficients of compressed pictures by rows, GL."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One picture, with its time and what was lost before it.

    Attributes
    ----------
    image : (H, W) uint8 or uint16, GL
        Read-only, and its own memory: never a view of a driver's buffer.
    index : int
        Sequence number of the source. Strictly increasing within one run, also across a
        reconnection; a step of more than one is a gap.
    t : float, s
        Mid-exposure where exposure and the meaning of the stamp are known, else ``raw_t``.
    clock : "device" | "host" | "nominal"
        Who stamped: the driver, this program after the read, or nobody (a given rate).
    lost_before : int
        Frames known to be lost between the frame handed out before and this one.
    bits : int
        Significant bits of a sample.
    raw_t : float, s
        The stamp as it came.
    damaged : bool
        The device marked the content as not whole (recorded, never measured).
    white_level : int or None, GL
        Where a sample is saturated; None: at ``2**bits - 1``.
    """

    image: NDArray[Any]
    index: int
    t: float
    clock: ClockKind
    lost_before: int
    bits: int
    raw_t: float
    damaged: bool = False
    white_level: int | None = None

    @property
    def saturation(self) -> int:
        """The grey level from which on a sample is saturated."""
        return saturation(self.bits, self.white_level)


def saturation(bits: int, white_level: int | None) -> int:
    """The grey level from which on a sample is saturated: the white level, else the highest of its bits."""
    return white_level or 2**bits - 1


@dataclass(frozen=True, slots=True, eq=False)
class Burst:
    """The mean of n consecutive frames and what follows from their scatter.

    Attributes
    ----------
    mean : (H, W) float32, GL; of one frame the frame itself, uint8 or uint16
    n : int
        Frames averaged.
    noise : float, GL
        Temporal standard deviation of ONE frame, from successive differences; NaN when n = 1.
    clipped : (H, W) bool
        Pixels that were at saturation in any of the frames.
    bits : int
    t : float, s
        Mean of the times of its frames.
    duration : float, s
        Time of the last frame minus that of the first.
    first_index, last_index : int
        Sequence numbers of the first and last frame averaged.
    lost : int
        Frames lost or damaged since the end of the burst before.
    clock : "device" | "host" | "nominal"
    motion_px : float, px
        Largest motion of any part of the picture during the burst, estimated; NaN when unknown.
        Above 0.05 px the mean is smeared.
    blank : int
        Which picture of them, from 1, has the least contrast, where that is less than half of another's: a blank one
        falsifies the mean. 0: none.
    """

    mean: NDArray[Any]
    n: int
    noise: float
    clipped: NDArray[np.bool_]
    bits: int
    t: float
    duration: float
    first_index: int
    last_index: int
    lost: int
    clock: ClockKind
    motion_px: float = math.nan
    blank: int = 0


@dataclass(frozen=True, slots=True)
class CameraSetting:
    """A number in the address of a camera that can be changed while the picture is live.

    Attributes
    ----------
    key : str
        As the address has it: ``exposure_us``, ``gain``, or a name of the camera's own.
    value, low, high : float
        In force, and its bounds.
    step : float
        Between values that the camera takes, from ``low``; 0: any value.
    log : bool
        Ratios matter and not differences; ``low`` is above 0 then.
    """

    key: str
    value: float
    low: float
    high: float
    step: float = 0.0
    log: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class CameraInfo:
    """What is known of a camera once it is open.

    Attributes
    ----------
    address : str
        The address it was opened with.
    name : str
        Identity of the device or file, in words.
    width, height : int, px
    bits : int
        Significant bits of a sample.
    live : bool
        True: frames come whether or not they are fetched, and are lost when they are not.
        False: the source waits for its reader (files, a session, the simulator in lock step).
    clock : "device" | "host" | "nominal"
    fps : float or None, 1/s
        None where it is not known, or where something outside triggers the frames.
    exposure_s : float or None, s
    pixel_format : str
        As the driver names it, or the file format.
    controls : mapping of str to JSON value
        All settings in force, as read back.
    warnings : tuple of str
        What a person should know before trusting the picture.
    settings : tuple of CameraSetting
        What of the address can be changed in a live picture, with its bounds; in no file.
    formats : tuple of str
        What ``format=`` of the address can be; empty: it has none. In no file.
    rates : tuple of float, 1/s
        Offered for ``fps=`` with this format and size, or the ends of a range; empty: not known. In no file.
    white_level : int or None, GL
        Where a sample is saturated; None: at ``2**bits - 1``.
    pause_s : float or None, s
        Longest time without a frame that is no fault; None: five frame periods and the exposure. In no file.
    """

    address: str
    name: str
    width: int
    height: int
    bits: int
    live: bool
    clock: ClockKind
    fps: float | None = None
    exposure_s: float | None = None
    pixel_format: str = ""
    controls: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    settings: tuple[CameraSetting, ...] = ()
    formats: tuple[str, ...] = ()
    rates: tuple[float, ...] = ()
    white_level: int | None = None
    pause_s: float | None = None

    @property
    def saturation(self) -> int:
        """The grey level from which on a sample is saturated: full scale."""
        return saturation(self.bits, self.white_level)


def frozen(image: NDArray[Any]) -> NDArray[Any]:
    """The same array, made read-only (``Frame.image`` and ``Burst.mean`` are)."""
    image.flags.writeable = False
    return image
