"""The grid that has the ZOIs of the specimen and of the plates beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.field import Block, Roi, ZoiGrid

Box = tuple[float, float, float, float]
MIN_ZOIS = 2
"""Rows and columns of ZOIs that a plate needs."""


@dataclass(frozen=True, slots=True, eq=False)
class PlateLayout:
    """One grid for the kernel, and its parts.

    Attributes
    ----------
    whole : ZoiGrid
    specimen : ZoiGrid
        That of the test.
    here : Block
        Of the specimen in ``whole``.
    plates : mapping of name to Block
    """

    whole: ZoiGrid
    specimen: ZoiGrid
    here: Block
    plates: Mapping[str, Block]

    @classmethod
    def of(cls, grid: ZoiGrid, boxes: Mapping[str, Box]) -> PlateLayout:
        """Of the grid of a test (``without_plates``) and the ``boxes`` (x, y, width, height, px) of the plates.

        Raises
        ------
        ValueError
            A plate is too small for ZOIs, or two of them overlap.
        """
        spans = {name: _span(name, grid, box) for name, box in boxes.items()}
        rows, columns = grid.shape
        top, left = (min(0, *(span[k][0] for span in spans.values())) for k in (0, 1))
        bottom, right = (
            max(size, *(span[k][1] for span in spans.values())) for k, size in ((0, rows), (1, columns))
        )
        roi = Roi(
            grid.roi.x + left * grid.step,
            grid.roi.y + top * grid.step,
            (right - left - 1) * grid.step + grid.size,
            (bottom - top - 1) * grid.step + grid.size,
        )
        blocks = {name: _block(span, top, left) for name, span in spans.items()}
        here = _block(((0, rows), (0, columns)), top, left)
        active = np.zeros((bottom - top, right - left), bool)
        active[here.at] = grid.active
        taken = np.zeros(active.shape, int)
        for block in blocks.values():
            active[block.at] = True
            taken[block.at] += 1
        if taken.max() > 1:
            raise ValueError("two plates overlap; move one")
        if not grid.active.any():
            raise ValueError("the plates cover the whole region to measure; move them beside it")
        return cls(ZoiGrid(roi, grid.size, grid.step, active), grid, here, blocks)


def _span(name: str, grid: ZoiGrid, box: Box) -> tuple[tuple[int, int], tuple[int, int]]:
    """First row and the row behind the last, and columns, of the lattice of ``grid`` wholly in ``box``."""
    x, y, width, height = box

    def along(start: float, side: float, origin: int) -> tuple[int, int]:
        first = math.ceil((start - origin) / grid.step)
        return first, math.floor((start + side - grid.size - origin) / grid.step) + 1

    rows, columns = along(y, height, grid.roi.y), along(x, width, grid.roi.x)
    if min(rows[1] - rows[0], columns[1] - columns[0]) < MIN_ZOIS:
        raise ValueError(
            f"plate {name} of {width:g} x {height:g} px has no room for {MIN_ZOIS} x {MIN_ZOIS} ZOIs of {grid.size} px,"
            f" {grid.step} px apart; make it larger"
        )
    return rows, columns


def _block(span: tuple[tuple[int, int], tuple[int, int]], top: int, left: int) -> Block:
    (first, last), (begin, end) = span
    return Block(slice(first - top, last - top), slice(begin - left, end - left))


def without_plates(grid: ZoiGrid, boxes: Mapping[str, Box]) -> ZoiGrid:
    """The same grid without the ZOIs that have a pixel on a plate."""
    touching = np.zeros(grid.shape, bool)
    for x, y, width, height in boxes.values():
        columns = (grid.first_x + grid.size > x) & (grid.first_x < x + width)
        rows = (grid.first_y + grid.size > y) & (grid.first_y < y + height)
        touching |= rows[:, None] & columns
    return grid.subset(active=~touching)
