"""The scale of the picture, mm per px, with its uncertainty: from two points, the width of the specimen or a board.

A checkerboard or ChArUco board is held in the place of the specimen; OpenCV finds its corners. A camera without
distortion maps a plane by a homography. Its derivative in the middle of the board is the scale; the difference of
its singular values and its gradient give the tilt (R. Hartley, A. Zisserman, Multiple View Geometry, 2nd ed.,
sections 2.3 and 8.1).
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.errors import ConfigError, DataError
from acquire.text import Message
from live.setup.region import Region

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

POINT_PX = 1.0
"""Standard uncertainty of a point that a person has picked, in x and in y."""
EDGE_PX = 1.0  # standard uncertainty of an edge of the specimen, from the end of its pattern; systematic
MASK_PX = 6.0  # standard uncertainty of an edge of the mask
MAX_ROWS, MIN_ROWS = 48, 12  # px along the load for one position of an edge
SEARCH_PX = 24  # on both sides of the edge of the mask
OUT_OF_PLANE_MM = 0.1
MAX_UNEVEN = 0.005
"""Change of the scale over the board, or between its directions, above which a remark gives the tilt."""
MIN_CORNERS = 6
MAX_SQUARES = 60


@dataclass(frozen=True, slots=True)
class Scale:
    """A measured scale.

    Attributes
    ----------
    mm_per_px, sigma : float
        mm per px, with its standard uncertainty.
    method : str
        The method, as text.
    remarks : tuple of str
        Advice for a person, for example about a tilt.
    """

    mm_per_px: float
    sigma: float
    method: str
    remarks: tuple[str, ...] = ()

    @property
    def relative(self) -> float:
        """The relative uncertainty."""
        return self.sigma / self.mm_per_px

    def changes(self, stand_off_mm: float | None = None) -> dict[str, Any]:
        """The changes of a rig file (``live.config.rig_file.write_rig``)."""
        changes: dict[str, Any] = {
            "scale.mm_per_px": float(f"{self.mm_per_px:.7g}"),
            "scale.sigma_mm_per_px": float(f"{self.sigma:.2g}"),
            "scale.date": f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d %H:%M} UTC",
            "scale.method": self.method,
        }
        return changes if stand_off_mm is None else {**changes, "scale.stand_off_mm": stand_off_mm}


def from_points(points: tuple[float, float, float, float], length_mm: float, sigma_mm: float = 0.0) -> Scale:
    """Two points x1, y1, x2, y2 (px) that are ``length_mm`` apart; raises ConfigError if they coincide."""
    x1, y1, x2, y2 = points
    px = math.hypot(x2 - x1, y2 - y1)
    if not (px > 1 and length_mm > 0 and math.isfinite(px) and math.isfinite(length_mm)):
        raise ConfigError("the scale needs two points more than 1 px apart and a length above 0 mm")
    relative = math.hypot(math.sqrt(2) * POINT_PX / px, sigma_mm / length_mm)
    scale = length_mm / px
    return Scale(
        scale, scale * relative, Message("two points {px:.1f} px apart, {length_mm:g} mm", px, length_mm)
    )


def from_width(
    picture: NDArray[Any], region: Region, axis: str, width_mm: float, sigma_mm: float = 0.0
) -> Scale:
    """The specimen found in ``picture`` (H, W) is ``width_mm`` wide across the load.

    Raises
    ------
    DataError
        Its edges are not visible.
    """
    px, sigma_px = specimen_width(picture, region, axis)
    scale = width_mm / px
    relative = math.hypot(sigma_px / px, sigma_mm / width_mm)
    remarks = (
        (Message("the edges are known to some px only: two points or a board are better"),)
        if relative > 0.01
        else ()
    )
    return Scale(
        scale,
        scale * relative,
        Message("width of the specimen, {px:.1f} px are {width_mm:g} mm", px, width_mm),
        remarks,
    )


def false_strain(stand_off_mm: float) -> float:
    """False strain of a motion by ``OUT_OF_PLANE_MM`` toward the camera: the image grows as the distance falls."""
    return OUT_OF_PLANE_MM / stand_off_mm


# -- the width of the specimen ------------------------------------------------------------------


def specimen_width(picture: NDArray[Any], region: Region, axis: str) -> tuple[float, float]:
    """Width across the load in the middle half of the specimen, px, with its standard uncertainty.

    An edge is where the scatter of the grey levels along the load falls to the middle between pattern and
    background. Where the background scatters as much, it is the edge of the mask.
    """
    mask = region.mask
    if mask is None or not region.found:
        raise DataError(
            "the edges of the specimen are not visible; give two points, or a larger field of view"
        )
    if axis == "x":
        picture, mask = picture.T, mask.T
    grey = np.asarray(picture, np.float32)
    bands = list(_bands(mask))
    found = [_band_width(grey[rows], mask[rows]) for rows in bands]
    widths = [width for width in found if width is not None]
    if len(widths) >= max(2, len(bands) // 2):
        scatter = 1.25 * float(np.std(widths)) / math.sqrt(len(widths))
        return float(np.median(widths)), math.hypot(scatter, math.sqrt(2) * EDGE_PX)
    sides = [_sides(mask[rows]) for rows in bands]
    known = [right - left for left, right in filter(None, sides)]
    if not known:
        raise DataError(
            "the edges of the specimen leave the picture; give two points, or a larger field of view"
        )
    return float(np.median(known)), math.sqrt(2) * MASK_PX


def _bands(mask: Bools) -> Iterator[slice]:
    rows = np.flatnonzero(mask.any(axis=1))
    quarter = len(rows) // 4
    first, last = int(rows[quarter]), int(rows[len(rows) - 1 - quarter])
    size = min(MAX_ROWS, max(MIN_ROWS, last + 1 - first))
    yield from (slice(top, top + size) for top in range(first, max(last + 2 - size, first + 1), size))


def _sides(mask: Bools) -> tuple[float, float] | None:
    """Left and right edge of the mask over some rows; None if it reaches the edge of the picture."""
    inside = np.flatnonzero(mask.mean(axis=0) > 0.5)
    if not inside.size or inside[0] == 0 or inside[-1] == mask.shape[1] - 1:
        return None
    return float(inside[0]), float(inside[-1] + 1)


def _band_width(grey: NDArray[np.float32], mask: Bools) -> float | None:
    sides = _sides(mask)
    if sides is None:
        return None
    left, right = (round(side) for side in sides)
    scatter = grey.std(axis=0)
    inner = (
        float(np.median(scatter[left + SEARCH_PX : right - SEARCH_PX]))
        if right - left > 3 * SEARCH_PX
        else math.nan
    )
    edges = [_edge(scatter[::-1], len(scatter) - left, inner), _edge(scatter, right, inner)]
    if None in edges:
        return None
    return float(edges[1] + edges[0] - len(scatter))  # type: ignore[operator]


def _edge(scatter: NDArray[np.float32], at: int, inner: float) -> float | None:
    """The last fall of the scatter from left to right, px from the left edge of the picture."""
    near = scatter[max(at - SEARCH_PX, 0) : at + SEARCH_PX]
    outer = float(np.median(near[-SEARCH_PX // 2 :])) if len(near) > 1.5 * SEARCH_PX else math.nan
    if not outer < inner / 2:
        return None
    middle = (inner + outer) / 2
    above = np.flatnonzero(near > middle)
    if not above.size or above[-1] + 1 >= len(near):
        return None
    last = int(above[-1])
    part = (near[last] - middle) / (near[last] - near[last + 1])
    return max(at - SEARCH_PX, 0) + last + 0.5 + float(part)


# -- a board ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Board:
    """A checkerboard or ChArUco board.

    Attributes
    ----------
    columns, rows : int
        Of a checkerboard: inner corners; of a ChArUco board: squares.
    square_mm : float
    marker_mm : float
        Of a ChArUco board; 0 for a checkerboard.
    dictionary : str
        Of its markers, by the name in OpenCV: ``4X4_50``.
    """

    columns: int
    rows: int
    square_mm: float
    marker_mm: float = 0.0
    dictionary: str = "4X4_50"

    def __post_init__(self) -> None:
        if not (3 <= self.columns <= MAX_SQUARES and 3 <= self.rows <= MAX_SQUARES and self.square_mm > 0):
            raise ConfigError(
                "a board has 3 to {MAX_SQUARES} columns and rows, and squares above 0 mm", MAX_SQUARES
            )
        if not 0 <= self.marker_mm < self.square_mm:
            raise ConfigError("the markers of a ChArUco board are smaller than its squares")


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of a board: ``mm`` (N, 2) on the board and ``px`` (N, 2) in the picture."""

    mm: Floats
    px: Floats


