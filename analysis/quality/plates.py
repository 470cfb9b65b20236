"""Patterns beside the specimen that look like plates: rectangles of its speckle, along its length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import Roi
from analysis.quality.specimen import Specimen, find_specimen

MOST = 2
MIN_FILLED = 0.9  # of its box: a rectangle
MAX_RADIUS_RATIO = 1.5  # of its speckle to that of the specimen, either way
MIN_LENGTH = 0.4  # of the specimen beside it
RIM_PX = 16


@dataclass(frozen=True, slots=True)
class FoundPlates:
    """What looks like plates in a still picture, which does not show what they hang from.

    Attributes
    ----------
    plates : tuple of Roi
        From left to right, or from top to bottom.
    unclear : tuple of Roi
        Other patterns beside the specimen.
    """

    plates: tuple[Roi, ...] = ()
    unclear: tuple[Roi, ...] = ()


def find_plates(image: ArrayLike, specimen: Specimen, noise: float | None = None) -> FoundPlates:
    """Patterns outside of ``specimen``, which ``find_specimen`` has found in ``image``.

    Parameters
    ----------
    image : (H, W), GL
    specimen : Specimen
    noise : float, GL, optional
        As of ``find_specimen``.
    """
    rest = np.array(image, np.float32)
    _cover(rest, specimen.box)
    found: dict[bool, list[Roi]] = {True: [], False: []}
    for _ in range(MOST):
        piece = find_specimen(rest, noise)
        if piece is None:
            break
        found[_is_plate(piece, specimen)].append(piece.box)
        _cover(rest, piece.box)
    return FoundPlates(
        *(tuple(sorted(found[clear], key=lambda box: box.x + box.y)) for clear in (True, False))
    )


def _cover(picture: NDArray[np.float32], box: Roi) -> None:
    """Make a box and its rim even."""
    y, x = max(box.y - RIM_PX, 0), max(box.x - RIM_PX, 0)
    part = picture[y : box.y + box.height + RIM_PX, x : box.x + box.width + RIM_PX]
    part[:] = part.mean()


def _is_plate(piece: Specimen, specimen: Specimen) -> bool:
    box = piece.box
    filled = float(piece.mask[box.y : box.y + box.height, box.x : box.x + box.width].mean())
    alike = 1 / MAX_RADIUS_RATIO <= piece.radius / specimen.radius <= MAX_RADIUS_RATIO
    return filled >= MIN_FILLED and alike and _beside(box, specimen.box)


def _beside(box: Roi, of: Roi) -> bool:
    """Whether a box lies along another one, which is longer than wide, for a good part of its length."""
    if of.width > of.height:
        box, of = (Roi(one.y, one.x, one.height, one.width) for one in (box, of))
    common = min(box.y + box.height, of.y + of.height) - max(box.y, of.y)
    apart = box.x >= of.x + of.width or box.x + box.width <= of.x
    return apart and common >= MIN_LENGTH * of.height
