"""Lines out of bytes."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from acquire.protocols.line_buffer import LineBuffer


def test_lines_with_their_positions() -> None:
    buffer = LineBuffer(drop_first=False)
    assert [(line.data, line.start) for line in buffer.feed(b"ab\r\n\ncd\ref")] == [(b"ab", 0), (b"cd", 5)]
    assert [(line.data, line.start) for line in buffer.feed(b"g\n")] == [(b"efg", 8)]


def test_an_endless_line_comes_out_once_and_cut() -> None:
    buffer = LineBuffer(limit=8, drop_first=False)
    lines = [line for _ in range(100) for line in buffer.feed(b"123456789")]
    assert [(line.data, line.whole) for line in lines] == [(b"12345678", False)]
    assert [(line.data, line.start) for line in buffer.feed(b"\nab\n")] == [(b"ab", 901)]


def test_a_line_of_just_the_limit_is_whole() -> None:
    buffer = LineBuffer(limit=8, drop_first=False)
    assert [line.whole for line in buffer.feed(b"12345678\n")] == [True]


@given(st.binary(max_size=300), st.booleans())
def test_every_line_stands_where_it_says(data: bytes, drop: bool) -> None:
    buffer = LineBuffer(limit=32, drop_first=drop)
    lines = [line for i in range(0, len(data), 7) for line in buffer.feed(data[i : i + 7])]
    for line in lines:
        assert data[line.start : line.start + len(line.data)] == line.data
        assert not {10, 13} & set(line.data)
