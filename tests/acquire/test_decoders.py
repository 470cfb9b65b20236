"""Every decoder of every driver, bit for bit against a packer that shares no code with it, over widths and paddings."""

from __future__ import annotations

import numpy as np
import pytest

from acquire.genicam.formats import FORMATS as GENICAM
from acquire.genicam.formats import decode as decode_genicam
from acquire.v4l2.formats import FORMATS as V4L2
from acquire.v4l2.formats import PLANES, picture_size
from acquire.v4l2.formats import decode as decode_v4l2
from tests.genicam.packing import PACK, bits_of

WIDTHS, PADDINGS, HEIGHT = range(1, 71), range(10), 3


def sent(bits: int, width: int, padding: int) -> np.ndarray:
    return (
        np.random.default_rng((bits, width, padding)).integers(0, 2**bits, (HEIGHT, width)).astype(np.uint16)
    )


@pytest.mark.parametrize("name", GENICAM)
def test_genicam(name: str) -> None:
    for width in WIDTHS:
        for padding in PADDINGS:
            image = sent(bits_of(name), width, padding)
            rows = [PACK[name](row) + b"\xa5" * padding for row in image]
            data = b"".join(rows) if padding else PACK[name](image.reshape(-1))
            got = decode_genicam(data, GENICAM[name], width, HEIGHT, padding)
            assert np.array_equal(got, image), (width, padding)


PLAIN = [name for name, item in V4L2.items() if item.kind in ("grey", "bayer", "luma")]


def row_of(levels: np.ndarray, name: str) -> bytes:
    item = V4L2[name]
    if item.kind == "luma":  # beside each level a chroma
        return b"".join(bytes([v, 90] if name == "YUYV" else [90, v]) for v in levels.tolist())
    return b"".join(int(v).to_bytes(1 if item.bits == 8 else 2, "little") for v in levels)


@pytest.mark.parametrize("name", PLAIN)
def test_v4l2(name: str) -> None:
    item = V4L2[name]
    for width in WIDTHS:
        for padding in PADDINGS:
            image = sent(item.bits, width, padding)
            rows = [row_of(levels, name) for levels in image]
            data = b"".join(row + b"\xa5" * padding for row in rows)
            got = decode_v4l2(data, item, width, HEIGHT, len(rows[0]) + padding)
            assert np.array_equal(got, image), (width, padding)


@pytest.mark.parametrize("name", [name for name in PLAIN if V4L2[name].kind == "bayer"])
def test_planes_of_a_mosaic_of_any_size_are_as_large_as_announced(name: str) -> None:
    item = V4L2[name]
    for width in range(2, 20):
        for height in range(2, 6):
            image = np.arange(width * height, dtype=np.uint16).reshape(height, width)
            data = b"".join(row_of(levels, name) for levels in image)
            for plane in PLANES[1:]:
                first = item.order.index(plane.upper())
                want = [levels[first % 2 :: 2] for levels in image.tolist()[first // 2 :: 2]]
                got = decode_v4l2(data, item, width, height, 0, plane)
                assert got.tolist() == want
                assert got.shape[::-1] == picture_size(width, height, item, plane)
