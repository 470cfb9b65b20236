"""Small pictures for the page: grey levels, saturated pixels, and the noise of ZOIs in colours."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from analysis.field import ZoiGrid

MAX_SIDE_PX = 960
"""Of a picture; larger ones are reduced."""

QUALITY = 80
RED = (40, 40, 255)  # blue, green, red

Bytes = NDArray[np.uint8]


def grey_levels(image: NDArray[Any], bits: int, max_side_px: int = MAX_SIDE_PX) -> tuple[Bytes, float]:
    """(h, w) uint8, and the scale: its px for one of ``image``."""
    height, width = image.shape
    scale = min(1.0, max_side_px / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    levels = np.asarray(image, np.float32)
    if scale < 1:
        cv2 = load_cv2()
        levels = cv2.resize(levels, size, interpolation=cv2.INTER_AREA)
    return np.clip(levels * (255 / (2**bits - 1)), 0, 255).astype(np.uint8), scale


def shrunk(image: NDArray[Any], bits: int, max_side_px: int = MAX_SIDE_PX) -> tuple[Bytes, float]:
    """Grey levels as (h, w, 3) uint8, to be painted on, and the scale of ``grey_levels``."""
    grey, scale = grey_levels(image, bits, max_side_px)
    return np.repeat(grey[..., None], 3, axis=2), scale


def mark_saturated(picture: Bytes, scale: float, image: NDArray[Any], saturation: int) -> None:
    """Paint pixels from ``saturation`` (GL) on red; a single one is visible in a reduced picture too."""
    rows, columns = np.nonzero(image >= saturation)
    if rows.size:
        height, width = picture.shape[:2]
        y = np.minimum((rows * scale).astype(np.intp), height - 1)
        x = np.minimum((columns * scale).astype(np.intp), width - 1)
        picture[y, x] = RED


def as_jpeg(picture: Bytes) -> bytes:
    """(h, w, 3), blue, green, red, or (h, w) grey levels, as the bytes of a file."""
    cv2 = load_cv2()
    _, content = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return bytes(content)


def as_png(picture: NDArray[Any]) -> bytes:
    """A picture as the bytes of a file, without loss."""
    _, content = load_cv2().imencode(".png", picture)
    return bytes(content)


def cells_png(cells: Bytes) -> bytes:
    """RGBA ``cells`` (R, C, 4), a pixel each, to lay over a picture; the page has size and opacity."""
    alpha = np.where(cells[..., 3:] > 0, 255, 0).astype(np.uint8)
    return as_png(np.concatenate([cells[..., 2::-1], alpha], axis=-1))


def cells_box(grid: ZoiGrid, moved: tuple[float, float]) -> list[float]:
    """Where the cells of ``grid``, moved by (x, y) px, lie: left, top, width, height, px from the picture's corner."""
    rows, columns = grid.shape
    starts = (
        float(start) - grid.step / 2 + 0.5 + (m if math.isfinite(m) else 0.0)
        for start, m in zip((grid.x[0], grid.y[0]), moved, strict=True)
    )
    return [*starts, columns * grid.step, rows * grid.step]


def traffic_light(values: NDArray[Any], good: float, bad: float) -> Bytes:
    """RGBA of ZOIs by their noise: green up to ``good``, yellow, red from ``bad`` and without a value."""
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip(np.log(values / good) / math.log(bad / good), 0, 1)
    share = np.where(np.isfinite(share), share, 1.0)[..., None]
    green, yellow, red = (np.array(c, float) for c in ((40, 170, 80), (240, 200, 30), (220, 50, 40)))
    rgb = np.where(
        share < 0.5, green + 2 * share * (yellow - green), yellow + (2 * share - 1) * (red - yellow)
    )
    return np.concatenate([rgb, np.full((*values.shape, 1), 110.0)], axis=-1).astype(np.uint8)
