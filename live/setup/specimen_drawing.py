"""A drawing of the set-up: picture, ruler, region, ZOIs coloured by their noise, gauges.

The ruler has the coordinates of the configuration, at any size of the drawing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from live.config.gauges import GaugeTable, complete_gauges
from live.setup.region import Region

if TYPE_CHECKING:
    from analysis import ZoiGrid

Colour = tuple[int, int, int]
Canvas = NDArray[np.uint8]

GOOD, FAIR, POOR = (80, 200, 60), (40, 200, 240), (60, 60, 230)  # BGR
EDGE, GAUGE, BACKGROUND, INK = (240, 190, 60), (255, 120, 255), (245, 245, 245), (30, 30, 30)
OUTSIDE = 0.45  # brightness of the picture outside the region
MAX_SIDE, MIN_SIDE = 1800, 500  # px of the longer side of the drawing
LEFT, TOP, BOTTOM = 64, 34, 34
FONT = 0.45
MAX_SQUARES = 40  # along the longer side of the grid


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """The overlay of a picture.

    Attributes
    ----------
    region : Region
    grid : ZoiGrid
    gauges : mapping of name to its table
    sigma : (R, C) or None
        Strain noise of each ZOI, NaN without pattern; None draws no ZOI.
    target : float
        Strain noise up to which a ZOI is good; up to twice that it is fair.
    px_per_mm : float or None
        For the ruler.
    """

    region: Region
    grid: ZoiGrid
    gauges: Mapping[str, GaugeTable] = field(default_factory=dict)
    sigma: NDArray[np.float64] | None = None
    target: float = 1e-3
    px_per_mm: float | None = None


def snapshot(picture: NDArray[Any], overlay: Overlay) -> Canvas:
    """``picture`` (H, W) with its overlay, (H', W', 3) uint8, BGR."""
    drawing = _Drawing.of(picture)
    drawing.region(overlay)
    if overlay.sigma is not None:
        drawing.quality(overlay, overlay.sigma)
    for gauge in complete_gauges(overlay.gauges):
        drawing.gauge(gauge.name, gauge.outline(overlay.grid.size))
    return drawing.framed(overlay)


class _Drawing:
    """A canvas with the picture on it; ``zoom`` px of the canvas are one px of the picture of ``shape`` (H, W)."""

    def __init__(self, canvas: Canvas, zoom: float, shape: tuple[int, ...]) -> None:
        self.canvas, self.zoom, self.shape, self.cv2 = canvas, zoom, shape, load_cv2()

    @classmethod
    def of(cls, picture: NDArray[Any]) -> _Drawing:
        cv2 = load_cv2()
        low, high = np.percentile(picture, (0.2, 99.8))
        grey = np.clip((picture - low) * (255 / max(float(high - low), 1e-6)), 0, 255).astype(np.uint8)
        longer = max(grey.shape)
        zoom = min(max(1.0, MIN_SIDE / longer), MAX_SIDE / longer)
        size = tuple(max(1, round(side * zoom)) for side in grey.shape[::-1])
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA if zoom < 1 else cv2.INTER_NEAREST)
        return cls(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), zoom, picture.shape)

    def at(self, x: float, y: float) -> tuple[int, int]:
        """A point of the picture in px of the canvas."""
        return round(x * self.zoom), round(y * self.zoom)

    def region(self, o: Overlay) -> None:
        """Darken the picture outside the region and draw its edge."""
        cv2, (height, width) = self.cv2, self.canvas.shape[:2]
        shape = o.region.mask.shape if o.region.mask is not None else self.shape
        inside = o.region.inside(shape[1], shape[0], o.grid.size).astype(np.uint8)
        inside = cv2.resize(inside, (width, height), interpolation=cv2.INTER_NEAREST)
        dark = (self.canvas * OUTSIDE).astype(np.uint8)
        self.canvas = np.where(inside[..., None] > 0, self.canvas, dark)
        edges, _ = cv2.findContours(inside, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(self.canvas, edges, -1, EDGE, 2)

    def quality(self, o: Overlay, sigma: NDArray[np.float64]) -> None:
        """A square at the centre of each ZOI in the colour of its noise; a cross without pattern."""
        every = max(1, math.ceil(max(o.grid.shape) / MAX_SQUARES))
        half = max(2, round(0.22 * o.grid.step * every * self.zoom))
        for row, column in np.argwhere(o.grid.subset(every=every).active):
            x, y = self.at(o.grid.x[column], o.grid.y[row])
            value = float(sigma[row, column])
            corners = (x - half, y - half), (x + half, y + half)
            if math.isfinite(value):
                colour = GOOD if value <= o.target else FAIR if value <= 2 * o.target else POOR
                self.cv2.rectangle(self.canvas, *corners, colour, -1)
            else:
                self.cv2.line(self.canvas, *corners, POOR, 2)
                self.cv2.line(self.canvas, (x - half, y + half), (x + half, y - half), POOR, 2)

    def gauge(self, name: str, outline: tuple[tuple[tuple[float, float], ...], ...]) -> None:
        """The outline of a gauge and its name."""
        for line in outline:
            points = np.array([self.at(*point) for point in line], np.int32)
            self.cv2.polylines(self.canvas, [points], False, GAUGE, 2, self.cv2.LINE_AA)
        left, low = self.at(*outline[0][0])
        self.text(name, left + 8, low - 6, GAUGE)

    def text(self, words: str, x: int, y: int, colour: Colour) -> None:
        """Text on a box, readable on any picture."""
        font = self.cv2.FONT_HERSHEY_SIMPLEX
        (width, height), base = self.cv2.getTextSize(words, font, FONT, 1)
        x = max(0, min(x, self.canvas.shape[1] - width))
        self.cv2.rectangle(self.canvas, (x - 2, y - height - 2), (x + width + 2, y + base), INK, -1)
        self.cv2.putText(self.canvas, words, (x, y), font, FONT, colour, 1, self.cv2.LINE_AA)

    def framed(self, o: Overlay) -> Canvas:
        """With a ruler at the left and the top, and the legend below."""
        height, width = self.canvas.shape[:2]
        page = np.full((height + TOP + BOTTOM, width + LEFT, 3), BACKGROUND, np.uint8)
        page[TOP : TOP + height, LEFT:] = self.canvas
        self.canvas = page
        unit = 1.0 if o.px_per_mm is None else o.px_per_mm
        self._label("px" if o.px_per_mm is None else "mm", 8, TOP - 10)
        for value, place in _ticks(width, self.zoom * unit):
            self.cv2.line(page, (LEFT + place, TOP - 6), (LEFT + place, TOP), INK, 1)
            self._label(value, LEFT + place + 3, TOP - 10)
        for value, place in _ticks(height, self.zoom * unit):
            self.cv2.line(page, (LEFT - 6, TOP + place), (LEFT, TOP + place), INK, 1)
            self._label(value, 8, TOP + place + 12)
        self._label(_legend(o), LEFT, TOP + height + 22)
        return page

    def _label(self, words: str, x: int, y: int) -> None:
        cv2 = self.cv2
        cv2.putText(self.canvas, words, (x, y), cv2.FONT_HERSHEY_SIMPLEX, FONT, INK, 1, cv2.LINE_AA)


def _ticks(length: int, zoom: float) -> Iterator[tuple[str, int]]:
    """Values and positions of the ruler, about every 100 px of the canvas."""
    rough = 100 / zoom
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(nice for nice in (1, 2, 5, 10) if nice * power >= rough * 0.999)
    for k in range(int(length / (step * zoom)) + 1):
        yield f"{k * step:g}", round(k * step * zoom)


def _legend(o: Overlay) -> str:
    if o.sigma is None:
        return f"{o.grid.n_active} ZOIs of {o.grid.size} px"
    known = o.sigma[o.grid.active]
    good = int((known <= o.target).sum())
    return (
        f"{good} of {known.size} ZOIs of {o.grid.size} px within {o.target * 1e6:.0f} µm/m (green);"
        " to twice that yellow, more red, cross: no pattern"
    )