def find_corners(picture: NDArray[Any], board: Board) -> Corners:
    """The corners of the board in a picture (H, W).

    Raises
    ------
    DataError
        Too few corners are found.
    ConfigError
        OpenCV has no such dictionary.
    """
    low, high = np.percentile(picture, (0.5, 99.5))
    grey = np.clip((picture - low) * (255 / max(float(high - low), 1e-6)), 0, 255).astype(np.uint8)
    found = _charuco(grey, board) if board.marker_mm else _checkerboard(grey, board)
    if found is None or len(found.px) < MIN_CORNERS:
        kind = Message("ChArUco board") if board.marker_mm else Message("checkerboard")
        count = Message("squares") if board.marker_mm else Message("inner corners")
        raise DataError(
            "no {kind} of {columns} x {rows} {count} is found; hold all of it in the picture, in focus and "
            "evenly lit, and count again",
            kind,
            board.columns,
            board.rows,
            count,
        )
    return found


def _checkerboard(grey: NDArray[np.uint8], board: Board) -> Corners | None:
    cv2 = load_cv2()
    size = board.columns, board.rows
    well, corners = cv2.findChessboardCornersSB(
        grey, size, flags=cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    )
    if not well:
        return None
    row, column = np.mgrid[: board.rows, : board.columns]
    mm = np.stack([column.ravel(), row.ravel()], axis=1) * board.square_mm
    return Corners(mm, np.asarray(corners, np.float64).reshape(-1, 2))


