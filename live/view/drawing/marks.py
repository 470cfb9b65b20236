"""What the scene is made of: words, lines, rounded numbers and encoded pictures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from live.maps import number
from live.view.drawing.curve import Axis

GREY, DIM = (170, 175, 185), (62, 66, 74)
ORANGE, CYAN, YELLOW = (255, 169, 64), (64, 224, 255), (255, 212, 59)


def words(places: Any, labels: list[str], colour: Any = GREY) -> Any:
    """Text hung below its places."""
    import rerun as rr

    return rr.Points2D(places, labels=labels, colors=colour, radii=0.0, show_labels=True, draw_order=40)


def lines(strips: Any, colour: tuple[int, int, int], radius: float) -> Any:
    """Polylines; the thicker lie above."""
    import rerun as rr

    return rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(radius), draw_order=radius)


def rounded(value: float, axis: Axis) -> str:
    """A value with its unit, in three or four digits of the axis."""
    digits = max(0, 2 - math.floor(math.log10(max(abs(axis.low), abs(axis.high)) * axis.factor)))
    return f"{number(round(value * axis.factor, digits))} {axis.unit}"


def reduced(image: NDArray[Any], bits: int, longest_px: int) -> tuple[NDArray[np.uint8], int]:
    """An 8-bit picture of at most ``longest_px``, and the whole factor it was reduced by."""
    cv2 = load_cv2()

    factor = max(1, math.ceil(max(image.shape) / longest_px))
    if factor > 1:
        size = image.shape[1] // factor, image.shape[0] // factor
        image = cv2.resize(image[: size[1] * factor, : size[0] * factor], size, interpolation=cv2.INTER_AREA)
    if bits != 8:
        image = cv2.convertScaleAbs(image, alpha=255.0 / (2**bits - 1))
    return image, factor


def encode(kind: str, image: NDArray[np.uint8], quality: int) -> bytes:
    """The file ``kind`` (".jpg", ".png") of an image in OpenCV's order of colours."""
    cv2 = load_cv2()

    flag = cv2.IMWRITE_JPEG_QUALITY if kind == ".jpg" else cv2.IMWRITE_PNG_COMPRESSION
    _, data = cv2.imencode(kind, image, [flag, quality])
    return bytes(data)
