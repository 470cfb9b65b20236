"""Single wild pixels in a picture: hot and dead ones of the sensor, bits lost on the way.

A wild pixel lies far beyond all but one of its eight neighbours (two may touch), farther than the tops of the pattern
do, and than its neighbours lie apart. A speckle of radius 0.9 px or more has no such pixel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.float32]

OVER_PATTERN = 8.0
"""How often the usual height of a top (the pixel over its second neighbour) a wild pixel exceeds ..."""
OVER_NEIGHBOURS = 2.0
"""... and how often what its neighbours differ by, the highest and the lowest left out; a picture that has such ..."""
ALSO_PATTERN, ALSO_NEIGHBOURS = 4.0, 1.0
"""... has others, which show less on a bright or steep part of the pattern."""
SHARES = 1e-4, 0.03
"""Of all pixels: fewer do no harm (real pictures have 2e-5), more are the pattern."""
SAMPLE_ROWS = 48


def without_impulses(image: NDArray[Any]) -> NDArray[Any] | None:
    """The image with the median of their neighbours in place of wild pixels; None where it has none.

    Parameters
    ----------
    image : (H, W) uint8, uint16 or float32, GL
    """
    usual, share = _sampled(image)
    if share < SHARES[0] / 2:
        return None
    pixels = image.astype(np.float32)
    clearly = len(_beyond(pixels, OVER_PATTERN * usual, OVER_NEIGHBOURS)[0])
    if not SHARES[0] * image.size < clearly < SHARES[1] * image.size:
        return None
    rows, columns, neighbours = _beyond(pixels, ALSO_PATTERN * usual, ALSO_NEIGHBOURS)
    out = image.copy()
    middle = (neighbours[:, 3] + neighbours[:, 4]) / 2
    out[rows, columns] = np.rint(middle) if image.dtype.kind == "u" else middle
    out.flags.writeable = False  # as ``as_recorded`` gives it
    return out


def _beyond(
    pixels: Pixels, limit: float, over_neighbours: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], Pixels]:
    """Rows and columns of the pixels that lie beyond both limits, and their sorted neighbours (N, 8)."""
    inner = pixels[1:-1, 1:-1]
    mean = (pixels[:-2, 1:-1] + pixels[2:, 1:-1] + pixels[1:-1, :-2] + pixels[1:-1, 2:]) / 4
    # A wild pixel with a wild neighbour departs by three quarters of its height.
    rows, columns = np.nonzero(np.abs(inner - mean) > 0.7 * limit)
    neighbours, height = _above_second(pixels, rows, columns)
    wild = (height > limit) & (height > over_neighbours * (neighbours[:, 6] - neighbours[:, 1]))
    return rows[wild] + 1, columns[wild] + 1, neighbours[wild]


def _above_second(pixels: Pixels, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> tuple[Pixels, Pixels]:
    """The sorted neighbours of inner pixels (N, 8), and how far each lies beyond all but one of them (N,)."""
    around = [pixels[rows + i, columns + j] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    neighbours = np.sort(np.stack(around, axis=1), axis=1)
    centre = pixels[rows + 1, columns + 1]
    return neighbours, np.maximum(centre - neighbours[:, 6], neighbours[:, 1] - centre)


def _sampled(image: NDArray[Any]) -> tuple[float, float]:
    """In some rows: median height of the tops and bottoms of the pattern over their second neighbour, GL, and the
    share of wild pixels."""
    height = len(image)
    rows = np.arange(0, height - 2, 1 + height // SAMPLE_ROWS)
    three = [image[rows + i].astype(np.float32) for i in range(3)]
    width = image.shape[1] - 2
    around = [three[i][:, j : j + width] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    high, low = _second_highest(around), -_second_highest([-n for n in around])
    centre = three[1][:, 1:-1]
    above = np.maximum(centre - high, low - centre)
    tops = above[above > 0]
    if not len(tops):
        return 0.0, 0.0
    usual = float(np.median(tops))
    wild = (above > OVER_PATTERN * usual) & (above > OVER_NEIGHBOURS * (high - low))
    return usual, float(np.mean(wild))


def _second_highest(values: list[Pixels]) -> Pixels:
    """The second highest of several arrays of one shape, element by element."""
    highest, second = np.maximum(*values[:2]), np.minimum(*values[:2])
    for value in values[2:]:
        second = np.maximum(second, np.minimum(highest, value))
        highest = np.maximum(highest, value)
    return np.asarray(second)
