"""The quantisation of a JPEG by its own tables (ITU-T T.81, B.2.4.1); no pixel is decoded."""

from __future__ import annotations

_TABLES, _SCAN, _START = 0xDB, 0xDA, b"\xff\xd8\xff"
_FRAMES = {0xC0, 0xC1, 0xC2}
_ZIGZAG = sorted(
    ((row, column) for row in range(8) for column in range(8)),
    key=lambda at: (sum(at), at[0] if sum(at) % 2 else at[1]),
)


def quantisation(content: bytes) -> tuple[int, ...] | None:
    """Steps of the coefficients of the first component, luminance, of the first JPEG in ``content``.

    Returns
    -------
    64 ints, GL
        Row by row, of blocks of 8 x 8 px, the vertical frequency rising from row to row; None where there is no table.
    """
    at, tables, chosen = content.find(_START) + 2, dict[int, tuple[int, ...]](), 0
    while at >= 2 and at + 4 <= len(content) and content[at] == 0xFF and content[at + 1] != _SCAN:
        end = at + 2 + int.from_bytes(content[at + 2 : at + 4])
        part = content[at + 4 : end]
        if content[at + 1] == _TABLES:
            tables |= _read_tables(part)
        elif content[at + 1] in _FRAMES and len(part) > 8:
            chosen = part[8]
        at = end
    return tables.get(chosen)


def _read_tables(part: bytes) -> dict[int, tuple[int, ...]]:
    found = {}
    while part:
        bytes_each, number = 1 + (part[0] >> 4), part[0] & 15
        size = 1 + 64 * bytes_each
        if len(part) < size:
            break
        steps = [int.from_bytes(part[k : k + bytes_each]) for k in range(1, size, bytes_each)]
        placed = dict(zip(_ZIGZAG, steps, strict=True))
        found[number] = tuple(placed[row, column] for row in range(8) for column in range(8))
        part = part[size:]
    return found
