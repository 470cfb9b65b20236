"""Monochrome pixel formats of GenICam, and their bytes as grey levels.

Names and numbers are those of the pixel format naming convention (PFNC 2.4). ``p`` packs from the lowest bit on without
gaps; the older ``Packed`` of GigE Vision has the high bits of two pixels in a byte each, their low bits between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.frame import frozen

Packing = Literal["", "p", "Packed"]


@dataclass(frozen=True, slots=True)
class MonoFormat:
    """How the samples of a picture lie in memory.

    Attributes
    ----------
    name : str
    code : int
        Its number on the line.
    bits : int
        Significant bits of a sample.
    packing : "" | "p" | "Packed"
        "": one sample in one byte, or in two with the low byte first.
    """

    name: str
    code: int
    bits: int
    packing: Packing = ""

    def size(self, pixels: int) -> int:
        """Bytes of so many pixels."""
        if self.packing == "Packed":
            return (3 * pixels + 1) // 2
        return (pixels * (self.bits if self.packing else 8 * self.bytes_per_sample) + 7) // 8

    @property
    def bytes_per_sample(self) -> int:
        """Bytes of an unpacked sample."""
        return 1 if self.bits <= 8 else 2


# In the order in which they are chosen when none is asked for: 12 bits first, packed ones before others.
FORMATS: dict[str, MonoFormat] = {
    item.name: item
    for item in (
        MonoFormat("Mono12p", 0x010C0047, 12, "p"),
        MonoFormat("Mono12Packed", 0x010C0006, 12, "Packed"),
        MonoFormat("Mono12", 0x01100005, 12),
        MonoFormat("Mono14", 0x01100025, 14),
        MonoFormat("Mono10p", 0x010A0046, 10, "p"),
        MonoFormat("Mono10Packed", 0x010C0004, 10, "Packed"),
        MonoFormat("Mono10", 0x01100003, 10),
        MonoFormat("Mono16", 0x01100007, 16),
        MonoFormat("Mono8", 0x01080001, 8),
    )
}


def readable(offered: list[str]) -> list[str]:
    """Those of the offered formats that can be read, the best first."""
    return [name for name in FORMATS if name in offered]


def preferred(offered: list[str]) -> str | None:
    """The best of the offered formats; None if none can be read."""
    return next(iter(readable(offered)), None)


def decode(
    data: bytes | memoryview, pixel_format: MonoFormat, width: int, height: int, padding: int = 0
) -> NDArray[Any]:
    """A picture of its own memory from the bytes of a camera.

    Parameters
    ----------
    data : buffer of bytes
    pixel_format : MonoFormat
    width, height : int, px
    padding : int, bytes
        After each row; a row then begins with a byte of its own.

    Returns
    -------
    (H, W) uint8 or uint16, GL, read-only

    Raises
    ------
    DataError
        Too few bytes.
    """
    rows, pixels = (height, width) if padding else (1, width * height)
    length = pixel_format.size(pixels)
    needed = rows * (length + padding) - padding
    samples = np.frombuffer(data, np.uint8)
    if samples.size < needed:
        raise DataError("{size} bytes instead of {needed}", samples.size, needed)
    return frozen(
        _unpacked_rows(samples[:needed], pixel_format, pixels, length + padding).reshape(height, width)
    )


def _unpacked_rows(
    samples: NDArray[np.uint8], pixel_format: MonoFormat, pixels: int, pitch: int
) -> NDArray[Any]:
    """Grey levels of rows of so many pixels that begin ``pitch`` bytes after one another."""
    length = pixel_format.size(pixels)
    count = (samples.size - length) // pitch + 1
    rows = as_strided(samples, (count, length), (pitch, 1))
    if pixel_format.size(8 * pixels) == 8 * length:  # no row ends within a byte
        return _unpacked(rows.reshape(-1), pixel_format, count * pixels)
    return np.stack([_unpacked(row, pixel_format, pixels) for row in rows])


def _unpacked(samples: NDArray[np.uint8], pixel_format: MonoFormat, pixels: int) -> NDArray[Any]:
    if pixel_format.packing:
        from acquire.genicam.unpack_loops import UNPACK

        image = np.empty(pixels, np.uint16)
        UNPACK[pixel_format.name](samples, image)
        return image
    return samples.copy() if pixel_format.bytes_per_sample == 1 else samples.view("<u2").astype(np.uint16)
