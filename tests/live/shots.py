"""Folders of pictures of one pattern that moves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np

from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle


def write_shots(
    folder: Path, shape: tuple[int, int], places: Iterable[float | Affine], names: Sequence[str] = ()
) -> Path:
    """a0.png, a1.png, …, unless ``names`` are given; a number is a strain along y about the middle."""
    folder.mkdir(exist_ok=True)
    speckle = Speckle(shape, radius=2.0, seed=3)
    for k, place in enumerate(places):
        if not isinstance(place, Affine):
            place = Affine(dv_dy=place, x0=shape[1] / 2, y0=shape[0] / 2)
        picture = np.rint(255 * speckle.render(place, shape)).astype(np.uint8)
        assert cv2.imwrite(str(folder / (names[k] if names else f"a{k}.png")), picture)
    return folder
