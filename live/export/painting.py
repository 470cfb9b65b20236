"""Maps painted over the picture of their own instant: every ZOI where it is by then, in its own shape.

OpenCV draws (no matplotlib): the texts of a picture are plain ASCII.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from analysis.field import Status
from live.finished import Display, quantity_of
from live.maps import STATUS_COLOURS, colour, nice_above, ramp, ticks, unit_for
from live.results import Strain

Image = NDArray[np.uint8]
ALPHA = 0.72
_SAMPLE = 25  # instants that a range is taken from
_SUB = 4  # bits of subpixel places in OpenCV's polygons
_BAR, _CAPTION, _INK = 118, 34, (235, 235, 235)
_LONGEST, _SHORTEST = 1280, 560  # of a painted picture's longer side, px


@dataclass(frozen=True, slots=True)
class Scale:
    """What the colours of a map stand for.

    Attributes
    ----------
    low, high : float
        Ends of the colours, in ``unit``.
    unit : str
    factor : float
        From the exported value (``Display.shown``) to ``unit``.
    """

    low: float
    high: float
    unit: str
    factor: float

    @classmethod
    def of(
        cls, strain: Strain, name: str, rows: Sequence[int], display: Display, limit: float | None = None
    ) -> Scale:
        """Zero in the middle for strains, one end at zero for uncertainties, what occurs for displacements.

        ``limit`` is that of the stored values.
        """
        picked = [rows[k] for k in np.unique(np.linspace(0, len(rows) - 1, _SAMPLE).astype(int))]
        values = np.concatenate([display.shown(name, strain.maps(name, row)).ravel() for row in picked])
        values = values[np.isfinite(values)].astype(np.float64)
        if not values.size:
            values = np.zeros(1)
        factor, unit = 1.0, display.unit(name)
        if quantity_of(name).is_strain:
            percent = 100.0 if display.percent else 1.0
            largest = limit or float(np.percentile(np.abs(values), 98)) / percent
            shown = unit_for(0.02 if display.percent else largest)
            factor, unit = shown.factor / percent, shown.name
        if limit is not None:
            end = abs(float(display.shown(name, np.array(limit)))) * factor
            return cls(-end, end, unit, factor)
        if name.startswith("sigma_") or name == "residual":
            return cls(0.0, nice_above(max(float(np.percentile(values, 98)) * factor, 1e-12)), unit, factor)
        if quantity_of(name).is_strain:
            end = nice_above(max(float(np.percentile(np.abs(values), 98)) * factor, 1e-12))
            return cls(-end, end, unit, factor)
        low, high = float(np.percentile(values, 1)) * factor, float(np.percentile(values, 99)) * factor
        return cls(low, high if high > low else low + 1.0, unit, factor)

    def colours(self, shown: NDArray[Any]) -> Image:
        """(R, C, 4) RGBA of exported values; transparent where there is none."""
        middle = (self.low + self.high) / 2
        return colour(shown * self.factor - middle, (self.high - self.low) / 2)


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


class Painter:
    """Paints the maps of one name over pictures of one size.

    Parameters
    ----------
    strain : Strain
    name : str
    display : Display
    scale : Scale or None
        None for the map of statuses.
    size : (width, height), px
        Of the pictures.
    longest : int, px
        Of what is painted, at most.
    """

    def __init__(
        self,
        strain: Strain,
        name: str,
        display: Display,
        scale: Scale | None,
        size: tuple[int, int],
        longest: int = _LONGEST,
    ) -> None:
        self._strain, self._name, self._display, self._scale = strain, name, display, scale
        bigger = max(size)
        self._zoom = min(longest / bigger, max(1.0, min(_SHORTEST, longest) / bigger))
        self.size = tuple(2 * max(1, round(side * self._zoom / 2)) for side in size)

    def picture(self, picture: NDArray[Any] | None, levels: Levels | None) -> Image:
        """The picture alone, (h, w, 3) BGR; plain grey where there is none."""
        cv2 = load_cv2()
        if picture is None:
            return np.full((self.size[1], self.size[0], 3), 60, np.uint8)
        grey = (levels or Levels.of(picture)).shown(picture)
        how = cv2.INTER_AREA if self._zoom < 1 else cv2.INTER_CUBIC
        sized: Image = cv2.cvtColor(cv2.resize(grey, self.size, interpolation=how), cv2.COLOR_GRAY2BGR)
        return sized

    def over(self, base: Image, row: int) -> Image:
        """The map of an instant over the picture ``base``, a new image."""
        cv2 = load_cv2()
        colours = self._colours(row)
        painted, covered = base.copy(), np.zeros(base.shape[:2], np.uint8)
        corners = np.rint(self._corners(row) * 2**_SUB).astype(np.int32)
        shown = (colours[..., 3] > 0) & np.isfinite(self._corners(row)).all((-1, -2))
        for r, c in zip(*np.nonzero(shown), strict=True):
            blue_green_red = tuple(int(v) for v in colours[r, c, 2::-1])
            cv2.fillConvexPoly(painted, corners[r, c], blue_green_red, cv2.LINE_8, _SUB)
            cv2.fillConvexPoly(covered, corners[r, c], 255, cv2.LINE_8, _SUB)
        mixed = cv2.addWeighted(painted, ALPHA, base, 1 - ALPHA, 0)
        return np.where(covered[..., None] > 0, mixed, base)

    def framed(self, image: Image, words: str) -> Image:
        """With a colour bar on the right and a line of words below."""
        h, w = image.shape[:2]
        full = np.full((h + _CAPTION, w + _BAR, 3), 24, np.uint8)
        full[:h, :w] = image
        if self._scale is not None:
            self._bar(full, w + 14, h)
        _write(full, words, (10, h + 23), 0.5)
        return full

    def _bar(self, full: Image, left: int, height: int) -> None:
        scale = self._scale
        assert scale is not None
        top, bottom = 30, height - 16
        full[top:bottom, left : left + 18] = ramp(bottom - top, 18)[..., ::-1]
        for value in ticks(scale.low, scale.high):
            y = round(bottom - 1 - (value - scale.low) / (scale.high - scale.low) * (bottom - 1 - top))
            full[y, left + 18 : left + 24] = _INK
            _write(full, f"{value:g}", (left + 28, y + 4), 0.42)
        _write(full, f"{self._name}, {plain(scale.unit)}" if scale.unit else self._name, (left - 6, 18), 0.45)

    def _colours(self, row: int) -> Image:
        values = self._strain.maps(self._name, row)
        if self._scale is None:
            return status_table()[np.clip(values.astype(np.intp), 0, len(Status))]
        return self._scale.colours(self._display.shown(self._name, values))

    def _corners(self, row: int) -> NDArray[np.float64]:
        """Corners of every ZOI's cell where they are at the instant, (R, C, 4, 2), px of the painted picture."""
        strain, grid = self._strain, self._strain.grid
        moved = {
            name: _filled(strain.maps(name, row)) for name in ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")
        }
        dx = np.array([-0.5, 0.5, 0.5, -0.5]) * grid.step
        dy = np.array([-0.5, -0.5, 0.5, 0.5]) * grid.step
        x = (grid.x + moved["u"][..., 0])[..., None] + dx + moved["du_dx"] * dx + moved["du_dy"] * dy
        y = (grid.y[:, None] + moved["v"][..., 0])[..., None] + dy + moved["dv_dx"] * dx + moved["dv_dy"] * dy
        return (np.stack([x, y], axis=-1) + 0.5) * self._zoom - 0.5