def _charuco(grey: NDArray[np.uint8], board: Board) -> Corners | None:
    cv2 = load_cv2()
    name = f"DICT_{board.dictionary.upper()}"
    if not (name.replace("_", "").isalnum() and hasattr(cv2.aruco, name)):
        raise ConfigError(
            "no dictionary of markers {dictionary}; give one as 4X4_50, 5X5_100, APRILTAG_36H11",
            repr(board.dictionary),
        )
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    if len(dictionary.bytesList) < board.columns * board.rows // 2:
        raise ConfigError("the dictionary {dictionary} has too few markers for this board", board.dictionary)
    made = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_mm, board.marker_mm, dictionary)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(made).detectBoard(grey)
    if ids is None:
        return None
    mm = np.asarray(made.getChessboardCorners(), np.float64)[ids.ravel(), :2]
    return Corners(mm, np.asarray(corners, np.float64).reshape(-1, 2))


def from_board(
    picture: NDArray[Any], board: Board, sigma_mm: float = 0.0, stand_off_mm: float | None = None
) -> Scale:
    """The scale in the middle of a board in a picture (H, W).

    Parameters
    ----------
    picture : (H, W), GL
    board : Board
    sigma_mm : float
        Standard uncertainty of the length of the whole board.
    stand_off_mm : float, optional
        Distance to the camera, for the tilt in degrees.

    Raises
    ------
    DataError, ConfigError
        As ``find_corners``.
    """
    corners = find_corners(picture, board)
    h = _homography(corners)
    middle = corners.mm.mean(axis=0)
    larger, smaller = np.linalg.svd(_derivative(h, middle), compute_uv=False)
    gradient = -h[2, :2] / (h[2, :2] @ middle + h[2, 2])  # of ln(px per mm), per mm
    extent = float(np.ptp(corners.mm, axis=0).max())
    spread = math.sqrt(float(((corners.mm - middle) ** 2).sum(axis=1).mean()))
    rms = math.sqrt(float(((_mapped(h, corners.mm) - corners.px) ** 2).mean()))
    # A tilt shortens one direction: half of the difference is uncertain.
    uneven = 1 - smaller / larger
    fit = rms / (larger * spread * math.sqrt(len(corners.mm)))
    relative = math.sqrt(fit**2 + (sigma_mm / extent) ** 2 + uneven**2 / 12)
    kind = Message("ChArUco board") if board.marker_mm else Message("checkerboard")
    scale = float(math.sqrt(1 / (larger * smaller)))
    method = Message("{kind} of {count} corners, {rms:.2f} px rms", kind, len(corners.mm), rms)
    change = float(np.hypot(*gradient)) * extent
    return Scale(scale, scale * relative, method, tuple(_tilt(change, float(uneven), extent, stand_off_mm)))


def _tilt(change: float, uneven: float, extent: float, stand_off_mm: float | None) -> Iterator[str]:
    if max(change, uneven) <= MAX_UNEVEN:
        return
    degrees = math.degrees(math.acos(min(1 - uneven, 1.0)))
    if stand_off_mm is not None:
        degrees = math.degrees(math.asin(min(change / extent * stand_off_mm, 1.0)))
    yield Message(
        "the board is tilted by {degrees:.0f} degrees: the scale changes by {change:.1%} over it, by "
        "{uneven:.1%} between directions; set the camera square to it",
        degrees,
        change,
        uneven,
    )


def _homography(corners: Corners) -> Floats:
    h, _ = load_cv2().findHomography(corners.mm, corners.px, 0)
    if h is None:
        raise DataError("the corners found do not lie on a plane; hold the board still and in focus")
    return np.asarray(h, np.float64)


def _mapped(h: Floats, mm: Floats) -> Floats:
    mapped = np.column_stack([mm, np.ones(len(mm))]) @ h.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def _derivative(h: Floats, at: Floats) -> Floats:
    """The derivative of the homography, px per mm, (2, 2)."""
    mapped = h @ np.array([*at, 1.0])
    return np.asarray((h[:2, :2] - np.outer(mapped[:2] / mapped[2], h[2, :2])) / mapped[2])
