"""Pixel formats of V4L2 that can be measured with, and how their bytes become a picture.

Pure: bytes in, arrays out. Formats that hide or destroy grey levels carry a warning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.errors import DataError
from acquire.frame import frozen
from acquire.text import Message, about

Kind = Literal["grey", "luma", "bayer", "jpeg"]
Plane = Literal["raw", "r", "g", "b"]
PLANES: tuple[Plane, ...] = ("raw", "r", "g", "b")

LUMA_WARNING = Message(
    "luma of a colour stream, limited to 16..235 of 255: black and white levels are clipped unseen below "
    "255; a raw grey format measures better"
)
BAYER_WARNING = Message(
    "raw mosaic of a colour sensor: its colours add a pattern that stands still; use plane=g (half "
    "the size), a monochrome camera, or white light"
)
JPEG_WARNING = Message(
    "compressed pictures: artefacts of 0.6 to 1.7 GL rms that no averaging removes, and displacements "
    "biased by them; ask for a raw format if the camera has one"
)

_ORDERS = ("BGGR", "GBRG", "GRBG", "RGGB")
_BAYER = {
    8: ("BA81", "GBRG", "GRBG", "RGGB"),
    10: ("BG10", "GB10", "BA10", "RG10"),
    12: ("BG12", "GB12", "BA12", "RG12"),
    16: ("BYR2", "GB16", "GR16", "RG16"),
}


@dataclass(frozen=True, slots=True)
class PixelFormat:
    """A pixel format.

    Attributes
    ----------
    fourcc : str
        Without trailing blanks.
    bits : int
        Significant bits of a sample.
    kind : "grey" | "luma" | "bayer" | "jpeg"
    bytes_per_sample : int
    order : str
        Bayer: the four colours row by row; luma: the place of Y in a pair of bytes, "0" or "1".
    """

    fourcc: str
    bits: int
    kind: Kind
    bytes_per_sample: int
    order: str = ""

    @property
    def bytes_per_pixel(self) -> int:
        """Bytes in a row for each pixel; 0 where compressed."""
        return {"grey": self.bytes_per_sample, "bayer": self.bytes_per_sample, "luma": 2, "jpeg": 0}[
            self.kind
        ]


# In the order in which they are chosen when none is asked for; JPEG never is.
FORMATS: dict[str, PixelFormat] = {
    item.fourcc: item
    for item in (
        PixelFormat("Y12", 12, "grey", 2),
        PixelFormat("Y14", 14, "grey", 2),
        PixelFormat("Y10", 10, "grey", 2),
        PixelFormat("Y16", 16, "grey", 2),
        PixelFormat("GREY", 8, "grey", 1),
        PixelFormat("YUYV", 8, "luma", 2, "0"),
        PixelFormat("UYVY", 8, "luma", 2, "1"),
        *(
            PixelFormat(code, bits, "bayer", 1 if bits == 8 else 2, order)
            for bits in _BAYER
            for code, order in zip(_BAYER[bits], _ORDERS, strict=True)
        ),
        PixelFormat("MJPG", 8, "jpeg", 1),
        PixelFormat("JPEG", 8, "jpeg", 1),
    )
}


def preferred(offered: list[str]) -> str | None:
    """The best of the offered formats, never a compressed one; None if there is none."""
    return next((code for code, item in FORMATS.items() if code in offered and item.kind != "jpeg"), None)


def picture_size(width: int, height: int, pixel_format: PixelFormat, plane: Plane) -> tuple[int, int]:
    """Width and height of the pictures handed out: one colour plane of a mosaic has every other row and column."""
    if pixel_format.kind != "bayer" or plane == "raw":
        return width, height
    y, x = _first(pixel_format, plane)
    return (width + 1 - x) // 2, (height + 1 - y) // 2


def _first(pixel_format: PixelFormat, plane: Plane) -> tuple[int, int]:
    """Row and column of the first sample of a colour; of the two greens of a mosaic the upper one."""
    y, x = divmod(pixel_format.order.index(plane.upper()), 2)
    return y, x


def decode(
    data: Any, pixel_format: PixelFormat, width: int, height: int, bytes_per_line: int, plane: Plane = "raw"
) -> NDArray[Any]:
    """A picture of its own memory from a driver's buffer.

    Parameters
    ----------
    data : buffer of bytes
    pixel_format : PixelFormat
    width, height : int, px
    bytes_per_line : int
        Padding at the end of a row included.
    plane : "raw" | "r" | "g" | "b"
        Of a Bayer mosaic.

    Returns
    -------
    (H, W) uint8 or uint16, GL, read-only

    Raises
    ------
    DataError
        Too few bytes, or not a picture.
    """
    if pixel_format.kind == "jpeg":
        return frozen(_decode_jpeg(data, width, height))
    row = max(bytes_per_line, width * pixel_format.bytes_per_pixel)
    # Some drivers leave out the padding of the last row.
    needed = row * (height - 1) + width * pixel_format.bytes_per_pixel
    samples = np.frombuffer(data, np.uint8)
    if samples.size < needed:
        raise DataError("{size} bytes instead of {needed}", samples.size, needed)
    rows = np.lib.stride_tricks.as_strided(
        samples, (height, width * pixel_format.bytes_per_pixel), (row, 1), writeable=False
    )
    if pixel_format.kind == "luma":
        return frozen(rows[:, int(pixel_format.order) :: 2].copy())
    if pixel_format.bytes_per_sample == 1:
        return frozen(_plane(rows, pixel_format, plane).copy())
    return frozen(_plane(rows.view("<u2"), pixel_format, plane).astype(np.uint16))


def _plane(mosaic: NDArray[Any], pixel_format: PixelFormat, plane: Plane) -> NDArray[Any]:
    if pixel_format.kind != "bayer" or plane == "raw":
        return mosaic
    y, x = _first(pixel_format, plane)
    return mosaic[y::2, x::2]


def _decode_jpeg(data: Any, width: int, height: int) -> NDArray[Any]:
    cv2 = load_cv2()

    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    except cv2.error as error:
        raise DataError("not a JPEG picture: {error}", error) from error
    if picture is None or picture.shape != (height, width):
        raise DataError("not a JPEG picture of the agreed size")
    gray: NDArray[Any] = picture
    return gray


def warning_of(pixel_format: PixelFormat, *, full_range: bool = False, plane: Plane = "raw") -> str | None:
    """What a person should know before measuring with this format; None: nothing."""
    if pixel_format.kind == "luma" and not full_range:
        return about(pixel_format.fourcc, LUMA_WARNING)
    if pixel_format.kind == "bayer" and plane == "raw":
        return about(pixel_format.fourcc, BAYER_WARNING)
    if pixel_format.kind == "jpeg":
        return about(pixel_format.fourcc, JPEG_WARNING)
    return None
