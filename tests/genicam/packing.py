"""Pictures of the fake camera and their packed bytes, made bit by bit: no code of the product is used."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.uint16]


def bits_of(name: str) -> int:
    return int("".join(filter(str.isdecimal, name)))


def picture(number: int, width: int, height: int, name: str) -> Samples:
    """What the frame ``number`` shows, (H, W): all grey levels of the format, another order in each frame."""
    levels = 2 ** bits_of(name)
    pixels = np.arange(width * height, dtype=np.int64)
    return ((pixels * 2654435761 + 977 * number) % levels).astype(np.uint16).reshape(height, width)


def plain8(samples: Samples) -> bytes:
    return samples.astype(np.uint8).tobytes()


def plain16(samples: Samples) -> bytes:
    return samples.astype("<u2").tobytes()


def packed_low_first(bits: int) -> Callable[[Samples], bytes]:
    """The "p" formats: bit 0 of the first sample is bit 0 of the first byte, without a gap."""

    def pack(samples: Samples) -> bytes:
        stream = (samples[:, None] >> np.arange(bits)) & 1
        return np.packbits(stream.reshape(-1).astype(np.uint8), bitorder="little").tobytes()

    return pack


def packed_gige(bits: int) -> Callable[[Samples], bytes]:
    """The "Packed" formats of GigE Vision 1.x: high bits of two samples around a byte with their low bits."""
    low = bits - 8

    def pack(samples: Samples) -> bytes:
        odd = len(samples) % 2
        first, second = np.pad(samples, (0, odd)).reshape(-1, 2).T
        middle = (first & (1 << low) - 1) | (second & (1 << low) - 1) << 4
        content = np.stack([first >> low, middle, second >> low], axis=1).astype(np.uint8).tobytes()
        return content[:-1] if odd else content

    return pack


PACK: dict[str, Callable[[Any], bytes]] = {
    **dict.fromkeys(("Mono10", "Mono12", "Mono14", "Mono16"), plain16),
    "Mono8": plain8,
    "Mono10p": packed_low_first(10),
    "Mono12p": packed_low_first(12),
    "Mono10Packed": packed_gige(10),
    "Mono12Packed": packed_gige(12),
}
PIXEL_FORMATS = {  # PFNC: the code has the bits of a pixel in its third byte
    "Mono8": 0x01080001, "Mono10": 0x01100003, "Mono10p": 0x010A0046, "Mono10Packed": 0x010C0004,
    "Mono12": 0x01100005, "Mono12p": 0x010C0047, "Mono12Packed": 0x010C0006, "Mono14": 0x01100025,
    "Mono16": 0x01100007,
}  # fmt: skip
