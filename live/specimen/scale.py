"""The scale of the picture, mm per px, with its uncertainty: from two points, or from the specimen's width.

``board`` has it from a checkerboard.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from live.specimen.region import Region

Bools = NDArray[np.bool_]

POINT_PX = 1.0
"""Standard uncertainty of a place that a person has picked, each way."""
EDGE_PX = 1.0  # of an edge of the specimen that its pattern shows, systematic
MASK_PX = 6.0  # of an edge of the mask, where the pattern does not show it
ROWS, FEWEST_ROWS = 48, 12  # px along the load over which an edge is found
REACH = 24  # px to both sides of the mask's edge
OUT_OF_PLANE_MM = 0.1


@dataclass(frozen=True, slots=True)
class Scale:
    """A scale that was taken.

    Attributes
    ----------
    mm_per_px, sigma : float
        With its standard uncertainty.
    method : str
        How, in words.
    remarks : tuple of str
        What a person should know or mend, as a tilt.
    """

    mm_per_px: float
    sigma: float
    method: str
    remarks: tuple[str, ...] = ()

    @property
    def relative(self) -> float:
        """Its uncertainty as a part of it."""
        return self.sigma / self.mm_per_px

    def changes(self, stand_off_mm: float | None = None) -> dict[str, Any]:
        """What it sets in a rig file (``live.setup.write_rig``)."""
        changes: dict[str, Any] = {
            "scale.mm_per_px": float(f"{self.mm_per_px:.7g}"),
            "scale.sigma_mm_per_px": float(f"{self.sigma:.2g}"),
            "scale.date": f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d %H:%M} UTC",
            "scale.method": self.method,
        }
        return changes if stand_off_mm is None else {**changes, "scale.stand_off_mm": stand_off_mm}


def from_points(points: tuple[float, float, float, float], length_mm: float, sigma_mm: float = 0.0) -> Scale:
    """Two points x1, y1, x2, y2 (px) that are ``length_mm`` apart; raises ConfigError where they are one."""
    x1, y1, x2, y2 = points
    px = math.hypot(x2 - x1, y2 - y1)
    if not (px > 1 and length_mm > 0 and math.isfinite(px) and math.isfinite(length_mm)):
        raise ConfigError("the scale needs two points more than 1 px apart and a length above 0 mm")
    relative = math.hypot(math.sqrt(2) * POINT_PX / px, sigma_mm / length_mm)
    scale = length_mm / px
    return Scale(scale, scale * relative, f"two points {px:.1f} px apart, {length_mm:g} mm")


def from_width(
    picture: NDArray[Any], region: Region, axis: str, width_mm: float, sigma_mm: float = 0.0
) -> Scale:
    """The specimen found in ``picture`` (H, W) is ``width_mm`` wide across the load.

    Raises
    ------
    DataError
        Its edges are not seen.
    """
    px, sigma_px = specimen_width(picture, region, axis)
    scale = width_mm / px
    relative = math.hypot(sigma_px / px, sigma_mm / width_mm)
    remarks = (
        ("the edges are known to some px only: two points or a board are better",) if relative > 0.01 else ()
    )
    return Scale(scale, scale * relative, f"width of the specimen, {px:.1f} px are {width_mm:g} mm", remarks)


def false_strain(stand_off_mm: float, out_of_plane_mm: float = OUT_OF_PLANE_MM) -> float:
    """Strain that a motion toward the camera feigns: the image grows as the distance falls."""
    return out_of_plane_mm / stand_off_mm


# -- the width of the specimen ------------------------------------------------------------------


def specimen_width(picture: NDArray[Any], region: Region, axis: str) -> tuple[float, float]:
    """Width across the load in the middle half of the specimen, px, with its standard uncertainty.

    An edge is where the scatter of the grey levels along the load falls to the middle between pattern and
    background. Where the background scatters as much, it is the edge of the mask.
    """
    mask = region.mask
    if mask is None or not region.found:
        raise DataError("the edges of the specimen are not seen; give two points, or a larger field of view")
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
    size = min(ROWS, max(FEWEST_ROWS, last + 1 - first))
    yield from (slice(top, top + size) for top in range(first, max(last + 2 - size, first + 1), size))


def _sides(mask: Bools) -> tuple[float, float] | None:
    """Left and right edge of the mask over some rows; None where it reaches the picture's."""
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
    inner = float(np.median(scatter[left + REACH : right - REACH])) if right - left > 3 * REACH else math.nan
    edges = [_edge(scatter[::-1], len(scatter) - left, inner), _edge(scatter, right, inner)]
    if None in edges:
        return None
    return float(edges[1] + edges[0] - len(scatter))  # type: ignore[operator]


def _edge(scatter: NDArray[np.float32], at: int, inner: float) -> float | None:
    """Where the scatter falls for good, coming from the left; px from the left edge of the picture."""
    near = scatter[max(at - REACH, 0) : at + REACH]
    outer = float(np.median(near[-REACH // 2 :])) if len(near) > 1.5 * REACH else math.nan
    if not outer < inner / 2:
        return None
    middle = (inner + outer) / 2
    above = np.flatnonzero(near > middle)
    if not above.size or above[-1] + 1 >= len(near):
        return None
    last = int(above[-1])
    part = (near[last] - middle) / (near[last] - near[last + 1])
    return max(at - REACH, 0) + last + 0.5 + float(part)
