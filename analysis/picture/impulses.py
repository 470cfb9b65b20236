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
"""... and how often what its neighbours differ by, the highest and the lowest left out."""
SHARES = 1e-4, 0.03
"""Of all pixels: fewer do no harm (real pictures have 2e-5), more are the pattern."""
SAMPLE_ROWS = 48


def without_impulses(image: NDArray[Any]) -> NDArray[Any] | None:
    """The image with the median of their neighbours in place of wild pixels; None where it has none.

    Parameters
    ----------
    image : (H, W) uint8, uint16 or float32, GL
    """
    pixels = image.astype(np.float32)
    limit = OVER_PATTERN * _usual_height(pixels)
    inner = pixels[1:-1, 1:-1]
    mean = (pixels[:-2, 1:-1] + pixels[2:, 1:-1] + pixels[1:-1, :-2] + pixels[1:-1, 2:]) / 4
    # A wild pixel with a wild neighbour departs by three quarters of its height.
    rows, columns = np.nonzero(np.abs(inner - mean) > 0.7 * limit)
    neighbours, height = _above_second(pixels, rows, columns)
    wild = (height > limit) & (height > OVER_NEIGHBOURS * (neighbours[:, 6] - neighbours[:, 1]))
    if not SHARES[0] * image.size < np.count_nonzero(wild) < SHARES[1] * image.size:
        return None
    out = image.copy()
    middle = (neighbours[wild, 3] + neighbours[wild, 4]) / 2
    out[rows[wild] + 1, columns[wild] + 1] = np.rint(middle) if image.dtype.kind == "u" else middle
    out.flags.writeable = False  # as ``as_recorded`` gives it
    return out


def _above_second(pixels: Pixels, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> tuple[Pixels, Pixels]:
    """The sorted neighbours of inner pixels (N, 8), and how far each lies beyond all but one of them (N,)."""
    around = [pixels[rows + i, columns + j] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    neighbours = np.sort(np.stack(around, axis=1), axis=1)
    centre = pixels[rows + 1, columns + 1]
    return neighbours, np.maximum(centre - neighbours[:, 6], neighbours[:, 1] - centre)


def _usual_height(pixels: Pixels) -> float:
    """Median height of the tops and bottoms of the pattern over their second neighbour, GL, in some rows."""
    height, width = pixels.shape
    grid = np.meshgrid(
        np.arange(0, height - 2, 1 + height // SAMPLE_ROWS), np.arange(width - 2), indexing="ij"
    )
    _, above = _above_second(pixels, grid[0].ravel(), grid[1].ravel())
    return float(np.median(above[above > 0])) if (above > 0).any() else 0.0
