"""Packed samples become the grey levels they are, bit for bit; the packing is that of the test, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.genicam.formats import FORMATS, decode, preferred, readable
from tests.genicam.packing import PACK, PIXEL_FORMATS, bits_of, picture


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("size", [(64, 48), (5, 1), (1, 1)])
def test_every_format_bit_for_bit(name: str, size: tuple[int, int]) -> None:
    width, height = size
    sent = picture(7, width, height, name)
    content = PACK[name](sent.reshape(-1))
    assert len(content) == FORMATS[name].size(width * height)
    image = decode(content, FORMATS[name], width, height)
    assert np.array_equal(image, sent)
    assert image.dtype == (np.uint8 if FORMATS[name].bits == 8 else np.uint16)
    assert not image.flags.writeable


@pytest.mark.parametrize("name", FORMATS)
def test_too_few_bytes_are_no_picture(name: str) -> None:
    content = PACK[name](picture(0, 8, 8, name).reshape(-1))
    with pytest.raises(DataError, match=f"{len(content) - 1} bytes instead of {len(content)}"):
        decode(content[:-1], FORMATS[name], 8, 8)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("width", [8, 5])
@pytest.mark.parametrize("last", [0, 7])
def test_rows_with_padding(name: str, width: int, last: int) -> None:
    """USB3 cameras may fill up their rows, or all but the last; each row begins with a byte of its own."""
    sent, padding = picture(3, width, 6, name), np.random.default_rng(0)
    content = b"".join(PACK[name](row) + padding.bytes(7) for row in sent)[: -7 + last or None]
    assert np.array_equal(decode(content, FORMATS[name], width, 6, 7), sent)
    with pytest.raises(DataError, match="bytes instead of"):
        decode(content[: len(content) - last - 1], FORMATS[name], width, 6, 7)


def test_codes_and_significant_bits_are_those_of_the_naming_convention() -> None:
    wanted = {name: (code, bits_of(name)) for name, code in PIXEL_FORMATS.items()}
    assert {name: (one.code, one.bits) for name, one in FORMATS.items()} == wanted
    assert all(one.size(16) == 2 * (one.code >> 16 & 0xFF) for one in FORMATS.values())


def test_twelve_bits_come_first_then_more_than_eight_and_eight_last() -> None:
    assert readable([*reversed(PIXEL_FORMATS), "BayerRG8"]) == [
        "Mono12p", "Mono12Packed", "Mono12", "Mono14", "Mono10p", "Mono10Packed", "Mono10", "Mono16", "Mono8",
    ]  # fmt: skip
    assert (
        preferred(["Mono8", "Mono12Packed", "Mono16"]) == "Mono12Packed" and preferred(["BayerRG8"]) is None
    )
