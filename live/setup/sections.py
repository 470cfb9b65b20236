"""The sections of the configuration: each key with its check, its default and its meaning."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    pass
log = logging.getLogger(__name__)


DEFAULT_BURST, DEFAULT_REFERENCE_BURST = 4, 32


Check = Callable[[Any], Any]


class _Refused(ValueError):
    """Says what is allowed; the caller adds the key and the value."""


def _number(low: float = -math.inf, high: float = math.inf) -> Check:
    allowed = "a number" + (
        "" if low == -math.inf else f" from {low:g}" + (f" to {high:g}" * (high < math.inf))
    )

    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise _Refused(allowed)
        return float(value)

    return check


def _integer(low: int, high: int) -> Check:
    def check(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise _Refused(f"a whole number from {low} to {high}")
        return value

    return check


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise _Refused("a text in quotes")
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _Refused("true or false")
    return value


def _choice(*allowed: str) -> Check:
    def check(value: Any) -> str:
        if value not in allowed:
            raise _Refused("one of " + ", ".join(repr(word) for word in allowed))
        return str(value)

    return check


def _roi(value: Any) -> tuple[int, int, int, int]:
    if not isinstance(value, list | tuple) or len(value) != 4 or not all(type(v) is int for v in value):
        raise _Refused("four whole numbers: x, y, width, height in px")
    x, y, width, height = value
    if x < 0 or y < 0 or width < 1 or height < 1:
        raise _Refused("x and y from 0, width and height from 1 (px)")
    return x, y, width, height


def _record_mode(value: Any) -> str:
    text = _text(value)
    every = text.removeprefix("every=")
    if text in ("all", "bursts") or (every != text and every.isdigit() and int(every) >= 1):
        return text
    raise _Refused("'all', 'bursts' or 'every=K' with K from 1")


def _key(check: Check, default: Any, help_text: str, *, optional: bool = False) -> Any:
    """A field: its check, its default, its meaning; None is allowed where ``optional``."""
    return field(default=default, metadata={"check": check, "help": help_text, "optional": optional})


@dataclass(frozen=True, slots=True)
class CameraConfig:
    """[camera]"""

    address: str = _key(_text, "", "address of the camera: /dev/video0?format=Y12&fps=30, sim:, files:...")
    crop: tuple[int, int, int, int] | None = _key(
        _roi, None, "x, y, width, height of the part that is used; coordinates count from it", optional=True
    )
    dark: str | None = _key(_text, None, "dark frame (TIFF) that is taken off every burst", optional=True)
    flat: str | None = _key(_text, None, "flat frame (TIFF) that every burst is divided by", optional=True)


@dataclass(frozen=True, slots=True)
class LoadConfig:
    """[load]"""

    address: str = _key(_text, "none:", "address of the load cell: /dev/ttyUSB0?protocol=ascii, sim:, none:")
    max_gap_s: float = _key(_number(0.001, 3600), 0.5, "samples further apart than this leave a gap, s")


@dataclass(frozen=True, slots=True)
class MeasureConfig:
    """[measure]"""

    roi: tuple[int, int, int, int] | None = _key(
        _roi, None, "x, y, width, height of the measured region, px", optional=True
    )
    zoi: int = _key(_integer(8, 1024), 64, "side of a ZOI, px")
    step: int = _key(_integer(1, 1024), 16, "distance of neighbouring ZOIs, px")
    burst: int | None = _key(_integer(1, 10000), None, "frames averaged for one measurement", optional=True)
    reference_burst: int | None = _key(
        _integer(1, 10000), None, "frames averaged for the reference", optional=True
    )
    mask: str | None = _key(_text, None, "image; ZOIs where it is black are not measured", optional=True)
    window: str = _key(
        _choice("gaussian", "uniform", "tukey", "bi-triangular"), "gaussian", "least-squares weight of a ZOI"
    )
    estimator: str = _key(_choice("spectral", "phase"), "spectral", "spectral, or phase alone")
    order: int = _key(_integer(1, 3), 1, "order of the shape of a ZOI: 1 is affine")
    bending_px: float = _key(
        _number(0, math.inf),
        0.05,
        "a ZOI in which the displacement jumps or bends by more is UNEVEN; inf never",
    )
    noise_GL: float | None = _key(
        _number(0, 65535), None, "noise of one frame in grey levels, where no burst tells it", optional=True
    )
    shorten_bursts: bool = _key(
        _flag, False, "shorten bursts while the picture moves more than 0.05 px in one"
    )
    renew_at: float = _key(
        _number(0, 1), 0.2, "share of ZOIs lost from one burst to the next that renews the reference; 1 never"
    )
    reference_shift_px: float = _key(
        _number(0, 10), 0.05, "motion during the reference burst that is accepted, px"
    )


@dataclass(frozen=True, slots=True)
class RecordConfig:
    """[record]"""

    enabled: bool = _key(_flag, True, "record the session")
    mode: str = _key(_record_mode, "all", "all frames, only bursts (sums), or every=K frames")
    rotate_MB: float | None = _key(
        _number(10, 1e9), None, "begin another file after this much; the set is one session", optional=True
    )
    buffer_MB: float = _key(_number(1, 1e6), 512.0, "frames waiting for the disk, at most")
    when_full: str = _key(
        _choice("gap", "stop"), "gap", "a full buffer or disk leaves a counted gap, or ends the run"
    )


@dataclass(frozen=True, slots=True)
class ViewConfig:
    """[view]"""

    enabled: bool = _key(_flag, True, "serve the rerun view")
    rrd: bool = _key(_flag, True, "write view.rrd")
    port: int = _key(_integer(1024, 65535), 9876, "port of the view on 127.0.0.1; the next free one is taken")
    spawn: bool = _key(_flag, True, "open the viewer when there is a display")
    strain_range: float | None = _key(
        _number(1e-7, 10), None, "fixed symmetric range of the strain maps; automatic without", optional=True
    )


@dataclass(frozen=True, slots=True)
class SpecimenConfig:
    """[specimen]"""

    width_mm: float | None = _key(_number(1e-3, 1e5), None, "width of the section", optional=True)
    thickness_mm: float | None = _key(_number(1e-4, 1e5), None, "thickness of the section", optional=True)
    axis: str = _key(_choice("x", "y"), "y", "direction of the load in the image")

    @property
    def area_m2(self) -> float | None:
        """Section, m^2; None where it is not known."""
        if self.width_mm is None or self.thickness_mm is None:
            return None
        return self.width_mm * self.thickness_mm * 1e-6


@dataclass(frozen=True, slots=True)
class OutputConfig:
    """[output]"""

    dir: str | None = _key(
        _text, None, "where the files go; default: a new folder in runs/ named by the UTC time", optional=True
    )
    seconds: float | None = _key(_number(0.01, 1e7), None, "end after this time", optional=True)
