"""The lens of a configuration, as ``phasedic lens`` calibrated it, checked against the pictures that it corrects.

It is calibrated from pictures of a board by OpenCV, or from shifted pictures of the specimen.

Z. Zhang, IEEE Trans. PAMI 22 (2000) 1330-1334, for the board. OpenCV gives standard deviations alone; the covariance
of the parameters follows here from its derivatives, with the poses of the board eliminated.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.errors import ConfigError, DataError
from acquire.text import Message, word
from analysis.field import StrainField
from analysis.optics import LensFit, LensModel, lens_of_shifts, strain_of_shift
from live.config.loading import Config
from live.config.sections import LensConfig
from live.setup.scale import Board, Corners, find_corners

if TYPE_CHECKING:
    from analysis import ZoiGrid

SHOWN_SHIFT_PX = 10.0
"""Motion for which check and calibration give the strain that a lens makes."""

Floats = NDArray[np.float64]
MIN_BOARDS = 5
MAX_FOCAL_ERROR = 0.5
"""Standard uncertainty of the focal length over it; beyond, the boards do not show the lens."""

_MORE = Message("tilt the board by 10 to 30 degrees in all directions, at all places of the picture")


def lens_for(config: Config, width: int, height: int, grid: ZoiGrid) -> LensModel | None:
    """The lens for the ZOIs of ``grid`` on pictures of ``width`` x ``height`` px; None where none is given.

    Raises
    ------
    ConfigError
        It was calibrated for other pictures or another part of them, or is no lens.
    """
    given = config.lens
    if given.focal_px is None:
        return None
    lens = _lens(given)
    if given.picture is not None and given.picture != (width, height):
        raise ConfigError(
            "lens: calibrated with pictures of {picture} x {picture2} px, these have {width} x {height}; "
            "calibrate with the same format, or take --no-lens",
            given.picture[0],
            given.picture[1],
            width,
            height,
        )
    x, y = np.meshgrid(grid.x, grid.y)
    x, y = x[grid.active], y[grid.active]
    if given.box is not None and not _inside(given.box, x, y):
        left, top, across, down = given.box
        raise ConfigError(
            "lens: ZOIs leave the calibrated part, {left:.0f},{top:.0f} to {left2:.0f},{top2:.0f} px; "
            "calibrate the whole region, or take a smaller --roi or --no-lens",
            left,
            top,
            left + across,
            top + down,
        )
    if not lens.is_single_valued(x, y):
        raise ConfigError("lens: its terms fold the picture at the ZOIs; calibrate again")
    return lens


def _lens(given: LensConfig) -> LensModel:
    if given.centre is None:
        raise ConfigError("lens: give centre = [x, y] in px beside focal_px")
    parameters = np.array([given.focal_px, *given.centre, given.k1, given.k2, given.p1, given.p2, given.k3])
    n = len(parameters)
    return LensModel(parameters, np.zeros((n, n)) if given.covariance is None else np.array(given.covariance))


def _inside(box: tuple[float, float, float, float], x: np.ndarray, y: np.ndarray) -> bool:
    left, top, width, height = box
    return bool(x.min() >= left and x.max() <= left + width and y.min() >= top and y.max() <= top + height)


def lens_words(lens: LensModel, grid: ZoiGrid) -> str:
    """What the lens does to the strain of the region, and how well that is known."""
    strain, sigma = strain_of_shift(lens, grid, SHOWN_SHIFT_PX)
    return Message(
        "a shift of {SHOWN_SHIFT_PX:g} px shows {strain:.1f} µm/m in the region; removed, known to "
        "{sigma:.2g} µm/m",
        *(SHOWN_SHIFT_PX, strain * 1e6, sigma * 1e6),
    )


@dataclass(frozen=True, slots=True, eq=False)
class LensCalibration:
    """A calibrated lens.

    Attributes
    ----------
    fit : LensFit
    picture : (width, height), px
    box : (x, y, width, height), px
        What of the picture was calibrated.
    method : str
    """

    fit: LensFit
    picture: tuple[int, int]
    box: tuple[float, float, float, float]
    method: str

    @property
    def changes(self) -> dict[str, Any]:
        """The section [lens] of a rig file (``live.config.rig_file.write_rig``)."""
        focal, x0, y0, *terms = (float(value) for value in self.fit.lens.parameters)
        section = {
            "focal_px": focal,
            "centre": [x0, y0],
            **dict(zip(("k1", "k2", "p1", "p2", "k3"), terms, strict=True)),
        }
        section |= {
            "covariance": [[float(value) for value in row] for row in self.fit.lens.covariance],
            "picture": list(self.picture),
            "box": [round(side, 1) for side in self.box],
            "rms_px": float(f"{self.fit.rms_px:.3g}"),
            "date": f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d %H:%M} UTC",
            "method": self.method,
        }
        return {f"lens.{key}": value for key, value in section.items()}


def from_shifts(fields: Sequence[StrainField], width: int, height: int, *, square: bool) -> LensCalibration:
    """The lens from fields of shifted pictures (``analysis.optics.lens_of_shifts``).

    Raises
    ------
    DataError
        Too few pictures or ZOIs, or shifts that do not show the lens.
    """
    try:
        fit = lens_of_shifts(fields, width, height, square=square)
    except ValueError as error:
        raise DataError(
            "{why}; give more pictures of the still specimen, shifted in its plane", error
        ) from None
    places = np.concatenate([_places(field) for field in fields])
    method = Message("{n} shifted pictures of the specimen", len(fields))
    method += Message(", camera square to it") if square else ""
    return LensCalibration(fit, (width, height), _box(places), method)


def _places(field: StrainField) -> Floats:
    """Places before and after the motion, (N, 2)."""
    x, y = np.meshgrid(field.grid.x, field.grid.y)
    u, v, ok = field.u, field.v, field.ok
    return np.concatenate([np.stack([x[ok], y[ok]], 1), np.stack([x[ok] + u[ok], y[ok] + v[ok]], 1)])


def _box(places: Floats) -> tuple[float, float, float, float]:
    (left, top), (right, bottom) = np.maximum(places.min(axis=0), 0.0), places.max(axis=0)
    return float(left), float(top), float(right - left), float(bottom - top)


def from_boards(pictures: Iterable[NDArray[Any]], board: Board, *, k3: bool = False) -> LensCalibration:
    """The lens from pictures (H, W) of a board, held at many places and angles.

    Pictures without the board are left out.

    Raises
    ------
    DataError
        Fewer than ``MIN_BOARDS`` pictures show it, or they do not show the lens.
    ConfigError
        OpenCV has no such dictionary of markers.
    """
    found: list[Corners] = []
    count, size = 0, (0, 0)
    for picture in pictures:
        count, size = count + 1, (picture.shape[1], picture.shape[0])
        try:
            found.append(find_corners(picture, board))
        except DataError:
            continue
    if len(found) < MIN_BOARDS:
        raise DataError(
            "{found} of {count} pictures show the board; it takes {needed}, at many places and tilted by 10 to 30"
            " degrees in all directions; look at its corners, focus, light",
            *(len(found), count, MIN_BOARDS),
        )
    fit = lens_of_corners(found, size, k3)
    kind = word("ChArUco board" if board.marker_mm else "checkerboard")
    corners = sum(len(one.px) for one in found)
    method = Message("{kind}, {n} corners in {found} of {count} pictures", kind, corners, len(found), count)
    return LensCalibration(fit, size, _box(np.concatenate([one.px for one in found])), method)


def lens_of_corners(found: Sequence[Corners], size: tuple[int, int], k3: bool = False) -> LensFit:
    """The lens from corners of a board in several pictures of ``size`` (width, height) px; raises DataError."""
    cv2 = load_cv2()
    flat = [np.column_stack([one.mm, np.zeros(len(one.mm))]).astype(np.float32) for one in found]
    seen = [one.px.astype(np.float32)[:, None] for one in found]
    flags = cv2.CALIB_FIX_ASPECT_RATIO | (0 if k3 else cv2.CALIB_FIX_K3)
    try:
        rms, matrix, terms, turns, shifts = cv2.calibrateCamera(
            flat, seen, size, np.eye(3), np.zeros(5), flags=flags
        )
    except cv2.error as error:
        raise DataError("OpenCV finds no lens in these pictures ({why}); {hint}", error, _MORE) from None
    views = [
        cv2.projectPoints(points, turn, shift, matrix, terms)[1]
        for points, turn, shift in zip(flat, turns, shifts, strict=True)
    ]
    n = sum(one.px.size for one in found)
    free = 7 + k3
    variance = rms**2 * (n / 2) / (n - 6 * len(found) - free)  # of one coordinate; rms is of the distance
    covariance = np.zeros((8, 8))
    covariance[:free, :free] = variance * _inverse_normal(views, free)
    parameters = np.array([matrix[0, 0], matrix[0, 2], matrix[1, 2], *np.ravel(terms)[:5]])
    if not (np.isfinite(parameters).all() and math.sqrt(covariance[0, 0]) < MAX_FOCAL_ERROR * parameters[0]):
        raise DataError("the pictures do not show the lens: its focal length stays unknown; {hint}", _MORE)
    return LensFit(LensModel(parameters, covariance), float(rms) / math.sqrt(2), 1.0)


def _inverse_normal(views: Sequence[Floats], free: int) -> Floats:
    """Inverse of the normal matrix of the first ``free`` parameters, the poses eliminated.

    ``views`` are derivatives by OpenCV: (2 N, 15) by turn (3), shift (3), focal lengths (2), centre (2), terms (5).
    """
    normal = np.zeros((free, free))
    for view in views:
        pose, lens = view[:, :6], np.column_stack([view[:, 6] + view[:, 7], view[:, 8:15]])[:, :free]
        rest = lens - pose @ np.linalg.lstsq(pose, lens, rcond=None)[0]
        normal += rest.T @ rest
    sizes = np.sqrt(np.diag(normal))
    return np.asarray(
        np.linalg.pinv(normal / np.outer(sizes, sizes), hermitian=True) / np.outer(sizes, sizes)
    )
