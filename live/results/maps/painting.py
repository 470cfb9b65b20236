"""Maps painted over pictures by OpenCV: each ZOI at its place at that instant, with title, colour bar or legend.

During a test and after it the same maps are painted: strains, principal strains, displacements, sigma, status.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import drawn_letters, load_cv2
from acquire.text import Message
from analysis.field import StrainField, ZoiGrid
from live.results.maps.colours import ticks
from live.results.maps.scale import (
    OPACITY,
    AutoRange,
    ColourScale,
    Kind,
    StatusCount,
    range_kind,
    status_colours,
    status_legend,
)
from live.results.reader import Strain

Floats = NDArray[np.floating]
NO_MAPS: Mapping[str, Floats] = MappingProxyType({})
_PRINCIPAL = ("e1", "e2")
_STRAINS = ("exx", "eyy", "exy", *_PRINCIPAL)
FIELD_MAPS = (*_STRAINS, "u", "v", "sigma", "residual", "status")
"""e1 and e2 are the principal strains, sigma is that of the strain along the load, residual is chi squared."""

Image = NDArray[np.uint8]
_SUB = 4  # bits of subpixel places in OpenCV's polygons
_LONGEST, _SHORTEST = 1280, 560  # of a painted picture's longer side, px
_PAPER, _INK, _LINE, _PLAIN = 255, (40, 35, 30), (120, 115, 110), 150
_MIN_WIDTH, _MIN_HEIGHT = 480, 240
_MARGIN, _TITLE, _BAR, _TICK = 14, 28, 18, 5  # px: around, a line of the title, the bar, a tick
_AXIS = 66, 48  # px for ticks and labels, on the left and below


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """A map in colours.

    Attributes
    ----------
    rgba : (R, C, 4) uint8
    scale : ColourScale or None
        None for the map of statuses.
    legend : tuple of StatusCount
        Of the map of statuses.
    values, sigmas : (R, C) float or None
        None for the map of statuses; no sigma of those that have none.
    """

    rgba: NDArray[np.uint8]
    scale: ColourScale | None
    legend: tuple[StatusCount, ...] = ()
    values: Floats | None = None
    sigmas: Floats | None = None


class FieldMaps:
    """Paints the maps of one field after the other; ranges follow the data and do not flicker.

    Parameters
    ----------
    axis : "x" or "y"
        Of the load.
    fixed : float or None
        Range of the strains, -fixed to fixed.
    is_symmetric : bool
        Ranges are about zero where there are two signs; else over the values.
    alpha : int
        Opacity, 0..255.
    """

    def __init__(
        self,
        axis: Literal["x", "y"],
        fixed: float | None = None,
        *,
        is_symmetric: bool = False,
        alpha: int = OPACITY,
    ) -> None:
        self._along, self._alpha = f"e{axis * 2}", alpha
        self._fixed, self._is_symmetric = fixed, is_symmetric
        self._ranges: dict[str, AutoRange] = {}

    def _range(self, name: str) -> AutoRange:
        kind: Kind = range_kind(name)
        if kind == "free" and self._is_symmetric:
            kind = "about zero"
        return AutoRange(kind, self._fixed if name in _STRAINS else None)

    def paint(
        self, field: StrainField, names: Iterable[str], more: Mapping[str, Floats] = NO_MAPS
    ) -> dict[str, Painted]:
        """The named maps, of ``FIELD_MAPS`` or of ``more``, which has them with their ``sigma_``."""
        wanted = tuple(names)
        principal = field.strain(field.measure).principal[:2] if set(wanted) & {*_PRINCIPAL} else ()
        known = dict(zip(_PRINCIPAL, principal, strict=False)) | dict(more)
        nothing = {name: np.full(field.grid.shape, np.nan) for name in {*wanted} - {*FIELD_MAPS, *more}}
        known |= nothing  # yet
        return {
            name: self._painted(field, name, known.get(name), known.get(f"sigma_{name}")) for name in wanted
        }

    def _painted(
        self, field: StrainField, name: str, values: Floats | None, sigmas: Floats | None = None
    ) -> Painted:
        if name == "status":
            return Painted(status_colours(field.status, self._alpha), None, status_legend(field.status))
        own = sigmas
        if name == "residual":
            values = np.where(field.ok, field.residual, np.nan)
        elif name == "sigma":
            values = field.sigma(self._along)
        elif values is None:
            values, own = field.value(name), field.sigma(name)
        noise = field.sigma(self._along) if name in _PRINCIPAL else own
        span = self._ranges.setdefault(name, self._range(name)).update(values, noise)
        scale = ColourScale.of(name, span)
        return Painted(scale.colours(values, self._alpha), scale, values=values, sigmas=own)


@dataclass(frozen=True, slots=True)
class Levels:
    """Grey levels that are shown as black and white."""

    black: float
    white: float

    @classmethod
    def of(cls, picture: NDArray[Any]) -> Levels:
        """All but the darkest and brightest half percent of a picture."""
        sample = picture[:: max(1, picture.shape[0] // 256), :: max(1, picture.shape[1] // 256)]
        black, white = (float(v) for v in np.percentile(sample, (0.5, 99.5)))
        return cls(black, max(white, black + 1.0))

    def shown(self, picture: NDArray[Any]) -> Image:
        """(H, W) uint8."""
        scaled = (picture.astype(np.float32) - self.black) * (255.0 / (self.white - self.black))
        return np.asarray(np.clip(np.rint(scaled), 0, 255), np.uint8)


def overlay_cells(
    picture: Image, zoom: float, grid: ZoiGrid, cells: Image, moved: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Paint RGBA ``cells`` (R, C, 4) of ``grid`` over a BGR ``picture``, in place, all moved by (x, y) px.

    For pictures during a test: a hundred times faster than ``overlay_quads``.
    """
    half = grid.step / 2
    across, down = (m if math.isfinite(m) else 0.0 for m in moved)
    left, right = (round((x + across) * zoom) for x in (grid.x[0] - half, grid.x[-1] + half))
    top, bottom = (round((y + down) * zoom) for y in (grid.y[0] - half, grid.y[-1] + half))
    height, width = picture.shape[:2]
    rows, columns = slice(max(top, 0), min(bottom, height)), slice(max(left, 0), min(right, width))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return  # outside the picture
    cv2 = load_cv2()
    large = cv2.resize(cells, (right - left, bottom - top), interpolation=cv2.INTER_NEAREST)
    part = large[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
    picture[rows, columns] = _mixed(picture[rows, columns], part[..., 2::-1], part[..., 3:])


def overlay_quads(picture: Image, cells: Image, corners: NDArray[np.float64]) -> Image:
    """RGBA ``cells`` (R, C, 4) over a BGR ``picture``, a new image; ``corners`` (R, C, 4, 2) in px of it."""
    cv2 = load_cv2()
    painted, alpha = picture.copy(), np.zeros(picture.shape[:2], np.uint8)
    shown = (cells[..., 3] > 0) & np.isfinite(corners).all((-1, -2))
    places = np.rint(np.where(shown[..., None, None], corners, 0) * 2**_SUB).astype(np.int32)
    for r, c in zip(*np.nonzero(shown), strict=True):
        red, green, blue, opacity = cells[r, c].tolist()
        cv2.fillConvexPoly(painted, places[r, c], (blue, green, red), cv2.LINE_8, _SUB)
        cv2.fillConvexPoly(alpha, places[r, c], opacity, cv2.LINE_8, _SUB)
    return _mixed(picture, painted, alpha[..., None])


def _mixed(under: Image, over: Image, alpha: Image) -> Image:
    share = alpha.astype(np.float32) / 255
    return np.asarray(under * (1 - share) + over * share, np.uint8)


class Painter:
    """Paints the maps of one name over pictures of one size.

    Parameters
    ----------
    strain : Strain
    name : str
    scale : ColourScale or None
        None for the map of statuses.
    size : (width, height), px
        Of the pictures.
    longest : int, px
        Largest side of the painted image.
    """

    def __init__(
        self,
        strain: Strain,
        name: str,
        scale: ColourScale | None,
        size: tuple[int, int],
        longest: int = _LONGEST,
    ) -> None:
        self._strain, self._name, self._scale = strain, name, scale
        bigger = max(size)
        self._zoom = min(longest / bigger, max(1.0, min(_SHORTEST, longest) / bigger))
        self._of = size
        self.size = tuple(2 * max(1, round(side * self._zoom / 2)) for side in size)

    def picture(self, picture: NDArray[Any] | None, levels: Levels | None = None) -> Image:
        """The picture alone, (h, w, 3) BGR; plain grey where there is none."""
        cv2 = load_cv2()
        if picture is None:
            return np.full((self.size[1], self.size[0], 3), _PLAIN, np.uint8)
        grey = (levels or Levels.of(picture)).shown(picture)
        how = cv2.INTER_AREA if self._zoom < 1 else cv2.INTER_CUBIC
        sized: Image = cv2.cvtColor(cv2.resize(grey, self.size, interpolation=how), cv2.COLOR_GRAY2BGR)
        return sized

    def over(self, base: Image, row: int, values: NDArray[Any] | None = None, *, moved: bool = True) -> Image:
        """The map of an instant over the picture ``base``, a new image.

        Parameters
        ----------
        base : (h, w, 3) uint8
        row : int
        values : (R, C), optional
            In place of those of the file.
        moved : bool
            Each ZOI where it is at the instant, in its own shape; else where it is on the reference.
        """
        values = self._strain.maps(self._name, row) if values is None else values
        cells = status_colours(values) if self._scale is None else self._scale.colours(values)
        return overlay_quads(base, cells, self._corners(row if moved else None))

    def framed(self, image: Image, title: Sequence[str], row: int, *, axes: bool = False) -> Image:
        """The image with a title above, the colour bar or the legend on the right, and px along the edges."""
        legend = status_legend(self._strain.maps(self._name, row)) if self._scale is None else ()
        h, w = image.shape[:2]
        left, below = (_AXIS[0], _AXIS[1]) if axes else (_MARGIN, _MARGIN)
        top = _MARGIN + _TITLE * len(title)
        beside = 110 if self._scale is not None else 230
        wide = _even(max(left + w + beside + 2 * _MARGIN, _MIN_WIDTH))
        high = _even(max(top + h + below, _MIN_HEIGHT))
        full = np.full((high, wide, 3), _PAPER, np.uint8)
        full[top : top + h, left : left + w] = image
        for k, words in enumerate(title):
            _write(full, words, (_MARGIN, _TITLE * (k + 1)), 0.6 if k == 0 else 0.5, wide - 2 * _MARGIN)
        right = left + w + _MARGIN
        if axes:
            _edges(full, (left, top, w, h), self._of)
        if self._scale is not None:
            _bar(full, (right, top + 26, max(top + h, high - below) - 8), self._name, self._scale)
        _legend(full, (right, top), legend)
        return full

    def _corners(self, row: int | None) -> NDArray[np.float64]:
        """Corners of every ZOI's cell, (R, C, 4, 2), px of the painted picture: at an instant, or on the reference."""
        grid, names = self._strain.grid, ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")
        if row is None:
            at = {name: np.zeros((*grid.shape, 1)) for name in names}
        else:
            at = {name: _filled(self._strain.maps(name, row)) for name in names}
        dx = np.array([-0.5, 0.5, 0.5, -0.5]) * grid.step
        dy = np.array([-0.5, -0.5, 0.5, 0.5]) * grid.step
        x = (grid.x + at["u"][..., 0])[..., None] + dx + at["du_dx"] * dx + at["du_dy"] * dy
        y = (grid.y[:, None] + at["v"][..., 0])[..., None] + dy + at["dv_dx"] * dx + at["dv_dy"] * dy
        return (np.stack([x, y], axis=-1) + 0.5) * self._zoom - 0.5


def caption(strain: Strain, row: int) -> str:
    """Time and force of an instant."""
    force = float(strain.values["force_N"][row])
    t = Message("t = {t:.3f} s", float(strain.time_s[row]))
    return t if math.isnan(force) else t + Message("   F = {force:.1f} N", force)


def _filled(values: NDArray[Any]) -> NDArray[np.float64]:
    """With a last axis; ZOIs without a value stay in place (the map of statuses shows them)."""
    return np.where(np.isfinite(values), values, 0.0).astype(np.float64)[..., None]


def _even(side: int) -> int:
    """The next even number: encoders of films need even sides."""
    return side + side % 2


def _bar(full: Image, place: tuple[int, int, int], name: str, scale: ColourScale) -> None:
    """The colour bar with ticks and unit, mixed with grey like a map with its picture."""
    cv2 = load_cv2()
    left, top, bottom = place
    colours = np.repeat(scale.ramp(bottom - top)[::-1, None, ::-1], _BAR, axis=1)
    alpha = np.full((*colours.shape[:2], 1), OPACITY, np.uint8)
    full[top:bottom, left : left + _BAR] = _mixed(np.full_like(colours, _PLAIN), colours, alpha)
    if scale.is_diverging:
        cv2.line(full, (left, (top + bottom) // 2), (left + _BAR, (top + bottom) // 2), _INK, 2)
    cv2.rectangle(full, (left, top), (left + _BAR, bottom), _LINE, 1)
    for value in ticks(scale.low, scale.high, about=max(3, min(7, (bottom - top) // 60))):
        y = round(bottom - (value - scale.low) / (scale.high - scale.low) * (bottom - top))
        cv2.line(full, (left + _BAR, y), (left + _BAR + _TICK, y), _LINE, 1)
        _write(full, scale.mark(value), (left + _BAR + _TICK + 5, y + 5), 0.45)
    label = f"{name}, {scale.unit}" if scale.unit else name
    _write(full, label, (left, top - 11), 0.5, full.shape[1] - left - 4)


def _legend(full: Image, place: tuple[int, int], legend: Sequence[StatusCount]) -> None:
    cv2 = load_cv2()
    for k, one in enumerate(legend):
        x, y = place[0], place[1] + 24 * k
        colour = np.asarray(one.rgb[::-1], np.uint8).reshape(1, 1, 3)
        mixed = _mixed(np.full_like(colour, _PLAIN), colour, np.full((1, 1, 1), OPACITY, np.uint8))
        cv2.rectangle(full, (x, y), (x + 16, y + 16), mixed[0, 0].tolist(), cv2.FILLED)
        cv2.rectangle(full, (x, y), (x + 16, y + 16), _LINE, 1)
        _write(full, f"{one.name} ({one.count})", (x + 25, y + 13), 0.45)


def _edges(full: Image, box: tuple[int, int, int, int], size: tuple[int, int]) -> None:
    """Px of the camera's picture along the left and lower edge of ``box``: left, top, width, height."""
    cv2 = load_cv2()
    left, top, width, height = box
    bottom = top + height
    cv2.rectangle(full, (left - 1, top - 1), (left + width, bottom), _LINE, 1)
    for value in ticks(0, size[0] - 1, about=max(2, min(7, width // 90))):
        x = left + round((value + 0.5) / size[0] * width)
        cv2.line(full, (x, bottom), (x, bottom + _TICK), _LINE, 1)
        _write(full, f"{value:g}", (x - 4 * len(f"{value:g}"), bottom + _TICK + 14), 0.42)
    for value in ticks(0, size[1] - 1, about=max(2, min(7, height // 60))):
        y = top + round((value + 0.5) / size[1] * height)
        cv2.line(full, (left - _TICK, y), (left, y), _LINE, 1)
        _write(full, f"{value:g}", (left - _TICK - 6 - 8 * len(f"{value:g}"), y + 5), 0.42)
    _write(full, "x, y: px; no colour: no value", (left, bottom + _TICK + 32), 0.42)


def _write(
    full: Image, words: str, origin: tuple[int, int], size: float, max_width: int | None = None
) -> None:
    """Text from ``origin`` on its base line; smaller where it is wider than ``max_width``."""
    cv2 = load_cv2()
    text, font = drawn_letters(words), cv2.FONT_HERSHEY_SIMPLEX
    (wide, _), _ = cv2.getTextSize(text, font, size, 1)
    if max_width is not None and wide > max_width:
        size *= max_width / wide
    cv2.putText(full, text, origin, font, size, _INK, 1, cv2.LINE_AA)
