from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import DataError
from acquire.v4l2.api import fourcc, fourcc_text
from acquire.v4l2.formats import FORMATS, PLANES, Plane, decode, preferred, warning_of


@given(st.sampled_from(sorted(FORMATS)), st.binary(max_size=400), st.integers(0, 60), st.sampled_from(PLANES))
def test_any_bytes_give_a_picture_or_a_clear_error(name: str, data: bytes, line: int, plane: Plane) -> None:
    try:
        image = decode(memoryview(data), FORMATS[name], 10, 6, line, plane)
    except DataError as error:
        assert "bytes" in str(error) or "JPEG" in str(error)
    else:
        assert image.shape in ((6, 10), (3, 5))
        assert not image.flags.writeable


@pytest.mark.parametrize("plane", ["r", "g", "b"])
@pytest.mark.parametrize("name", ["BA81", "GBRG", "GRBG", "RGGB", "BG12", "GB10", "BA12", "RG16"])
def test_a_colour_plane_holds_the_pixels_under_its_filter(name: str, plane: Plane) -> None:
    item = FORMATS[name]
    tile = np.array([ord(c) for c in item.order.lower()]).reshape(2, 2)
    mosaic = np.tile(tile, (3, 5)).astype(f"u{item.bytes_per_sample}")
    image = decode(mosaic.tobytes(), item, 10, 6, 0, plane)
    assert image.shape == (3, 5)
    assert set(image.ravel()) == {ord(plane)}


def test_grey_is_preferred_and_compression_never_chosen() -> None:
    assert preferred(["MJPG", "YUYV", "GREY", "Y12"]) == "Y12"
    assert preferred(["MJPG", "YUYV"]) == "YUYV"
    assert preferred(["MJPG", "H264"]) is None


def test_formats_that_hide_grey_levels_warn() -> None:
    assert warning_of(FORMATS["Y12"]) is None
    assert "16..235" in str(warning_of(FORMATS["YUYV"]))
    assert warning_of(FORMATS["YUYV"], full_range=True) is None
    assert "mosaic" in str(warning_of(FORMATS["RGGB"]))
    assert warning_of(FORMATS["RGGB"], plane="g") is None
    assert "averaging" in str(warning_of(FORMATS["MJPG"]))


@pytest.mark.parametrize("text", ["GREY", "Y12", "MJPG"])
def test_four_characters_and_back(text: str) -> None:
    assert fourcc_text(fourcc(text)) == text
    assert fourcc_text(fourcc(text) | 1 << 31) == text + "-BE"
