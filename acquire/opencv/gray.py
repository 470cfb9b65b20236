"""Colour pictures as grey ones: equal channels are grey already, anything else has to be chosen."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.errors import ConfigError, DataError
from acquire.text import Message

GRAYS = ("luma", "r", "g", "b")
_PLANE = {"b": 0, "g": 1, "r": 2}  # OpenCV's order

WEBCAM_WARNING = Message(
    "grey is the luma of a compressed colour stream: clipped, with noise that averaging does not "
    "remove; a raw grey format measures better"
)


def to_gray(picture: NDArray[Any], gray: str | None, source: str) -> NDArray[Any]:
    """The picture as one plane.

    Parameters
    ----------
    picture : (H, W) or (H, W, 1 | 3 | 4) uint8 | uint16
        Blue, green, red (and alpha, ignored), as OpenCV has them.
    gray : "luma" | "r" | "g" | "b" | None
        None: only a picture whose channels are equal is taken.
    source : str
        For messages.

    Raises
    ------
    ConfigError
        The channels differ and ``gray`` is not given.
    DataError
        Neither 8- nor 16-bit, or an unknown number of channels.
    """
    if picture.dtype not in (np.uint8, np.uint16):
        raise DataError(
            "{source}: samples are {dtype}; save it with 8 or 16 bits a sample", source, picture.dtype
        )
    if picture.ndim == 2:
        return picture
    if picture.ndim != 3 or picture.shape[2] not in (1, 3, 4):
        raise DataError(
            "{source}: a picture of shape {shape} is neither grey nor colour", source, picture.shape
        )
    if picture.shape[2] == 1:
        return picture[:, :, 0].copy()
    return _one_plane(picture, gray, source)


def _one_plane(picture: NDArray[Any], gray: str | None, source: str) -> NDArray[Any]:
    first = picture[:, :, 0]
    if all(np.array_equal(first, picture[:, :, k]) for k in (1, 2)):
        return first.copy()
    if gray is None:
        raise ConfigError(
            "{source}: a colour picture; add ?gray=luma (or r, g, b) to the address, as in 'shots?gray=luma'",
            source,
        )
    if gray in _PLANE:
        return picture[:, :, _PLANE[gray]].copy()
    cv2 = load_cv2()

    luma: NDArray[Any] = cv2.cvtColor(np.ascontiguousarray(picture[:, :, :3]), cv2.COLOR_BGR2GRAY)
    return luma
