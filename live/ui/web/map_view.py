"""The map over the picture of a running test: its range, its histogram, and the value at a place.

The page's other small pictures are made here too: grey levels, saturated pixels, and the noise of ZOIs in colours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import encoded, load_cv2
from acquire.text import Message
from analysis.field import Status, ZoiGrid
from live.config.gauges import complete_gauges, gauge_colours
from live.config.loading import Config
from live.pipeline.measurement import Measurement
from live.pipeline.timed.course import shown_names
from live.results.maps.colours import MICROSTRAIN, PERCENT
from live.results.maps.painting import FIELD_MAPS, NO_MAPS, FieldMaps, Floats, Painted, overlay_cells
from live.results.maps.scale import ColourScale

MAX_SIDE_PX = 960
"""Of a picture; larger ones are reduced."""

QUALITY = 80
RED = (40, 40, 255)  # blue, green, red

Bytes = NDArray[np.uint8]

RANGES = ("automatic", "symmetric", "fixed")
BARS = 24
"""Of the histogram, over the range of the colours."""
_RAMP = 11  # colours of the bar, between which the page shades
OUTSIDE = Message("no ZOI is here")


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
    return encoded(".jpg", picture, QUALITY)


def as_png(picture: NDArray[Any]) -> bytes:
    """A picture as the bytes of a file, without loss."""
    return encoded(".png", picture)


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


@dataclass(frozen=True, slots=True)
class MapChoice:
    """Which map is shown, and how its colours are spread.

    Attributes
    ----------
    name : str
        One of ``map_choices``.
    span : "automatic", "symmetric" or "fixed"
        Over the values, symmetric about zero, or from ``-limit`` to ``limit`` (strains only).
    limit : float or None
    """

    name: str
    span: str
    limit: float | None = None


class MapView:
    """Paints the map of one measurement after the other.

    Parameters
    ----------
    config : Config

    Attributes
    ----------
    choice : MapChoice
    response : callable
        Gives the response of the places so far.
    """

    def __init__(self, config: Config) -> None:
        self._config, self._axis = config, config.specimen.first_axis
        self.response: Callable[[], Mapping[str, Floats]] = dict
        limit = config.view.strain_range
        self._painted: tuple[Measurement, Painted] | None = None
        self._take(MapChoice(f"e{self._axis * 2}", "automatic" if limit is None else "fixed", limit))

    def _take(self, choice: MapChoice) -> None:
        self.choice = choice
        limit = choice.limit if choice.span == "fixed" else None
        self._maps = FieldMaps(self._axis, limit, is_symmetric=choice.span == "symmetric")

    def choose(self, name: object, span: object, limit: object) -> str:
        """Show another map, or another range; the reason of a refusal, or empty."""
        known = map_choices(self._config)
        if name not in known:
            return Message(
                "there is no map {given}; there are {listed}", repr(str(name)[:40]), ", ".join(known)
            )
        if span not in RANGES:
            return Message("the ranges of a map are {listed}", ", ".join(RANGES))
        given = isinstance(limit, int | float) and not isinstance(limit, bool)
        if span == "fixed" and not (given and 1e-7 <= limit <= 10):  # type: ignore[operator]
            return Message("a fixed range is a strain from 1e-7 to 10")
        self._take(MapChoice(str(name), str(span), float(limit) if given else None))  # type: ignore[arg-type]
        return ""

    def draw(self, m: Measurement, whole: str = "") -> tuple[bytes, dict[str, Any]]:
        """The picture of ``m`` with its map, or one of the ``whole`` test, as JPEG, and its scale for the page."""
        picture, zoom = shrunk(m.burst.mean, m.burst.bits)
        painted, shown = self._drawn(m, MapChoice(whole, "automatic") if whole else self.choice)
        overlay_cells(picture, zoom, m.field.grid, painted.rgba, (m.time_step.u, m.time_step.v))
        return as_jpeg(picture), shown

    def layers(self, m: Measurement) -> tuple[bytes, bytes, dict[str, Any]]:
        """The picture of ``m`` as JPEG, its map as PNG to lay over it, and its scale as the page shows it."""
        grey, _ = grey_levels(m.burst.mean, m.burst.bits)
        painted, shown = self._drawn(m, self.choice)  # another may be chosen meanwhile
        place = cells_box(m.field.grid, (m.time_step.u, m.time_step.v))
        return as_jpeg(grey), cells_png(painted.rgba), shown | {"cells": place}

    def _drawn(self, m: Measurement, choice: MapChoice) -> tuple[Painted, dict[str, Any]]:
        more = NO_MAPS if choice.name in FIELD_MAPS else self.response()
        painted = self._maps.paint(m.field, (choice.name,), more)[choice.name]
        self._painted = m, painted
        height, width = m.burst.mean.shape
        shown = {"of": choice.name, "range": choice.span, "width": width, "height": height}
        shapes = gauge_shapes(self._config) | plate_shapes(self._config)
        return painted, shown | _scale_of(painted) | {"gauges": shapes}

    def value_at(self, x: float, y: float) -> dict[str, Any]:
        """Value, sigma and status of the ZOI that is shown at a place of the picture, px."""
        if self._painted is None:
            return {"value": None, "status": OUTSIDE}
        m, painted = self._painted
        grid, moved = m.field.grid, np.nan_to_num([m.time_step.u, m.time_step.v])
        column, row = (
            int(np.argmin(np.abs(c - p))) for c, p in ((grid.x, x - moved[0]), (grid.y, y - moved[1]))
        )
        far = max(abs(grid.x[column] - x + moved[0]), abs(grid.y[row] - y + moved[1]))
        if far > grid.step / 2 or not grid.active[row, column]:
            return {"value": None, "status": OUTSIDE}
        status = Status(int(m.field.status[row, column]))
        if painted.values is None or not np.isfinite(painted.values[row, column]):
            return {"value": None, "status": status.text}
        one = _factor(painted.scale)
        sigma = None if painted.sigmas is None else float(painted.sigmas[row, column]) * one
        return {"value": float(painted.values[row, column]) * one, "sigma": sigma, "status": status.text}


def _scale_of(painted: Painted) -> dict[str, Any]:
    """The colours of a map: from low to high, ends, unit and histogram, strains without unit; or the legend."""
    scale, values = painted.scale, painted.values
    if scale is None or values is None:
        legend = [{"text": one.text, "count": one.count, "colour": f"rgb{one.rgb}"} for one in painted.legend]
        return {"legend": legend}
    strain, one = _is_strain(scale), _factor(scale)
    low, high = scale.low / scale.factor * one, scale.high / scale.factor * one
    counts, _ = np.histogram(values[np.isfinite(values)] * one, BARS, (low, high))
    unit = "" if strain else scale.unit
    ramp = [f"#{bytes(row).hex()}" for row in scale.ramp(_RAMP)]
    colours = {"ramp": ramp, "diverging": scale.is_diverging}
    return {"low": low, "high": high, "strain": strain, "unit": unit, "histogram": counts.tolist()} | colours


def _is_strain(scale: ColourScale) -> bool:
    return scale.unit in (MICROSTRAIN.name, PERCENT.name)


def _factor(scale: ColourScale | None) -> float:
    """From the values of a map to those that the page gets: strains as they are, others in their unit."""
    return 1.0 if scale is None or _is_strain(scale) else scale.factor


def map_choices(config: Config) -> tuple[str, ...]:
    """Names of the maps that a test can show while it goes on."""
    return (*FIELD_MAPS, *shown_names(config.output.response))


def plate_shapes(config: Config) -> dict[str, Any]:
    """The plates of a configuration as the page draws them beside the gauges: boxes without handles to drag, px."""
    found = {}
    for name, plate in config.plate.items():
        assert plate.box is not None
        x, y, w, h = plate.box
        corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h), (x, y)]
        found[f"plate {name}"] = {"kind": "plate", "handles": [(x, y)], "outline": [corners]}
    return found


def gauge_shapes(config: Config) -> dict[str, Any]:
    """The gauges of a configuration as the page draws them: kind, index of the colour, handles and lines, px."""
    colours = gauge_colours(config.gauges)
    found = complete_gauges(config.gauges, config.specimen.first_axis)
    zoi = config.measure.zoi
    return {
        one.name: {
            "kind": one.kind,
            "colour": colours[one.name],
            "handles": one.handles(),
            "outline": [[(round(x, 1), round(y, 1)) for x, y in line] for line in one.outline(zoi)],
        }
        for one in found
    }