def _filled(values: NDArray[Any]) -> NDArray[np.float64]:
    """With a last axis; ZOIs without a value lie where they were (the status map shows them)."""
    return np.where(np.isfinite(values), values, 0.0).astype(np.float64)[..., None]


def status_table() -> Image:
    """(number of statuses + 1, 4) RGBA; what is unknown is transparent."""
    found = np.zeros((len(Status) + 1, 4), np.uint8)
    for status, word in zip(Status, STATUS_COLOURS, strict=False):
        digits = bytes.fromhex(word[1:])
        found[int(status)] = (*digits[:3], digits[3] if len(digits) == 4 else 255)
    return found


def plain(text: str) -> str:
    """ASCII for OpenCV's letters."""
    return text.replace("µ", "u").replace("±", "+-").encode("ascii", "replace").decode()


def caption(strain: Strain, row: int) -> str:
    """Time and force of an instant."""
    force = float(strain.values["force_N"][row])
    return f"t = {strain.time_s[row]:.3f} s" + ("" if math.isnan(force) else f"   F = {force:.1f} N")


def _write(full: Image, words: str, place: tuple[int, int], size: float) -> None:
    cv2 = load_cv2()
    cv2.putText(full, plain(words), place, cv2.FONT_HERSHEY_SIMPLEX, size, _INK, 1, cv2.LINE_AA)
