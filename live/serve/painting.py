"""Small pictures for the page: grey levels with a map, with what is saturated, or with a mask over them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from analysis.field import Status, StrainField, ZoiGrid
from live.maps import STATUS_COLOURS, AutoRange, colour, ramp, unit_for

MOST_SIDE = 960
"""Of a picture, px; larger ones are shown smaller."""
QUALITY = 80
OPACITY = 165
RED = (40, 40, 255)  # of OpenCV: blue, green, red
STRAINS = ("exx", "eyy", "exy", "e1", "e2")
COMPONENTS = (*STRAINS, "u", "v", "sigma", "status")
"""What a map can show; e1 and e2 are the principal strains, sigma is that of the strain along the load."""

Bytes = NDArray[np.uint8]
RAMP = [f"#{bytes(row).hex()}" for row in ramp(11, 1)[:, 0]]
"""The colours of a map from its highest value down."""


@dataclass(frozen=True, slots=True)
class Scale:
    """What the colours of a map stand for: ``low`` to ``high`` in ``unit``."""

    component: str
    low: float
    high: float
    unit: str


class Colours:
    """The colours of one component after the other, with a range that does not flicker.

    Parameters
    ----------
    axis : "x" or "y"
        Of the load.
    fixed : float or None
        Range of the strains.
    """

    def __init__(self, axis: str, fixed: float | None) -> None:
        self._along = "exx" if axis == "x" else "eyy"
        self._fixed = fixed
        self._ranges: dict[str, AutoRange] = {}

    def of(self, field: StrainField, component: str) -> tuple[Bytes, Scale]:
        """RGBA, (R, C, 4), and its scale."""
        if component == "status":
            return _statuses(field), Scale(component, 0, 0, "")
        if component in ("u", "v"):
            return _centred(field.value(component), component)
        values, sigma = self._values(field, component)
        known = self._ranges.setdefault(component, AutoRange(self._fixed if component in STRAINS else None))
        limit = known.update(values, sigma)
        unit = unit_for(limit)
        low = -limit if component in STRAINS else 0.0
        return colour(values, limit, OPACITY), Scale(
            component, low * unit.factor, limit * unit.factor, unit.name
        )

    def _values(self, field: StrainField, component: str) -> tuple[NDArray[Any], NDArray[Any]]:
        sigma = field.sigma(self._along)
        if component in ("e1", "e2"):
            return field.strain(field.measure).principal[0 if component == "e1" else 1], sigma
        if component == "sigma":
            return sigma, np.zeros_like(sigma)
        return field.value(component), field.sigma(component)


def _statuses(field: StrainField) -> Bytes:
    table = np.zeros((256, 4), np.uint8)
    for number, status in enumerate(Status):
        hexes = STATUS_COLOURS[number % len(STATUS_COLOURS)].lstrip("#")
        table[int(status)] = [*bytes.fromhex(hexes[:6]), OPACITY if len(hexes) == 6 else 0]
    return np.asarray(table[field.status.astype(np.uint8)])


def _centred(values: NDArray[Any], component: str) -> tuple[Bytes, Scale]:
    """A displacement about its middle, so that rigid motion does not hide the rest."""
    known = values[np.isfinite(values)]
    low, high = (float(v) for v in np.percentile(known, (1, 99))) if known.size else (0.0, 0.0)
    half = max((high - low) / 2, 1e-3)
    middle = (low + high) / 2
    return colour(values - middle, half, OPACITY), Scale(component, middle - half, middle + half, "px")


def shrunk(image: NDArray[Any], bits: int, most: int = MOST_SIDE) -> tuple[Bytes, float]:
    """Grey levels as (h, w, 3) uint8, and how many px of it are one of ``image``."""
    height, width = image.shape
    scale = min(1.0, most / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    cv2 = load_cv2()
    levels = np.asarray(image, np.float32)
    if scale < 1:
        levels = cv2.resize(levels, size, interpolation=cv2.INTER_AREA)
    grey = np.clip(levels * (255 / (2**bits - 1)), 0, 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2), scale


def lay_cells(
    picture: Bytes, scale: float, grid: ZoiGrid, cells: Bytes, moved: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Lay RGBA ``cells`` (R, C, 4) of ``grid`` over ``picture``, in place; they have ``moved`` by (x, y), px."""
    half = grid.step / 2
    across, down = (m if math.isfinite(m) else 0.0 for m in moved)
    left, right = (round((x + across) * scale) for x in (grid.x[0] - half, grid.x[-1] + half))
    top, bottom = (round((y + down) * scale) for y in (grid.y[0] - half, grid.y[-1] + half))
    cv2 = load_cv2()
    large = cv2.resize(cells, (max(right - left, 1), max(bottom - top, 1)), interpolation=cv2.INTER_NEAREST)
    height, width = picture.shape[:2]
    rows, columns = slice(max(top, 0), min(bottom, height)), slice(max(left, 0), min(right, width))
    part = large[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
    under = picture[rows, columns]
    share = part[..., 3:].astype(np.float32) / 255
    picture[rows, columns] = (under * (1 - share) + part[..., 2::-1] * share).astype(np.uint8)


def mark_saturated(picture: Bytes, scale: float, image: NDArray[Any], bits: int) -> None:
    """Paint red what is at the end of the scale; one such pixel is seen in a shrunk picture too."""
    rows, columns = np.nonzero(image >= 2**bits - 1)
    if rows.size:
        height, width = picture.shape[:2]
        y = np.minimum((rows * scale).astype(np.intp), height - 1)
        x = np.minimum((columns * scale).astype(np.intp), width - 1)
        picture[y, x] = RED


def as_jpeg(picture: Bytes) -> bytes:
    """(h, w, 3) of OpenCV's order as a file."""
    cv2 = load_cv2()
    _, content = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return bytes(content)


def as_png(picture: NDArray[Any]) -> bytes:
    """A picture without loss as a file."""
    _, content = load_cv2().imencode(".png", picture)
    return bytes(content)


def traffic_light(values: NDArray[Any], good: float, bad: float) -> Bytes:
    """RGBA of ZOIs by their noise: green up to ``good``, yellow, red from ``bad`` and without a value."""
    with np.errstate(invalid="ignore", divide="ignore"):
        place = np.clip(np.log(values / good) / math.log(bad / good), 0, 1)
    place = np.where(np.isfinite(place), place, 1.0)[..., None]
    green, yellow, red = (np.array(c, float) for c in ((40, 170, 80), (240, 200, 30), (220, 50, 40)))
    rgb = np.where(
        place < 0.5, green + 2 * place * (yellow - green), yellow + (2 * place - 1) * (red - yellow)
    )
    return np.concatenate([rgb, np.full((*values.shape, 1), 110.0)], axis=-1).astype(np.uint8)
